"""Any logger's files as one recording of the array, and an account of what that took."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from imuarray.errors import InputError
from imuarray.recording import Recording, read_recording
from imuarray.recording.rig import Rig, recording_of

RECORDINGS = (".nc", ".nc4", ".h5")
PACKETS = ".bin"


class Opened(NamedTuple):
    """A recording, and lines that say what became of the logs."""

    recording: Recording
    lines: list[str]


def open_logs(
    paths: str | PathLike | Sequence[str | PathLike],
    columns: str | PathLike | None = None,
    topics: Sequence[str] = (),
) -> Opened:
    """Logs of one rig as one recording: tables, ROS bags, a MIMU board's packets, a recording.

    ``columns`` is the YAML of docs/convert.md, for packets (.bin) the CSV of positions, for a
    recording (.nc) none; ``topics`` those of bags to use, the reference first. IMUs that share
    their stamps, with known axes, become samples as they are; others are aligned (`alignment`),
    which the lines say and the recording keeps. InputError says what does not fit.
    """
    found = _opened(paths, columns, topics)
    _require_paired(found.recording)
    return found


def _require_paired(recording: Recording) -> None:
    """InputError where a gyroscope stands at the place of another IMU's accelerometer."""
    labels = recording.accelerometer_labels
    for place, label in enumerate(recording.gyroscope_labels):
        if label in labels and labels.index(label) != place:
            raise InputError(
                f"gyroscopes: expected them in the accelerometers' order, IMUs without one last,"
                f" found {label!r} as number {place + 1}, whose accelerometer is number"
                f" {labels.index(label) + 1}"
            )


def _opened(paths, columns, topics) -> Opened:
    from imuarray.recording import bags, csv_logs
    from imuarray.recording.mimu_recording import read_board

    logs = [Path(path) for path in ([paths] if isinstance(paths, str | PathLike) else paths)]
    if len(logs) == 1 and logs[0].suffix in RECORDINGS:
        return Opened(read_recording(logs[0]), [])
    if not logs or any(log.suffix in RECORDINGS for log in logs):
        raise InputError(f"logs: expected one recording, or what loggers wrote, found {len(logs)}")
    if all(map(bags.is_bag, logs)):
        return _together(bags.read_bags(logs, columns, topics))
    if columns is None:
        raise InputError(
            f"{logs[0]}: expected a YAML that describes it, found none: name it by --columns"
        )
    if len(logs) == 1 and logs[0].suffix == PACKETS:
        recording, account = read_board(logs[0], Path(columns))
        return Opened(recording, account.lines())
    return _together(csv_logs.read_tables(logs, columns))


def _together(found: Recording | Rig) -> Opened:
    """Samples as they are, or brought to common instants and axes, which is kept."""
    if isinstance(found, Recording):
        return Opened(found, [])
    recording = recording_of(found)
    if recording is not None:
        return Opened(recording, found.lines)
    from imuarray.alignment import align

    recording, alignment = align(
        found.logs, position_prior_sd=found.position_prior_sd, source=found.source
    )
    lines = [*found.lines, *alignment.lines()]
    return Opened(recording, lines)
