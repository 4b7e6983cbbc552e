"""Every claim of the two papers against the results -> CSV and Markdown."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    from pathlib import Path

    from imuarray.claims import Results, evaluate, write_markdown
    from imuarray.provenance import write_csv

    kinds = {"experiment": snakemake.params.experiment, "simulation": snakemake.params.simulation}  # noqa: F821
    root = Path(snakemake.output.table).parents[1]  # noqa: F821
    results = Results(root, settings, kinds=kinds)
    table = evaluate(results)
    write_csv(table, snakemake.output.table)  # noqa: F821
    write_markdown(table, settings, snakemake.output.page)  # noqa: F821
