"""A board from all recordings but one, which is corrected by their maps -> two NetCDF files."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from imuarray.provenance import digest, stamp, write_netcdf
    from imuarray.recording import read_recording, write_recording
    from imuarray_papers.measured.left_out import left_out

    entry, made = snakemake.params.entry, snakemake.output
    recording, *others = [
        read_recording(path) for path in (snakemake.input.recording, *snakemake.input.others)
    ]
    options = {key: entry[key] for key in ("gravity", "shortest_pose") if key in entry}
    corrected, calibration = left_out(recording, others, **options)
    data = digest(*(one.angular_rate for one in (recording, *others)))
    origin = stamp({"recordings": data}, 0)
    write_recording(corrected, made.recording, attrs=origin)
    write_netcdf(calibration.assign_attrs(origin), made.calibration)
