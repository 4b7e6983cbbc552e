"""Paper 2017, figure 5: RMSE of the positions over |omega|, |omega_dot| -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2017 import figure_2017_fig5
    from imuarray.figures.publish import publish

    publish(figure_2017_fig5, snakemake)
