"""Rank and conditioning of the information over N, motion and geometry -> CSV."""

from job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.config import model_from
    from imuarray.provenance import write_csv
    from imuarray.studies import bound
    from imuarray.studies.settings2017 import magnitudes

    sds = settings["paper2021"]
    normal = (
        np.radians(sds["angular_rate_sd_dps"]), np.radians(sds["angular_acceleration_sd_dps2"]),
        sds["specific_force_sd"],
    )  # fmt: skip
    cases = bound.rank_cases(
        model_from(settings), settings["seed"], magnitudes(settings["paper2017"]), normal
    )
    write_csv(bound.ranks(cases), snakemake.output[0])
