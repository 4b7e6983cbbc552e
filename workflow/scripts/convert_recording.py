"""A configured recording's file -> recording (NetCDF)."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from imuarray.analysis.logs import open_logs
    from imuarray.provenance import stamp
    from imuarray.recording import write_recording

    given = snakemake.input
    found = open_logs(given.file, given.get("columns", given.get("positions")))
    print(f"{len(found.recording.time)} samples", *found.lines, sep="\n")
    write_recording(found.recording, snakemake.output[0], attrs=stamp({"file": given.file}, 0))
