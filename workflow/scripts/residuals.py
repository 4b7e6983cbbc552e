"""Residuals beside the simulation's, in assumed sigmas -> summary and histogram, CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from dataclasses import replace

    import numpy as np

    from imuarray.estimation.selection import select_dynamic
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
    summary, histogram = compare(moving, rng)
    write_csv(summary, snakemake.output.summary)
    write_csv(histogram, snakemake.output.histogram)
