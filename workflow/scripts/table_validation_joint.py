"""The joint test of samplers and simulation -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.publish import publish
    from imuarray.figures.validation import table_validation_joint

    publish(table_validation_joint, snakemake)
