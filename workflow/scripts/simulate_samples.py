"""Simulate the 2021 dataset of T samples -> recording with its truth (NetCDF)."""

from job import job

with job(snakemake) as settings:
    from imuarray.provenance import stamp
    from imuarray.recording import write_recording
    from imuarray.studies.bayes import simulate_dataset

    recording, truth = simulate_dataset(settings, int(snakemake.wildcards.samples))
    write_recording(
        recording,
        snakemake.output[0],
        truth,
        stamp(settings, settings["seed"]),
    )
