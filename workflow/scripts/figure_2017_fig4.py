"""Paper 2017, figure 4: RMSE of the positions over N and iterations -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2017 import figure_2017_fig4
    from imuarray.figures.publish import publish

    publish(figure_2017_fig4, snakemake)
