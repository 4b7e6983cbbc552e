"""The work behind `imuarray diagnose`."""

from __future__ import annotations

import sys
import time

from imuarray.criticism.describe import MEANING
from imuarray.criticism.diagnosis import diagnose as criticise
from imuarray.errors import InputError
from imuarray.model import EFFECTS
from imuarray.recording import read_recording
from imuarray.report.write import write_report


def diagnose(arguments) -> None:
    """Name what the papers' model gets wrong on a recording; a folder with the evidence."""
    for name in arguments.without:
        if name not in {*MEANING, *EFFECTS}:
            known = ", ".join(sorted({*MEANING, *EFFECTS}))
            raise InputError(f"--without: expected any of {known}, found {name}")
    recording = read_recording(arguments.recording)
    begun = time.monotonic()

    def say(text):
        if not arguments.quiet:
            print(f"{time.monotonic() - begun:6.1f} s  {text}", file=sys.stderr, flush=True)

    found = criticise(recording, arguments.seed, arguments.without, arguments.recording, say)
    write_report(found, arguments.out)
    if arguments.quiet:
        return
    document = found.document
    for cause in document["causes"]:
        print(f"{cause['effect']}: {cause['says']}")
    if not document["causes"]:
        print("no cause named: the recording is what the model simulates, as far as it shows")
    if document["unexplained"]:
        print(f"unexplained: {', '.join(document['remaining'])}")
    gain = document["gain"]
    print(
        f"held-out log score: {gain['heldout_log_score_nats_per_sample']:+.3g} +-"
        f" {gain['heldout_log_score_nats_per_sample_se']:.2g} nats a sample; report:"
        f" {arguments.out / 'report.html'}"
    )
