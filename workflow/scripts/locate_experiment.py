"""Positions from few samples of a recording whose sensors are known from others -> NetCDF."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from imuarray.provenance import write_netcdf
    from imuarray.recording import load_dataset, read_recording
    from imuarray_papers.measured.left_out import located

    recording = read_recording(snakemake.input.recording)
    calibration = load_dataset(snakemake.input.calibration)
    found = located(recording, calibration, snakemake.params.samples)
    write_netcdf(found, snakemake.output[0])
