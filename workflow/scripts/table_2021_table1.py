"""Paper 2021, table I: tuning parameters and what came of them -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import json
    from pathlib import Path

    from imuarray.figures import tables
    from imuarray.figures.notes import scale_line

    read = [
        [json.loads(Path(path).read_text(encoding="utf-8")) for path in paths]
        for paths in (snakemake.input.tunings, snakemake.input.verdicts)  # noqa: F821
    ]
    table = tables.table1(*read)
    notes = [
        tables.NOT_IN_TEXT,
        *tables.unfinished(table, settings["paper2021"]["rhat_threshold"]),
        scale_line(settings) + ".",
    ]
    tables.write_table(
        table, tables.TABLE1, "Table I of 2021: values for the tuning parameters", notes,
        **dict(snakemake.output.items()),  # noqa: F821
    )  # fmt: skip
