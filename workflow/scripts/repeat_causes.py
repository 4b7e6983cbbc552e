"""How positions repeat under each model -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray_papers.measured.causes import repeated

    tables = {
        name: pd.read_csv(path, dtype={"accelerometer": str})
        for name, path in zip(snakemake.params.names, snakemake.input, strict=True)
    }
    write_csv(repeated(tables), snakemake.output[0])
