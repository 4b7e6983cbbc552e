"""Gain, position error and coverage before and after, by effect -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake) as settings:
    import json
    from pathlib import Path

    from imuarray.blind.summary import gain_table, recordings
    from imuarray.figures import blind_tables
    from imuarray.figures.notes import scale_line
    from imuarray.figures.tables import write_table

    rows = json.loads(Path(snakemake.input.rows).read_text(encoding="utf-8"))["rows"]
    caption = "Blind study: what the extended model gains."
    notes = blind_tables.gain_notes(scale_line(settings))
    write_table(
        gain_table(recordings(rows)), blind_tables.GAIN, caption, notes,
        **dict(snakemake.output.items()),
    )  # fmt: skip
