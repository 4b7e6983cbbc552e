"""Effects added to a measured recording: found on top of what is there? -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.blind_tables import table_added
    from imuarray.figures.publish import publish

    publish(table_added, snakemake)
