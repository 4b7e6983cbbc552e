"""Paper 2021, figure 5, under the sensor model -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2021_array import figure_experiment
    from imuarray.figures.publish import publish
    from imuarray.recording import array_of, load_dataset, read_recording

    def read_array(path):
        return array_of(read_recording(path))

    publish(figure_experiment, snakemake, located=load_dataset, recordings=read_array)
