"""Any logger's files as one recording of the array, and an account of what that took."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from imuarray.errors import InputError
from imuarray.recording import Recording, read_recording
from imuarray.recording.table import read_csv

RECORDINGS = (".nc", ".nc4", ".h5")


class Opened(NamedTuple):
    """A recording, lines that say what became of the logs, and groups to keep in its file."""

    recording: Recording
    lines: list[str]
    groups: dict[str, xr.Dataset]


def open_logs(paths: Sequence[str | PathLike], columns: str | PathLike | None = None) -> Opened:
    """Logs of one rig as one recording; ``columns`` is the YAML of docs/convert.md.

    A recording (.nc) needs none. InputError says what does not fit.
    """
    logs = [Path(path) for path in paths]
    if len(logs) != 1:
        raise InputError(f"logs: expected one file, found {len(logs)}")
    if logs[0].suffix in RECORDINGS:
        return Opened(read_recording(logs[0]), [], {})
    if columns is None:
        raise InputError(f"{logs[0]}: expected a YAML that describes it, found none")
    return Opened(read_csv(logs[0], columns), [], {})
