"""Acceptance against sigma_q -> CSV per T, with the variance of log p-hat at the chosen N."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np
    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording
    from imuarray.streams import stream
    from imuarray_papers.posterior.tuning import acceptance_sweep, choose_draws
    from imuarray_papers.studies.bayes import mode_of, target_for

    paper, count = settings["paper2021"], settings["scale"]["acceptance_steps"]
    steps = np.geomspace(*(paper["sweep_steps"][key] for key in ("first", "last", "count")))
    given = snakemake.input.recordings, snakemake.input.variances, snakemake.output
    for samples, source, variance, path in zip(paper["samples"], *given, strict=True):
        recording, sweep = read_recording(source), pd.read_csv(variance)
        draws = choose_draws(sweep.draws, sweep.variance, paper["variance_target"])
        target = target_for(settings, recording, draws)
        fresh = target.likelihood.realisations(  # not those that chose N
            recording.relative_positions(),
            draws,
            settings["scale"]["variance_realisations"],
            stream(settings["seed"], "variance at the chosen N", samples),
        )
        rates = acceptance_sweep(
            target,
            mode_of(settings, recording),
            steps,
            count,
            stream(settings["seed"], "acceptance sweep", samples),
            snakemake.threads,
        )
        table = pd.DataFrame(
            {"samples": samples, "draws": draws, "step_length_m": steps, "acceptance": rates}
        )
        table["acceptance_se"] = np.sqrt(rates * (1 - rates) / count)
        write_csv(table.assign(transitions=count, variance=fresh.var(ddof=1)), path)
