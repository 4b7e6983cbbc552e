"""An effect on one IMU of a measured recording -> recording, truth."""

from imuarray.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.blind.measured import add
    from imuarray.provenance import stamp, write_json
    from imuarray.recording import read_recording, write_recording

    made = snakemake.output
    recording = read_recording(snakemake.input.recording)
    changed, truth = add(recording, snakemake.wildcards.effect, settings["seed"])
    write_recording(changed, made.recording, attrs=stamp(settings, settings["seed"]))
    write_json(truth, made.truth)
