"""Every claim of the two papers against the results -> CSV and Markdown."""

from imuarray.pipeline.job import job

with job(snakemake) as settings:
    from pathlib import Path

    from imuarray.claims.registry import evaluate, markdown
    from imuarray.claims.results import Results
    from imuarray.provenance import write_bytes, write_csv

    root = Path(snakemake.output.table).parents[1]
    results = Results(root, settings)
    table = evaluate(results)
    write_csv(table, snakemake.output.table)
    write_bytes(markdown(table, settings).encode(), snakemake.output.page)
