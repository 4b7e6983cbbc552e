"""Rank and conditioning of the information over N, motion and geometry -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.provenance import write_csv
    from imuarray_papers.config import model_from, motion_sds
    from imuarray_papers.studies import bound
    from imuarray_papers.studies.position_error import magnitudes

    cases = bound.rank_cases(
        model_from(settings), settings["seed"], magnitudes(settings["paper2017"]),
        motion_sds(settings),
    )  # fmt: skip
    write_csv(bound.ranks(cases), snakemake.output[0])
