"""Algebra, limits and unbiasedness of the estimator of 2021, its tuning rules -> JSON."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.provenance import stamp, write_json
    from imuarray.recording import read_recording, read_truth
    from imuarray.streams import stream
    from imuarray_papers.config import model_from, motion_sds
    from imuarray_papers.studies.checks import marginalisation as checks

    model, paper, seed = model_from(settings), settings["paper2021"], settings["seed"]
    sds = motion_sds(settings)
    count = 20 * settings["scale"]["variance_realisations"]

    def rng(name):
        return stream(seed, "marginalisation", name)

    path = snakemake.input.recording[0]
    recording, nominal = read_recording(path), read_recording(path).relative_positions()
    start = paper["start_sd"] * rng("start").standard_normal(nominal.shape)
    start[0] = 0.0  # the reference stays where it is
    places = {
        "start": nominal + start, "prior mean": nominal,
        "truth": read_truth(path)["position"].to_numpy(),
    }  # fmt: skip

    found = {
        "limits": checks.limits(rng("limits"), model, sds),
        "determinant": checks.determinant_power(rng("determinant"), model, sds),
        "six_dimensions": checks.six_dimensions(rng("six"), model, sds),
        "log_sum_exp": checks.log_sum_exp(rng("log-sum-exp")),
        "underflow": checks.underflow(
            rng("underflow"), model, recording.specific_force, recording.angular_rate, places
        ),
        "unbiased": checks.unbiased(rng("unbiased"), count),
        "effective_draws": checks.effective_draws(rng("effective"), model, sds),
        "theory": checks.theory(),
        "random_walk": checks.best_acceptance(rng("walk"), model.array.parameters.size),
        "stamp": stamp(settings, seed),
    }
    write_json(found, snakemake.output[0])
