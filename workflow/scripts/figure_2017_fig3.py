"""Paper 2017, figure 3: RMSE of the angular rate over |omega| -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2017 import figure_2017_fig3
    from imuarray.figures.publish import publish

    publish(figure_2017_fig3, snakemake)
