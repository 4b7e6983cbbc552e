"""Paper 2021, figure 1: layout and dimensions of the array -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2021_array import figure_2021_fig1
    from imuarray.figures.publish import publish

    publish(figure_2021_fig1, snakemake)
