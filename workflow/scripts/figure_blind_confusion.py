"""What is named for what there is -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.blind import figure_blind_confusion
    from imuarray.figures.publish import publish

    publish(figure_blind_confusion, snakemake)
