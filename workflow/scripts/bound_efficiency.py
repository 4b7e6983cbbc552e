"""RMSE of the most likely positions beside the Cramer-Rao bound -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np
    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray_papers.config import model_from
    from imuarray_papers.studies import bound
    from imuarray_papers.studies.position_error import magnitudes

    paper, theory, scale = settings["paper2017"], settings["theory"], settings["scale"]
    options = {
        "position_sd": paper["position_sd"], "rail": np.radians(paper["gyroscope_range_dps"]),
        "realisations": scale["theory_realisations"],
    }  # fmt: skip
    cases = [(theory["samples"], 1.0)]
    cases += [([theory["noise_samples"]], factor) for factor in theory["noise_factors"]]
    tables = [
        bound.efficiency(
            model_from(settings), settings["seed"], samples, magnitudes(paper), options,
            snakemake.threads, quiet=False, noise=factor,
        )
        for samples, factor in cases
    ]  # fmt: skip
    write_csv(pd.concat(tables), snakemake.output[0])
