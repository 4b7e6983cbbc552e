"""The Cramer-Rao bound against the array's size -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.publish import publish
    from imuarray.figures.theory import figure_theory_size

    publish(figure_theory_size, snakemake)
