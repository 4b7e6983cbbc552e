"""Iterations to 1.01 times the bound, ML-BCD and Gauss-Newton, by motion -> CSV."""

from job import job

with job(snakemake) as settings:
    from itertools import product

    import numpy as np

    from imuarray.config import model_from
    from imuarray.provenance import write_csv
    from imuarray.studies import bound

    paper, theory, scale = settings["paper2017"], settings["theory"], settings["scale"]
    motions = [
        (*np.radians(pair), paper["specific_force"])
        for pair in product(paper["fig5_rates_dps"], paper["fig5_accelerations_dps2"])
    ]
    options = {
        "position_sd": paper["position_sd"], "rail": np.radians(paper["gyroscope_range_dps"]),
        "limit": bound.BCD_LIMIT,
    }  # fmt: skip
    table = bound.convergence(
        model_from(settings), settings["seed"], theory["convergence_samples"], motions, options,
        scale["theory_repeats"], snakemake.threads,
    )  # fmt: skip
    write_csv(table, snakemake.output[0])
