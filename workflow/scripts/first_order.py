"""Per-triad calibration from still poses -> corrected recording, and its tables."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from imuarray.firstorder import report
    from imuarray.firstorder.correct import calibrate_first_order
    from imuarray.firstorder.report import write_corrected
    from imuarray.firstorder.settings import SETTINGS as FIRSTORDER
    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording
    from imuarray.recording.units import GRAVITY

    entry, made = snakemake.params.entry, snakemake.output
    recording = read_recording(snakemake.input.recording)
    found = calibrate_first_order(
        recording,
        entry.get("gravity", GRAVITY),
        entry.get("gyroscopes", "calibrate"),
        entry.get("shortest_pose", FIRSTORDER.shortest),
    )
    write_csv(report.parameter_table(found, recording), made.parameters)
    write_csv(report.residual_table(found, recording), made.residuals)
    write_csv(report.noise_table(found, recording), made.noise)
    write_csv(report.allan_table(found.poses, recording), made.allan)
    write_corrected(recording, found, made.recording)
