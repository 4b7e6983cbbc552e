"""A configured recording's file -> recording (NetCDF)."""

from job import job

with job(snakemake):
    import json
    from pathlib import Path

    from imuarray.provenance import stamp
    from imuarray.recording import write_recording
    from imuarray.recording.sources import read_source

    entry = snakemake.params.entry
    table = json.loads(Path(snakemake.input.available).read_text(encoding="utf-8"))
    recording, account = read_source(entry, table["available"][snakemake.wildcards.name])
    print(f"{len(recording.time)} samples, {account}")
    write_recording(recording, snakemake.output[0], attrs=stamp(entry, 0) | account)
