"""A figure (PDF, PNG, CSV) or a table (CSV, LaTeX, Markdown), by the function that a rule names."""

from imuarray.pipeline.job import job

with job(snakemake):
    from imuarray.figures.publish import publish

    publish(snakemake)
