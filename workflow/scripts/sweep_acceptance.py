"""Acceptance against sigma_q -> CSV: samples, draws, step_length_m, acceptance, acceptance_se."""

from job import job

with job(snakemake) as settings:
    import numpy as np
    import pandas as pd

    from imuarray.posterior.tuning import acceptance_sweep, choose_draws
    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording
    from imuarray.streams import stream
    from imuarray.studies.bayes import mode_of, target_for

    samples, paper = int(snakemake.wildcards.samples), settings["paper2021"]
    recording = read_recording(snakemake.input.recording)
    sweep = pd.read_csv(snakemake.input.variance)
    draws = choose_draws(sweep.draws, sweep.variance, paper["variance_target"])
    target = target_for(settings, recording, draws)
    steps = np.geomspace(*(paper["sweep_steps"][key] for key in ("first", "last", "count")))
    count = settings["scale"]["acceptance_steps"]
    rates = acceptance_sweep(
        target, mode_of(settings, recording), steps, count,
        stream(settings["seed"], "acceptance sweep", samples),
    )  # fmt: skip
    table = pd.DataFrame(
        {
            "samples": samples,
            "draws": draws,
            "step_length_m": steps,
            "acceptance": rates,
            "acceptance_se": np.sqrt(rates * (1 - rates) / count),
            "transitions": count,
        }  # fmt: skip
    )
    write_csv(table, snakemake.output[0])
