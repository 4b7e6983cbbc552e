"""Choose N and sigma_q from the sweeps -> JSON per T: samples, draws, step_length_m, ..."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.provenance import stamp, write_json
    from imuarray_papers.posterior.tuning import choose_step

    paper = settings["paper2021"]
    given = snakemake.input.acceptances, snakemake.output
    for samples, acceptance, path in zip(paper["samples"], *given, strict=True):
        sweep = pd.read_csv(acceptance)
        chosen = {
            "samples": samples,
            "draws": int(sweep.draws[0]),
            "step_length_m": choose_step(
                sweep.step_length_m, sweep.acceptance, paper["acceptance_target"]
            ),
            "variance": float(sweep.variance[0]),
            "acceptance_target": paper["acceptance_target"],
        }
        write_json(chosen | {"stamp": stamp(settings, settings["seed"])}, path)
