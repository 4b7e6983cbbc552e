"""The work behind `imuarray convert`."""

import numpy as np

from imuarray.commands.output import Output
from imuarray.errors import require
from imuarray.provenance import stamp, write_bytes
from imuarray.recording import Recording, write_recording


def convert_mimu(arguments) -> None:
    """A MIMU board's packets to a recording, with an account of what was dropped."""
    from imuarray.recording.mimu_recording import read_board

    recording, account = read_board(
        arguments.data, arguments.positions, arguments.underside,
        accelerometer_noise_sd=arguments.accelerometer_noise,
        gyroscope_noise_sd=float(np.radians(arguments.gyroscope_noise_dps)),
        position_prior_sd=arguments.position_prior, output_rate=arguments.output_rate,
    )  # fmt: skip
    attrs = stamp({"source": str(arguments.data)}, 0) | account.attributes()
    write_recording(recording, arguments.out, attrs=attrs)
    _report(arguments, recording, account.lines())


def draft_columns(arguments) -> None:
    """A log's description, guessed from its header and readings; never over another one."""
    from imuarray.recording.draft import draft

    output, out = Output(arguments), arguments.out
    require(not out.exists(), str(out), "a new file", "one that is there already")
    text, asked = draft(arguments.data)
    write_bytes(text.encode(), out)
    output.say("\n".join([f"{out}: a draft; look at", *(f"- {line}" for line in asked)]))
    output.done({"out": str(out), "not_known": asked})


def convert_logs(arguments) -> None:
    """Tables or bags, and their description, to a recording."""
    from imuarray.analysis.logs import open_logs

    found = open_logs(arguments.data, arguments.columns, getattr(arguments, "topics", ()))
    attrs = stamp({"source": ", ".join(map(str, arguments.data))}, 0)
    write_recording(found.recording, arguments.out, attrs=attrs)
    _report(arguments, found.recording, found.lines)


def _report(arguments, recording: Recording, lines: list[str]) -> None:
    output = Output(arguments)
    samples, count = recording.specific_force.shape[:2]
    seconds = float(recording.time[-1] - recording.time[0])
    rate = float(1 / np.median(np.diff(recording.time))) if samples > 1 else np.nan
    first = f"{arguments.out}: {samples} samples of {count} IMUs, {rate:.2f} Hz, {seconds:.1f} s"
    output.say("\n".join([first, *lines]))
    output.done({
        "out": str(arguments.out), "samples": samples, "accelerometers": count, "rate_hz": rate,
        "duration_s": seconds, "account": lines,
    })  # fmt: skip
