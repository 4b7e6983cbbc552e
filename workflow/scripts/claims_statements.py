"""What the accuracy rests on -> CSV; kinds of motion, the motion's own error, averaging -> JSON."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.provenance import stamp, write_csv, write_json
    from imuarray.recording import read_recording
    from imuarray_papers.config import model_from, motion_sds
    from imuarray_papers.studies.checks import statements as checks
    from imuarray_papers.studies.position_error import magnitudes

    paper, experiment, seed = settings["paper2017"], settings["experiment"], settings["seed"]
    model, count = model_from(settings), paper["fig4_samples"][-1]
    sizes, normal = magnitudes(paper), motion_sds(settings)
    recording = read_recording(snakemake.input.recording)
    hand = experiment["bandwidth"], experiment["sampling_rate"]
    real = checks.moving(recording)
    write_csv(checks.dependence(model, seed, count, sizes), snakemake.output.dependence)
    write_json(
        {
            "samples": count,
            "bound_m": checks.any_motion(model, seed, count, sizes, normal, hand, real),
            "motion": checks.motion_efficiency(model, seed, count, sizes),
            "differentiation": checks.differentiation(model, seed, count, normal, *hand),
            "sds": [float(np.std(field)) for field in real[:3]],
            "averaging": checks.averaging(recording) if recording.still().any() else None,
            "spread": checks.spread_by_rate(recording),
            "stamp": stamp(settings, seed),
        },
        snakemake.output.checks,
    )
