"""Positions of each subset for each sigma_a, assumed or estimated, and by ML-BCD -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording
    from imuarray_papers.measured.positions import locate_table

    name, sigmas = snakemake.wildcards.name, settings["experiment"]["sigmas"]
    parts = []
    for samples, path in zip(
        settings["paper2021"]["samples"], snakemake.input.subsets, strict=True
    ):
        parts.append(locate_table(read_recording(path), sigmas, recording=name, samples=samples))
    write_csv(pd.concat(parts, ignore_index=True), snakemake.output[0])
