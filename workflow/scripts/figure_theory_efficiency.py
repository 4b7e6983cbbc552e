"""RMSE of the positions beside the Cramer-Rao bound -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.publish import publish
    from imuarray.figures.theory import figure_theory_efficiency

    publish(figure_theory_efficiency, snakemake)
