"""Chains for figure 5 and table II: T samples of a recording, sigma_a enlarged.

Of a simulated recording they are chosen here; measured ones come chosen, from a board of their own.
N and sigma_q are tuned here, on the subset itself, as in section III-C.
"""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.recording import read_recording
    from imuarray_papers.studies.bayes import sample_paired, select_disjoint, tuned_experiment

    kind, counts = snakemake.wildcards.kind, settings["paper2021"]["samples"]
    lengths, threads = settings["scale"][snakemake.params.lengths], snakemake.threads
    measured = "subsets" in snakemake.input.keys()
    if measured:
        recordings = [read_recording(path) for path in snakemake.input.subsets]
    else:
        whole = read_recording(snakemake.input.recording)
        chosen = select_disjoint(whole, counts)
        recordings = [whole.select(chosen[samples]) for samples in counts]
    for samples, recording, path in zip(counts, recordings, snakemake.output, strict=True):
        given, names = settings, ("experiment", kind, samples)
        if measured:
            board = {"positions": recording.accelerometer_position.tolist(),
                     "labels": list(recording.accelerometer_labels)}  # fmt: skip
            given = {**settings, "array": board}
        target, step, record = tuned_experiment(given, recording, names, threads)
        attrs = {"samples": samples, "draws_per_sample": target.draws, **record}
        steps = lengths[f"T{samples}"]
        sample_paired(given, recording, target, step, steps, names, path, attrs, threads)
