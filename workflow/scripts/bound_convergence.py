"""Iterations to 1.01 times the bound, ML-BCD and Gauss-Newton, by motion -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from itertools import product

    import numpy as np
    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray_papers.config import model_from
    from imuarray_papers.studies import bound
    from imuarray_papers.studies.position_error import magnitudes

    paper, theory, scale = settings["paper2017"], settings["theory"], settings["scale"]
    motions = [
        (*np.radians(pair), paper["specific_force"])
        for pair in product(paper["fig5_rates_dps"], paper["fig5_accelerations_dps2"])
    ]
    options = {
        "position_sd": paper["position_sd"], "rail": np.radians(paper["gyroscope_range_dps"]),
        "limit": bound.BCD_LIMIT,
    }  # fmt: skip
    model = model_from(settings)
    rest = options, scale["theory_repeats"], snakemake.threads
    where = settings["seed"], theory["convergence_samples"]
    tables = [bound.convergence(model, *where, motions, *rest)]
    for other in bound.geometries(model).values():
        tables.append(bound.convergence(other, *where, [magnitudes(paper)], *rest))
    write_csv(pd.concat(tables), snakemake.output[0])
