"""The work behind `imuarray diagnose`."""

from imuarray.commands.output import Answer, Output
from imuarray.diagnosis.document import diagnose as run
from imuarray.errors import require
from imuarray.model.effects import DATA_EFFECTS, EFFECTS
from imuarray.recording import read_recording
from imuarray.report.write import write_report
from imuarray.trust import of_file, reasons_of_diagnosis, reasons_of_poses


def diagnose(arguments, output: Output) -> Answer:
    """Name what the plain model misses on a recording; a folder with the report."""
    known = {*EFFECTS, *DATA_EFFECTS}
    for name in arguments.without:
        require(name in known, "--without", f"any of {', '.join(sorted(known))}", name)
    recording = read_recording(arguments.recording)
    found = run(recording, arguments.seed, arguments.without, arguments.recording, output.step)
    reasons = reasons_of_poses(of_file(arguments.recording))
    reasons += reasons_of_diagnosis(recording, found.document)
    found.document.update(trusted=not reasons, reasons=reasons)
    write_report(found, arguments.out)
    lines = [*report(found.document), f"report: {arguments.out / 'report.html'}"]
    return Answer("\n".join(lines), found.document, reasons)


def report(document: dict) -> list[str]:
    """diagnosis.json for a person: the causes, what is left, the gain."""
    lines = [cause["says"] for cause in document["causes"]]
    if not lines:
        lines = ["no cause named: the recording is what the model simulates, as far as it shows"]
    if document["unexplained"]:
        lines.append(f"unexplained: {', '.join(document['remaining'])}")
    gain = document["gain"]
    score = gain["heldout_log_score_nats_per_sample"]
    error = gain["heldout_log_score_nats_per_sample_se"]
    return [*lines, f"held-out log score: {score:+.3g} +- {error:.2g} nats a sample"]
