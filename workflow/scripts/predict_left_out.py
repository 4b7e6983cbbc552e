"""A recording's held-out log density under the board of the others and other models -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from imuarray.analysis.known import predicted
    from imuarray.provenance import write_csv
    from imuarray.recording import load_dataset, read_recording

    recording = read_recording(snakemake.input.recording)
    write_csv(predicted(recording, load_dataset(snakemake.input.calibration)), snakemake.output[0])
