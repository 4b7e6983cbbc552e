"""Diagnoses of all batches compared with the truth: graded rows -> JSON, and flat as CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import json
    from pathlib import Path

    from imuarray.provenance import stamp, write_csv, write_json
    from imuarray_papers.blind.study import grade
    from imuarray_papers.blind.summary import recordings

    entries = []
    for path in snakemake.input.batches:
        entries += json.loads(Path(path).read_text(encoding="utf-8"))["cases"]
    rows = sorted((grade(entry) for entry in entries), key=lambda row: row["case"])
    found = {"rows": rows, "stamp": stamp(settings, settings["seed"])}
    write_json(found, snakemake.output.rows)
    write_csv(recordings(rows), snakemake.output.table)
