"""Iterations that ML-BCD and Gauss-Newton need -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.publish import publish
    from imuarray.figures.theory import figure_theory_convergence

    publish(figure_theory_convergence, snakemake)
