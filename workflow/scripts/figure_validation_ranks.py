"""Rank histograms of the simulation-based calibration -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.publish import publish
    from imuarray.figures.validation import figure_validation_ranks

    publish(figure_validation_ranks, snakemake)
