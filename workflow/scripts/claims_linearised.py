"""Linearised posteriors of every recording, and the printed determinant's effect -> CSV, CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np
    import pandas as pd

    from imuarray.motion import normal_motion
    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording, read_truth
    from imuarray.simulation.recordings import simulate_samples
    from imuarray.streams import stream
    from imuarray_papers.config import model_from, motion_sds
    from imuarray_papers.studies.bayes import select_disjoint
    from imuarray_papers.studies.checks import linearised
    from imuarray_papers.studies.checks.marginalisation import tiny_model

    paper, sd = settings["paper2021"], settings["noise"]["accelerometer_sd"]
    assumed = settings["experiment"]["accelerometer_sd"]
    paths = dict(zip(snakemake.params.names, snakemake.input.recordings, strict=True))
    model, tables, effects = model_from(settings), [], []

    def analyse(name, recording, truth, force_sd, gyroscopes, samples):
        given = (recording, truth, model, force_sd, gyroscopes)
        tables.append(linearised.coordinates(*given, name))
        precision = model_from(settings, force_sd).noise.accelerometer_precision
        theta = truth["position"].to_numpy()[1:].ravel()
        effect = linearised.determinant_effect(
            linearised.linearise(*given)[1], theta, samples, precision
        )
        effects.append({"name": name, "samples": samples, "method": "linearised"} | effect)

    for samples in paper["samples"]:
        name = f"T{samples}"
        recording, truth = read_recording(paths[name]), read_truth(paths[name])
        analyse(name, recording, truth, sd, model.array.gyroscopes, samples)
        for kind in snakemake.params.kinds:
            whole, truth = read_recording(paths[kind]), read_truth(paths[kind])
            index = select_disjoint(whole, paper["samples"])[samples]
            chosen, there = whole.select(index), truth.isel(time=index)
            analyse(f"{kind}_T{samples}", chosen, there, assumed, 1, samples)
            analyse(f"{kind}_small_noise_T{samples}", chosen, there, sd, 1, samples)
    write_csv(pd.concat(tables), snakemake.output.coordinates)

    rng, samples = stream(settings["seed"], "determinant"), paper["samples"][0]
    for force_sd in (sd, assumed):
        small = tiny_model(force_sd, np.radians(settings["noise"]["gyroscope_sd_dps"]))
        motion = normal_motion(rng, (samples,), *motion_sds(settings))
        place = small.array.positions
        recording, truth = simulate_samples(
            small, motion, place, place, rng, position_prior_sd=paper["prior_sd"]
        )
        label = {"name": f"tiny, sigma_a {force_sd:g}", "samples": samples}
        covariance = linearised.linearise(recording, truth, small, force_sd, 1)[1]
        effects.append(
            label | {"method": "linearised"}
            | linearised.determinant_effect(
                covariance, small.array.parameters, samples, small.noise.accelerometer_precision
            )
        )  # fmt: skip
        effects.append(
            label | {"method": "sampling"}
            | linearised.determinant_by_sampling(recording, truth, small, rng)
        )  # fmt: skip
    write_csv(pd.DataFrame(effects), snakemake.output.determinant)
