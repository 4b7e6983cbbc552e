"""RMSE of ML-BCD positions over |s| (2017, section IV: it does not matter) -> CSV."""

from job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.config import model_from
    from imuarray.provenance import write_csv
    from imuarray.studies.position_error import rmse_against_motion
    from imuarray.studies.settings2017 import magnitudes, options

    paper = settings["paper2017"]
    rate, acceleration, _ = magnitudes(paper)
    motions = [(rate, acceleration, force) for force in np.array([0.0, 1.0, 10.0, 100.0])]
    table = rmse_against_motion(
        model_from(settings), settings["seed"], "force", paper["fig5_samples"], motions,
        options(settings, [max(paper["fig4_iterations"])]), snakemake.threads, quiet=False,
    )  # fmt: skip
    write_csv(table, snakemake.output[0])
