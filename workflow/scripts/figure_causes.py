"""What each cause buys in repeatability and residual -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.board import figure_causes
    from imuarray.figures.publish import publish

    publish(figure_causes, snakemake)
