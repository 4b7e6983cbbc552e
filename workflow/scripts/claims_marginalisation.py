"""Algebra, limits and unbiasedness of the estimator of 2021, its tuning rules -> JSON."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import numpy as np

    from imuarray.config import model_from
    from imuarray.provenance import stamp, write_json
    from imuarray.streams import stream
    from imuarray.studies.checks import marginalisation as checks
    from imuarray.studies.checks import proposal

    model, paper, seed = model_from(settings), settings["paper2021"], settings["seed"]
    sds = (
        np.radians(paper["angular_rate_sd_dps"]),
        np.radians(paper["angular_acceleration_sd_dps2"]),
        paper["specific_force_sd"],
    )
    count = 20 * settings["scale"]["variance_realisations"]

    def rng(name):
        return stream(seed, "marginalisation", name)

    found = {
        "limits": checks.limits(rng("limits"), model, sds),
        "determinant": checks.determinant_power(rng("determinant"), model, sds),
        "six_dimensions": checks.six_dimensions(rng("six"), model, sds),
        "log_sum_exp": checks.log_sum_exp(rng("log-sum-exp")),
        "unbiased": checks.unbiased(rng("unbiased"), count),
        "effective_draws": checks.effective_draws(rng("effective"), model, sds),
        "spread": checks.spread_ratio(rng("spread"), model, sds),
        "theory": proposal.theory(),
        "random_walk": proposal.best_acceptance(rng("walk"), model.array.parameters.size),
        "stamp": stamp(settings, seed),
    }
    write_json(found, snakemake.output[0])  # noqa: F821
