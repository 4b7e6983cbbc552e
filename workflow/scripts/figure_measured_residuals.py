"""What the simulation gets wrong: residuals beside the simulation's -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.measured import figure_measured_residuals
    from imuarray.figures.publish import publish

    publish(figure_measured_residuals, snakemake)
