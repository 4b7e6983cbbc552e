"""Paper 2021, figure 5: ellipses of the positions on the board -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2021_array import figure_2021_fig5
    from imuarray.figures.publish import publish
    from imuarray.posterior.chains import read_chains
    from imuarray.recording import array_of, read_recording

    def read_array(path):
        return array_of(read_recording(path))

    publish(figure_2021_fig5, snakemake, chains=read_chains, recordings=read_array)
