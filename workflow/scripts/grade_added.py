"""Effects added to a measured recording: found on top of what is there? -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    import json
    from pathlib import Path

    import pandas as pd

    from imuarray.blind.added import grade_added
    from imuarray.figures import blind_tables
    from imuarray.figures.tables import write_table

    def read(path):
        return json.loads(Path(path).read_text(encoding="utf-8"))

    before = read(snakemake.input.before)
    pairs = zip(snakemake.input.truths, snakemake.input.after, strict=True)
    table = pd.DataFrame([grade_added(read(truth), before, read(after)) for truth, after in pairs])
    table["found"] = table.found.map({True: "yes", False: "no"})
    caption = "Effects added to a measured recording."
    notes = blind_tables.added_notes(snakemake.wildcards.name)
    write_table(table, blind_tables.ADDED, caption, notes, **dict(snakemake.output.items()))
