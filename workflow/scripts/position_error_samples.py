"""RMSE of ML-BCD positions over N and iterations (2017, figure 4) -> CSV."""

from job import job

with job(snakemake) as settings:
    from imuarray.config import model_from
    from imuarray.provenance import write_csv
    from imuarray.studies.position_error import rmse_against_samples
    from imuarray.studies.settings2017 import magnitudes, options

    paper = settings["paper2017"]
    table = rmse_against_samples(
        model_from(settings), settings["seed"], paper["fig4_samples"], magnitudes(paper),
        options(settings, paper["fig4_iterations"]), snakemake.threads, quiet=False,
    )  # fmt: skip
    write_csv(table, snakemake.output[0])
