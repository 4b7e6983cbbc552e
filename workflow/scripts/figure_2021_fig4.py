"""Paper 2021, figure 4: posterior of IMU 2's position for each T -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2021 import figure_2021_fig4
    from imuarray.figures.publish import publish
    from imuarray.posterior.chains import read_chains

    publish(figure_2021_fig4, snakemake, chains=read_chains)
