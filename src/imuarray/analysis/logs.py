"""Any logger's files as one recording of the array, and an account of what that took."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from imuarray.errors import InputError
from imuarray.recording import Recording, read_recording

RECORDINGS = (".nc", ".nc4", ".h5")


class Opened(NamedTuple):
    """A recording, lines that say what became of the logs, and groups to keep in its file."""

    recording: Recording
    lines: list[str]
    groups: dict[str, xr.Dataset]


def open_logs(
    paths: Sequence[str | PathLike],
    columns: str | PathLike | None = None,
    topics: Sequence[str] = (),
) -> Opened:
    """Logs of one rig as one recording: CSV files, ROS bags, or a recording (.nc).

    ``columns`` is the YAML of docs/convert.md, which a recording does not need; ``topics`` those
    of bags to use, the reference first. IMUs that share their stamps, with known axes, become
    samples as they are. InputError says what does not fit.
    """
    from imuarray.recording import bags, csv_logs, rig

    logs = [Path(path) for path in paths]
    found: Recording | rig.Rig
    if len(logs) == 1 and logs[0].suffix in RECORDINGS:
        return Opened(read_recording(logs[0]), [], {})
    if all(map(bags.is_bag, logs)):
        found = bags.read_bags(logs, columns, topics)
    elif columns is None:
        raise InputError(f"{logs[0]}: expected a YAML that describes it, found none")
    else:
        found = csv_logs.read_tables(logs, columns)
    if isinstance(found, Recording):
        return Opened(found, [], {})
    recording = rig.recording_of(found)
    if recording is None:
        raise InputError(
            f"{found.source}: expected IMUs with common stamps and known axes, found others"
        )
    return Opened(recording, found.lines, {})
