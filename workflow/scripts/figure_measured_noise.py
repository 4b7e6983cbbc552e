"""Allan deviation of the still poses beside the papers' noise -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.noise import figure_measured_noise
    from imuarray.figures.publish import publish

    publish(figure_measured_noise, snakemake)
