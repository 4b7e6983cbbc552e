"""One corrected recording fitted rung by rung -> CSV."""

from imuarray.pipeline.job import job

with job(snakemake):
    from pathlib import Path

    from imuarray.measured.causes import bought
    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording

    recording = read_recording(Path(snakemake.input[0]) / f"{snakemake.wildcards.name}.nc")
    write_csv(bought(recording), snakemake.output[0])
