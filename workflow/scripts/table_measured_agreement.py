"""Coverage and z-scores between recordings of a board -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.measured import table_measured_agreement
    from imuarray.figures.publish import publish

    publish(table_measured_agreement, snakemake)
