"""Cramer-Rao bound of the positions in the settings of figures 4 and 5 of 2017 -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.provenance import write_csv
    from imuarray_papers.config import model_from
    from imuarray_papers.studies.bound import bound_table
    from imuarray_papers.studies.position_error import study

    cases = [case for name in ("samples", "motion") for case in study(settings, name)[0]]
    table = bound_table(
        model_from(settings), settings["seed"], [(case.samples, *case.motion) for case in cases]
    )
    write_csv(table, snakemake.output[0])
