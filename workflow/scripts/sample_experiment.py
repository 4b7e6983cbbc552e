"""Chains for figure 5 and table II: T disjoint samples of a recording, sigma_a enlarged.

N and sigma_q are tuned here, on the subset itself, as in section III-C.
"""

from job import job

with job(snakemake) as settings:
    import numpy as np

    from chains import sample_paired
    from imuarray.posterior import CompiledTarget
    from imuarray.posterior.tuning import (
        acceptance_sweep,
        choose_draws,
        choose_step,
        variance_sweep,
    )
    from imuarray.recording import read_recording
    from imuarray.streams import stream
    from imuarray.studies.bayes import mode_of, select_disjoint, target_for

    samples, kind = int(snakemake.wildcards.samples), snakemake.wildcards.kind
    paper, scale, seed = settings["paper2021"], settings["scale"], settings["seed"]
    names = ("experiment", kind, samples)
    whole = read_recording(snakemake.input.recording)
    recording = whole.select(select_disjoint(whole, paper["samples"])[samples])
    assumed = settings["experiment"]["accelerometer_sd"]
    target = target_for(settings, recording, 1, assumed, spread=True)
    counts = paper["sweep_draws"]
    variances = variance_sweep(
        target.likelihood, recording.relative_positions(), counts,
        scale["variance_realisations"] // 4, stream(seed, *names, "variance"),
    )  # fmt: skip
    draws = choose_draws(counts, variances, paper["variance_target"])
    target = CompiledTarget(target.likelihood, target.prior, draws)
    steps = np.geomspace(*(paper["sweep_steps"][key] for key in ("first", "last", "count"))) * 10
    mode = mode_of(settings, recording, assumed)
    rates = acceptance_sweep(
        target, mode, steps, scale["acceptance_steps"], stream(seed, *names, "acceptance")
    )
    step = choose_step(steps, rates, paper["acceptance_target"])
    sample_paired(
        settings, recording, target, step, scale["experiment_transitions"][f"T{samples}"],
        names, snakemake.output[0], {"samples": samples, "draws_per_sample": draws},
    )  # fmt: skip
