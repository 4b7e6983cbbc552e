"""RMSE of the angular rate without gyroscopes, over |omega| and position error -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.provenance import write_csv
    from imuarray_papers.config import model_from
    from imuarray_papers.studies.rate_error import accelerometers_only

    paper = settings["paper2017"]
    span, rail = paper["fig3_rates_dps"], paper["gyroscope_range_dps"]
    rates = np.radians([0.1 * rail, 0.5 * rail, rail, span["last"]])
    table = accelerometers_only(
        model_from(settings), settings["seed"], rates,
        np.radians(paper["angular_acceleration_dps2"]), paper["specific_force"],
        paper["fig3_position_sds"], settings["scale"]["realisations"],
    )  # fmt: skip
    write_csv(table, snakemake.output[0])
