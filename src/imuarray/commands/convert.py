"""The work behind `imuarray convert`."""

from __future__ import annotations

import numpy as np

from imuarray.commands.output import Output
from imuarray.provenance import stamp
from imuarray.recording import Recording, write_recording


def convert_mimu(arguments) -> None:
    """A MIMU board's packets to a recording, with an account of what was dropped."""
    from imuarray.recording.mimu import read_mimu
    from imuarray.recording.mimu_recording import read_positions, to_recording, turned_labels

    positions, labels = read_positions(arguments.positions)
    underside = turned_labels(labels, arguments.underside)
    stream = read_mimu(arguments.data)
    recording = to_recording(
        stream, positions, labels, underside, arguments.accelerometer_noise,
        float(np.radians(arguments.gyroscope_noise_dps)), arguments.position_prior,
        source=arguments.data.name,
    )  # fmt: skip
    attrs = stamp({"source": str(arguments.data)}, 0) | stream.account.attributes()
    write_recording(recording, arguments.out, attrs=attrs)
    _report(arguments, recording, stream.account.lines())


def convert_csv(arguments) -> None:
    """A table and its description to a recording."""
    from imuarray.recording.table import read_table

    recording = read_table(arguments.data, arguments.columns)
    write_recording(recording, arguments.out, attrs=stamp({"source": str(arguments.data)}, 0))
    _report(arguments, recording, [])


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
