"""A recording's held-out log density under the board of the others and other models -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from imuarray.provenance import write_csv
    from imuarray.recording import load_dataset, read_recording
    from imuarray_papers.measured.left_out import predicted

    recording = read_recording(snakemake.input.recording)
    write_csv(predicted(recording, load_dataset(snakemake.input.calibration)), snakemake.output[0])
