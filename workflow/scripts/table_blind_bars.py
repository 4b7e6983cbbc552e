"""The criteria of the blind study, measured -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.blind_tables import table_blind_bars
    from imuarray.figures.publish import publish

    publish(table_blind_bars, snakemake)
