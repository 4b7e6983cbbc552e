"""What the papers' model gets wrong on a recording -> diagnosis.json, report, figures."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from pathlib import Path

    from imuarray.diagnosis.document import diagnose
    from imuarray.recording import read_recording
    from imuarray.report.write import write_report

    recording = read_recording(snakemake.input.recording)
    found = diagnose(
        recording, settings["seed"], recording_path=snakemake.input.recording,
        notify=lambda text: print(text, flush=True),
    )  # fmt: skip
    write_report(found, Path(snakemake.output.diagnosis).parent)
