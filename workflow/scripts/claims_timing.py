"""Processor seconds that a transition (2021) takes over T -> CSV.

Also how the acceptance depends on the variance at the longest T -> CSV (that one is reproducible).
"""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import json

    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording, read_truth
    from imuarray.streams import stream
    from imuarray_papers.posterior.likelihood import CompiledTarget
    from imuarray_papers.studies.bayes import target_for
    from imuarray_papers.studies.checks import timing

    seed = settings["seed"]
    targets, thetas = {}, {}
    for path, tuned in zip(snakemake.input.recordings, snakemake.input.tuning, strict=True):
        with open(tuned, encoding="utf-8") as handle:
            chosen = json.load(handle)
        samples, draws = chosen["samples"], chosen["draws"]
        targets[samples] = target_for(settings, read_recording(path), draws)
        thetas[samples] = read_truth(path)["position"].to_numpy()[1:].ravel()
    rng = stream(seed, "timing transitions")
    moves = timing.transition_costs(targets, thetas, chosen["step_length_m"], rng)
    write_csv(moves, snakemake.output.timing)
    # the wide p(omega | y_g) of (30b) makes the variance really high
    sharp, wide = targets[samples], target_for(settings, read_recording(path), 1, spread=True)
    table = timing.acceptance_against_variance(
        {
            "tuned": sharp,
            "one draw": CompiledTarget(sharp.likelihood, sharp.prior, 1),
            "one draw, (30b)": wide,
        },
        thetas[samples], chosen["step_length_m"], 2 * settings["scale"]["acceptance_steps"],
        stream(seed, "acceptance over variance"),
    )  # fmt: skip
    write_csv(pd.DataFrame(table), snakemake.output.acceptance)
