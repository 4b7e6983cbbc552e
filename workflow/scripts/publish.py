"""A figure (PDF, PNG, CSV) or a table (CSV, LaTeX, Markdown), by the function that a rule names."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from imuarray_papers.figures.publish import publish

    publish(snakemake)
