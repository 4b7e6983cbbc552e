"""Chains of measured subsets or of their simulations, sigma_a enlarged: figure 5 and table II."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.recording import read_recording
    from imuarray_papers.studies.bayes import sample_paired, tuned_experiment

    kind, counts = snakemake.wildcards.kind, settings["paper2021"]["samples"]
    lengths = settings["scale"]["measured_transitions"]
    for samples, source, path in zip(
        counts, snakemake.input.recordings, snakemake.output, strict=True
    ):
        names = ("experiment", kind, samples)
        recording = read_recording(source)
        board = {"positions": recording.accelerometer_position.tolist(),
                 "labels": list(recording.accelerometer_labels)}  # fmt: skip
        given = {**settings, "array": board}
        target, step, record = tuned_experiment(given, recording, names, snakemake.threads)
        attrs = {"samples": samples, "draws_per_sample": target.draws, **record}
        sample_paired(
            given, recording, target, step, lengths[f"T{samples}"], names, path, attrs,
            snakemake.threads,
        )  # fmt: skip
