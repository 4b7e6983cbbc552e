"""A share of the realisations of ML-BCD's position errors (2017, figures 4 and 5) -> NPZ."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.provenance import atomic_write
    from imuarray_papers.config import model_from
    from imuarray_papers.studies.position_error import realise, study

    cases, options = study(settings, snakemake.wildcards.study)
    errors = realise(
        model_from(settings), settings["seed"], cases, options, snakemake.threads, quiet=False,
        part=int(snakemake.wildcards.part), parts=snakemake.params.parts,
    )  # fmt: skip
    with atomic_write(snakemake.output[0]) as path, open(path, "wb") as handle:
        np.savez(handle, **errors._asdict())
