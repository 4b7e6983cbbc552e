"""One corrected recording fitted group by group -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from pathlib import Path

    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording
    from imuarray_papers.measured.causes import stepwise

    recording = read_recording(Path(snakemake.input[0]) / f"{snakemake.wildcards.name}.nc")
    write_csv(stepwise(recording), snakemake.output[0])
