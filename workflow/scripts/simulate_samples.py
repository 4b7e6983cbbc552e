"""Simulate the 2021 dataset of T samples for each T -> recordings with their truth (NetCDF)."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.provenance import stamp
    from imuarray.recording import write_recording
    from imuarray_papers.studies.bayes import simulate_dataset

    for samples, path in zip(settings["paper2021"]["samples"], snakemake.output, strict=True):
        recording, truth = simulate_dataset(settings, samples)
        write_recording(recording, path, truth, stamp(settings, settings["seed"]))
