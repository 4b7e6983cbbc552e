"""Every claim of the two papers against the results -> CSV and Markdown."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    from pathlib import Path

    from imuarray.claims.page import markdown
    from imuarray.claims.registry import evaluate
    from imuarray.claims.results import Results
    from imuarray.provenance import write_bytes, write_csv

    kinds = {"experiment": snakemake.params.experiment, "simulation": snakemake.params.simulation}  # noqa: F821
    root = Path(snakemake.output.table).parents[1]  # noqa: F821
    results = Results(root, settings, kinds=kinds)
    table = evaluate(results)
    write_csv(table, snakemake.output.table)  # noqa: F821
    write_bytes(markdown(table, settings).encode(), snakemake.output.page)  # noqa: F821
