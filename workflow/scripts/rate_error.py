"""RMSE of the angular rate when positions are wrong (2017, figure 3) -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.provenance import write_csv
    from imuarray_papers.config import model_from
    from imuarray_papers.studies.rate_error import rmse_against_rate

    paper, scale = settings["paper2017"], settings["scale"]
    span = paper["fig3_rates_dps"]
    rates = np.radians(np.geomspace(span["first"], span["last"], scale["rate_points"]))
    table = rmse_against_rate(
        model_from(settings), settings["seed"], rates,
        np.radians(paper["angular_acceleration_dps2"]), paper["specific_force"],
        paper["fig3_position_sds"], scale["realisations"],
        np.radians(paper["gyroscope_range_dps"]), snakemake.threads,
    )  # fmt: skip
    write_csv(table, snakemake.output[0])
