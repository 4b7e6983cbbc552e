"""RMSE of the most likely positions beside the Cramer-Rao bound -> CSV."""

from job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.config import model_from
    from imuarray.provenance import write_csv
    from imuarray.studies import bound
    from imuarray.studies.settings2017 import magnitudes

    paper, theory, scale = settings["paper2017"], settings["theory"], settings["scale"]
    options = {
        "position_sd": paper["position_sd"], "rail": np.radians(paper["gyroscope_range_dps"]),
        "realisations": scale["theory_realisations"],
    }  # fmt: skip
    table = bound.efficiency(
        model_from(settings), settings["seed"], theory["samples"], magnitudes(paper), options,
        snakemake.threads, quiet=False,
    )  # fmt: skip
    write_csv(table, snakemake.output[0])
