"""How often intervals hold the truth, by method and T -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.validation import table_validation_coverage
    from imuarray.figures.publish import publish

    publish(table_validation_coverage, snakemake)
