"""Paper 2021, figure 2: variance of log p-hat over N -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2021 import figure_2021_fig2
    from imuarray.figures.publish import publish

    publish(figure_2021_fig2, snakemake)
