"""The Cramer-Rao bound against the size of the array -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.provenance import write_csv
    from imuarray_papers.config import model_from
    from imuarray_papers.studies import bound
    from imuarray_papers.studies.position_error import magnitudes

    paper, theory, scale = settings["paper2017"], settings["theory"], settings["scale"]
    table = bound.against_size(
        model_from(settings), settings["seed"], theory["convergence_samples"], magnitudes(paper),
        theory["size_factors"], scale["theory_repeats"],
    )  # fmt: skip
    write_csv(table, snakemake.output[0])
