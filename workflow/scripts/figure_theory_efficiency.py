"""RMSE of the positions beside the Cramer-Rao bound -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.theory import figure_theory_efficiency
    from imuarray.figures.publish import publish

    publish(figure_theory_efficiency, snakemake)
