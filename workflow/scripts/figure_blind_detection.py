"""How often an effect is found, over its size in sigma or in its own unit -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.blind import figure_blind_detection
    from imuarray.figures.publish import publish

    publish(figure_blind_detection, snakemake)
