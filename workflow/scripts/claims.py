"""Every claim of the two papers against the results -> CSV and Markdown."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from pathlib import Path

    from imuarray.provenance import write_bytes, write_csv
    from imuarray_papers.claims.registry import evaluate, markdown
    from imuarray_papers.claims.results import Results

    root = Path(snakemake.output.table).parents[1]
    results = Results(root, settings)
    table = evaluate(results)
    write_csv(table, snakemake.output.table)
    write_bytes(markdown(table, settings).encode(), snakemake.output.page)
