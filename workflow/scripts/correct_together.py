"""All recordings of a board, corrected by the poses of them all -> a folder of NetCDF files."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from pathlib import Path

    from imuarray.firstorder.correct import calibrate_together, correct
    from imuarray.recording import read_recording, write_recording

    entries, folder = snakemake.params.entries, Path(snakemake.output[0])
    first = next(iter(entries.values()))
    options = {key: first[key] for key in ("gravity", "shortest_pose") if key in first}
    recordings = [read_recording(path) for path in snakemake.input]
    folder.mkdir(parents=True)
    found = calibrate_together(recordings, **options)
    for name, recording, own in zip(entries, recordings, found, strict=True):
        write_recording(correct(recording, own), folder / f"{name}.nc")
