"""The criteria of the blind study, measured -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake) as settings:
    import json
    from pathlib import Path

    from imuarray.blind.criteria import criteria
    from imuarray.blind.summary import recordings
    from imuarray.figures import blind_tables
    from imuarray.figures.notes import scale_line
    from imuarray.figures.tables import write_table

    rows = json.loads(Path(snakemake.input.rows).read_text(encoding="utf-8"))["rows"]
    table = recordings(rows)
    notes = blind_tables.bars_notes(table, scale_line(settings))
    caption = "Blind study: what was asked of the diagnosis, and what was measured."
    write_table(
        blind_tables.shown(criteria(table)), blind_tables.BARS, caption, notes,
        **dict(snakemake.output.items()),
    )  # fmt: skip
