"""Choose N and sigma_q from the sweeps -> JSON per T: samples, draws, step_length_m, ..."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.posterior.tuning import choose_step
    from imuarray.provenance import stamp, write_json

    paper = settings["paper2021"]
    given = snakemake.input.acceptances, snakemake.input.variances, snakemake.output
    for samples, acceptance, variance, path in zip(paper["samples"], *given, strict=True):
        sweep, table = pd.read_csv(acceptance), pd.read_csv(variance)
        draws = int(sweep.draws[0])
        near = (table.draws - draws).abs().idxmin()
        chosen = {
            "samples": samples,
            "draws": draws,
            "step_length_m": choose_step(
                sweep.step_length_m, sweep.acceptance, paper["acceptance_target"]
            ),
            "variance_nearest": float(table.variance[near] * table.draws[near] / draws),
            "acceptance_target": paper["acceptance_target"],
        }
        write_json(chosen | {"stamp": stamp(settings, settings["seed"])}, path)
