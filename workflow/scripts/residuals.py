"""Residuals beside the simulation's, in assumed sigmas -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from dataclasses import replace

    import numpy as np

    from imuarray.analysis.selection import select_dynamic
    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording
    from imuarray.streams import stream
    from imuarray_papers.measured.residuals import compare

    noise = settings["noise"]
    whole = replace(
        read_recording(snakemake.input.recording),
        accelerometer_noise_sd=noise["accelerometer_sd"],
        gyroscope_noise_sd=float(np.radians(noise["gyroscope_sd_dps"])),
    )
    moving = whole.select(select_dynamic(whole).usable)
    rng = stream(settings["seed"], "residuals", snakemake.wildcards.name)
    write_csv(compare(moving, rng), snakemake.output[0])
