"""Paper 2021, figure 3: trace, histogram, autocorrelation of r_2's x -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2021 import figure_2021_fig3
    from imuarray.figures.publish import publish
    from imuarray.posterior.chains import read_chains

    publish(figure_2021_fig3, snakemake, chains=read_chains)
