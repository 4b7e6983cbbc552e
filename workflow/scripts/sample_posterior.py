"""Paired PmMH chains of one T -> DataTree (NetCDF); checkpoints beside the results."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import json

    from imuarray.recording import read_recording
    from imuarray_papers.studies.bayes import sample_paired, target_for

    samples = int(snakemake.wildcards.samples)
    recording = read_recording(snakemake.input.recording)
    with open(snakemake.input.tuning, encoding="utf-8") as handle:
        tuning = json.load(handle)
    target = target_for(settings, recording, tuning["draws"])
    sample_paired(
        settings, recording, target, tuning["step_length_m"],
        settings["scale"]["transitions"][f"T{samples}"], ("pmmh", samples),
        snakemake.output[0], {"samples": samples, "draws_per_sample": tuning["draws"]},
        snakemake.threads,
    )  # fmt: skip
