"""RMSE of ML-BCD positions over |omega| and |omega_dot| (2017, figure 5) -> CSV."""

from job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.config import model_from
    from imuarray.provenance import write_csv
    from imuarray.studies.position_error import rmse_against_motion
    from imuarray.studies.settings2017 import options

    paper = settings["paper2017"]
    motions = [
        (np.radians(rate), np.radians(acceleration), paper["specific_force"])
        for acceleration in paper["fig5_accelerations_dps2"]
        for rate in paper["fig5_rates_dps"]
    ]
    table = rmse_against_motion(
        model_from(settings), settings["seed"], "motion", paper["fig5_samples"], motions,
        options(settings, [paper["fig5_iterations"]]), snakemake.threads, quiet=False,
    )  # fmt: skip
    write_csv(table, snakemake.output[0])
