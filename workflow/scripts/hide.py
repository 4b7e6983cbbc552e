"""An effect in a simulated recording, or on one IMU of a measured one -> recording, truth."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import json
    from pathlib import Path

    from imuarray.provenance import stamp, write_json
    from imuarray.recording import read_recording, write_recording
    from imuarray_papers.blind.cases import hidden, make
    from imuarray_papers.blind.measured import hide

    made, seed = snakemake.output, settings["seed"]
    if snakemake.input:
        document = json.loads(Path(snakemake.input.diagnosis).read_text(encoding="utf-8"))
        changed, truth = hide(read_recording(snakemake.input.recording), document, seed)
    else:
        changed, truth = make(hidden(snakemake.wildcards.hidden, seed), seed)
    write_recording(changed, made.recording, attrs=stamp(settings, seed))
    write_json(truth, made.truth)
