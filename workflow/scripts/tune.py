"""Choose N and sigma_q from the sweeps -> JSON: samples, draws, step_length_m, ..."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.posterior.tuning import choose_step
    from imuarray.provenance import stamp, write_json

    paper = settings["paper2021"]
    sweep = pd.read_csv(snakemake.input.acceptance)
    variance = pd.read_csv(snakemake.input.variance)
    draws = int(sweep.draws[0])
    step = choose_step(sweep.step_length_m, sweep.acceptance, paper["acceptance_target"])
    nearest = (variance.draws - draws).abs().idxmin()
    write_json(
        {
            "samples": int(snakemake.wildcards.samples),
            "draws": draws,
            "step_length_m": step,
            "variance_nearest": float(variance.variance[nearest] * variance.draws[nearest] / draws),
            "acceptance_target": paper["acceptance_target"],
            "stamp": stamp(settings, settings["seed"]),
        },
        snakemake.output[0],
    )
