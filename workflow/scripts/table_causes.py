"""What each cause buys in repeatability and residual -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.board import table_causes
    from imuarray.figures.publish import publish

    publish(table_causes, snakemake)
