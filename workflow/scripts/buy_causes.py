"""One recording fitted rung by rung, the gyroscopes' map from all of the board -> CSV."""

from imuarray.pipeline.job import job

with job(snakemake):
    from imuarray.firstorder.correct import calibrate_first_order, correct
    from imuarray.measured.causes import bought
    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording

    entry = snakemake.params.entry
    recording, *others = [
        read_recording(path) for path in (snakemake.input.recording, *snakemake.input.others)
    ]
    options = {key: entry[key] for key in ("gravity", "shortest_pose") if key in entry}
    found = calibrate_first_order(recording, **options, others=others)
    write_csv(bought(correct(recording, found)), snakemake.output[0])
