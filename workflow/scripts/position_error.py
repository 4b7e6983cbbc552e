"""RMSE of ML-BCD positions (2017, figures 4 and 5) from the shares of its realisations -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.provenance import write_csv
    from imuarray_papers.studies.position_error import Errors, joined, study, table_of

    name = snakemake.wildcards.study
    cases, options = study(settings, name)
    shares = []
    for path in snakemake.input.parts:
        with np.load(path) as stored:
            shares.append(Errors(**stored))
    write_csv(table_of(name, cases, joined(shares), options["marks"]), snakemake.output[0])
