"""Chains for figure 5 and table II: T disjoint samples of a recording, sigma_a enlarged.

N and sigma_q are tuned here, on the subset itself, as in section III-C.
"""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.recording import read_recording
    from imuarray_papers.studies.bayes import sample_paired, select_disjoint, tuned_experiment

    kind, lengths = snakemake.wildcards.kind, settings["scale"]["experiment_transitions"]
    whole = read_recording(snakemake.input.recording)
    subsets = select_disjoint(whole, settings["paper2021"]["samples"])
    for samples, path in zip(settings["paper2021"]["samples"], snakemake.output, strict=True):
        names = ("experiment", kind, samples)
        recording = whole.select(subsets[samples])
        target, step, record = tuned_experiment(settings, recording, names, snakemake.threads)
        attrs = {"samples": samples, "draws_per_sample": target.draws, **record}
        steps = lengths[f"T{samples}"]
        sample_paired(
            settings, recording, target, step, steps, names, path, attrs, snakemake.threads
        )
