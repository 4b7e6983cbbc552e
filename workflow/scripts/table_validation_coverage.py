"""How often intervals hold the truth, by method and T -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.publish import publish
    from imuarray.figures.validation import table_validation_coverage

    publish(table_validation_coverage, snakemake)
