"""CSV files of IMUs that have stamps, and rates, of their own."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from imuarray.errors import InputError
from imuarray.recording.layout import KINDS, read_layout, three_columns
from imuarray.recording.record import Recording
from imuarray.recording.rig import Readings, Rig, pair, to_rig

LONG = 400  # rows, in which missed readings are bridged; blanks in fewer are a damaged table


def read_tables(paths: Sequence[str | PathLike], columns: str | PathLike) -> Recording | Rig:
    """One table of a board with whole rows, or logs with stamps of their own.

    ``columns`` is the YAML of docs/convert.md. InputError, with the row or the key, for anything
    that does not fit.
    """
    layout, files = read_layout(columns), [Path(path) for path in paths]
    if "imus" not in layout and len(files) > 1:
        raise InputError(f"{columns}: expected 'imus', one for each log, found triads of one table")
    loaded = {path: load(path, layout, columns) for path in files}
    if "imus" in layout:
        return _read(loaded, layout, layout["imus"], str(columns))
    table = loaded[files[0]]
    blank = used(table, layout).isna().mean()
    slow = (blank > (0.0 if len(table) > LONG else OFTEN)).any()
    if slow and "incomplete_rows" not in layout:
        if "output_rate" in layout:
            raise InputError(
                f"{columns}: output_rate: expected none where cells are blank, found one"
            )
        return _read(loaded, layout, _imus(layout, str(columns)), str(columns))
    return recording_of(table, layout, files[0], columns)


def _read(loaded, layout, imus: dict[str, dict], name: str) -> Rig:
    read, unused, stamped = {}, list(loaded), True
    for label, imu in imus.items():
        where = f"{name}: imus {label!r}"
        units = [np.prod(unit_of(imu[kind], kind, where)) for kind in KINDS]
        paths = [_file(log, label, list(loaded), where) for log in pair(imu.get("log"))]
        times = pair(imu.get("time", layout.get("time")))
        stamped &= len(loaded) == 1 or not any(isinstance(t, dict) and "rate" in t for t in times)
        six = imu.get("columns", layout.get("columns"))
        if not isinstance(six, list) or len(six) != 6:
            raise InputError(
                f"{where}: expected six columns, three of the accelerometer and three of the"
                f" gyroscope, found {six!r}"
            )
        unused = [path for path in unused if path not in paths]
        read[label] = [
            _readings(loaded[path], str(path), names, time, unit, where)
            for path, names, time, unit in zip(paths, (six[:3], six[3:]), times, units, strict=True)
        ]
    if unused:
        raise InputError(f"{unused[0]}: expected an IMU of {name} to be in it, found none")
    rig = to_rig(imus, read, layout, name, ", ".join(path.name for path in loaded))
    return rig._replace(stamped=stamped)


def _file(log: Any, label: str, files: list[Path], where: str) -> Path:
    """The file that ends as the YAML says; by default the only one, or the one of that label."""
    if log is None and len(files) == 1:
        return files[0]
    want = PurePath(label if log is None else str(log)).parts
    n = len(want)
    found = [p for p in files if n and want in (p.parts[-n:], p.with_suffix("").parts[-n:])]
    if len(found) != 1:
        names = ", ".join(map(str, files))
        raise InputError(
            f"{where}: expected one of {names} to be {'/'.join(want)}, found {len(found)}:"
            " 'log' names it"
        )
    return found[0]


def _readings(table, path: str, names, time, unit: float, where: str) -> Readings:
    names = three_columns(names, where)
    values = [column(table, name, path, blank=True).astype(float) for name in names]
    stamps, second = stamps_of(table, time, path, where, blank=True)
    return Readings(stamps, second, unit * np.stack(values, axis=1), f"{path}: {', '.join(names)}")


def _imus(layout, where: str) -> dict[str, dict]:
    """A board's triads as IMUs, where some are slower than the log: those of a label are one."""
    force, rate = (layout[kind]["triads"] for kind in KINDS)
    found = {}
    for label, triad in force.items():
        other = rate.get(label)
        axes = [t.get("axes", list("xyz")) for t in (triad, other or {})]
        if other is None or len(rate) != len(force) or axes[0] != axes[1]:
            raise InputError(
                f"{where}: {label!r}: expected, as some cells are blank, an accelerometer and a"
                f" gyroscope of each label with the same axes, found others{BLANK}"
            )
        columns = [
            name
            for t in (triad, other)
            for name in three_columns(t["columns"], f"{where}: {label!r}")
        ]
        found[label] = {"columns": columns, "position": triad["position"], "axes": axes[0]} | {
            kind: layout[kind] for kind in KINDS
        }
    return found
