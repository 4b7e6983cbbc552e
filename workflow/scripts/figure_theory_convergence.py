"""Iterations that ML-BCD and Gauss-Newton need -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.theory import figure_theory_convergence
    from imuarray.figures.publish import publish

    publish(figure_theory_convergence, snakemake)
