"""Anybody's logger: CSV files, and a small YAML that names their columns and units.

One table of a board, or files of IMUs that have stamps, and rates, of their own.
"""

from collections.abc import Sequence
from difflib import get_close_matches
from os import PathLike
from pathlib import Path, PurePath
from typing import Any

import numpy as np
import pandas as pd

from imuarray.errors import InputError, expecting, require
from imuarray.recording import layout as layouts
from imuarray.recording import written
from imuarray.recording.record import Recording
from imuarray.recording.rig import Readings, Rig, pair, to_rig
from imuarray.recording.settings import SETTINGS
from imuarray.recording.units import factor, require_plausible_rate

LEAVE_OUT = "leave out"  # what `incomplete_rows` may be
BLANK = "; `incomplete_rows: leave out` keeps the rows that are whole"


def recording_of(table: pd.DataFrame, layout, path, columns) -> tuple[Recording, list[str]]:
    """A board's table as samples, and what was done to its rows; InputError as `read_tables`."""
    where, name = str(path), str(columns)
    table, account = _whole(table, layout, name)
    section, clock = _clock(layout["time"], name)
    time, rows, lines = _time(table, section, where, name)
    table = table.iloc[rows]
    force, axes = _sensors(table, layout, "accelerometers", where, name)
    rate, _ = _sensors(table, layout, "gyroscopes", where, name)
    given = layouts.numbers(layout, name)
    if "output_rate" in layout:
        given["output_period"] = 1 / layouts.positive(layout["output_rate"], f"{name}: output_rate")
    given |= clock
    triads, others = (layout[kind]["triads"] for kind in layouts.KINDS)
    found = Recording(
        time=time, specific_force=force, angular_rate=rate,
        accelerometer_position=layouts.positions(triads, layout, f"{name}: accelerometers"),
        accelerometer_labels=tuple(map(str, triads)), gyroscope_labels=tuple(map(str, others)),
        accelerometer_axes=axes, source=Path(path).name, selected=account, **given,
    )  # fmt: skip
    return found, lines


def load(path, layout, columns) -> tuple[pd.DataFrame, list[str]]:
    """The table, and how it is written; columns as its header has them: twins are seen."""
    options = {"sep": layout.get("delimiter"), "comment": layout.get("comment")}
    for key, usual in (("delimiter", ","), ("comment", "#")):
        value = layout.get(key, usual)
        runs = key == "delimiter" and value == written.WHITESPACE
        one = isinstance(value, str) and (len(value) == 1 or runs)
        require(one, f"{columns}: {key}", "one character", repr(value))
    with expecting(path, "a CSV file with a header", written.UNREADABLE):
        options, lines = written.form_of(Path(path), _named(layout), options)
        # Two rows: a first data row longer than the header is an error here, while with a header
        # pandas would take its first cell for an index and move every name by one column.
        header = options.pop("header")
        head = pd.read_csv(path, skipinitialspace=True, header=None, nrows=2, dtype=str, **options)
        table = pd.read_csv(path, skipinitialspace=True, header=header, **options)
        names = head.iloc[0].fillna("").str.strip()
        table.columns = names if header == 0 else [str(k + 1) for k in range(table.shape[1])]
    require(len(table) > 0, str(path), "rows of readings below the header", "none")
    table, more = written.rows_of_numbers(table)
    table, cut = written.without_cut(table, Path(path))
    return table, [*lines, *(f"{Path(path).name}: {line}" for line in more + cut)]


def _named(section) -> set[str]:
    """Columns that a layout names, anywhere in it."""
    if isinstance(section, list):
        return set().union(*map(_named, section))
    if not isinstance(section, dict):
        return set()
    own = [section[key] for key in ("column", "columns", "sensor") if key in section]
    names = {str(x) for one in own for x in (one if isinstance(one, list) else [one])}
    return names.union(*map(_named, section.values()))


def _whole(table, layout, columns: str) -> tuple[pd.DataFrame, str]:
    """The rows to be used, numbered as in the file, and how many of how many."""
    if "incomplete_rows" not in layout:
        return table, ""
    rule = layout["incomplete_rows"]
    require(rule == LEAVE_OUT, f"{columns}: incomplete_rows", f"'{LEAVE_OUT}'", repr(rule))
    whole = table.loc[:, table.columns.isin(_named(layout))].notna().all(axis=1)
    return table[whole], "" if whole.all() else f"{whole.sum()} of {len(table)} samples"


def _alike(name: str, table) -> str:
    """The table's columns of nearly that name, or all."""
    have = [str(column) for column in table.columns]
    near = get_close_matches(str(name), list(dict.fromkeys(have)))
    return f"none; did you mean {' or '.join(near)}?" if near else ", ".join(have)


def column(table, name, where, blank: bool = False) -> np.ndarray:
    """A column's numbers, integers where all are; InputError unless finite, or ``blank`` (NaN)."""
    if name not in table.columns:
        raise InputError(f"{where}: expected a column {name!r}, found {_alike(name, table)}")
    once = list(table.columns).count(name) == 1
    require(once, where, f"one column {name!r}", "several of that name")
    values = pd.to_numeric(table[name], errors="coerce").to_numpy()
    values = values if values.dtype.kind == "i" else values.astype(float)
    bad = ~np.isfinite(values) & ~(table[name].isna().to_numpy() & blank)
    if bad.any():
        cell = table[name].iloc[np.argmax(bad)]
        shown = repr(cell) if isinstance(cell, str) else "inf" if np.isinf(cell) else "none or NaN"
        raise InputError(
            f"{where}: column {name!r}: expected numbers, found {shown} in data row"
            f" {table.index[np.argmax(bad)] + 1} ({bad.sum()} of {values.size} rows)"
            + (BLANK if table[name].isna().any() else "")
        )
    return values


def _sensors(table, layout, kind, where, layout_name):
    """Readings (T, K, 3) in SI units in the array frame, and the turns (K, 3, 3) to it."""
    section = layout[kind]
    unit, parts, turns = layouts.unit_of(section, kind, layout_name), [], []
    for label, triad in section["triads"].items():
        place = f"{layout_name}: {kind} {label!r}"
        names = layouts.three_columns(triad["columns"], place)
        own = np.stack([column(table, name, where).astype(float) for name in names], axis=1)
        turns.append(layouts.rotation(triad.get("axes", list("xyz")), place))
        # what is infinite is refused where readings are checked
        with np.errstate(over="ignore", invalid="ignore"):
            parts.append(unit * own @ turns[-1].T)
    return np.stack(parts, axis=1), np.array(turns)


def stamps_of(table, section, where, layout_name, blank: bool = False) -> tuple[np.ndarray, float]:
    """A log's stamps, and what one is in s."""
    if isinstance(section, dict) and set(section) == {"rate"}:
        rate = layouts.positive(section["rate"], f"{layout_name}: time: rate")
        return table.index.to_numpy() / rate, 1.0
    stamped = isinstance(section, dict) and set(section) == {"column", "unit"}
    expected = "'column' and 'unit', or 'rate' in Hz"
    require(stamped, f"{layout_name}: time", expected, repr(section))
    name = str(section["column"])
    once = list(table.columns).count(name) == 1
    stamps, unit = written.seconds_of_dates(table[name]) if once else None, 1e-9
    if stamps is None:
        unit = factor("time", section["unit"], f"{layout_name}: time: unit")
        stamps = column(table, name, where, blank)
    known = stamps[np.isfinite(stamps)]
    if len(known) >= SETTINGS.few_stamps:
        place = f"{where}: column {name!r}"
        require_plausible_rate(unit * (known - known[0]), place, section["unit"])
    return stamps, unit


def _clock(section: Any, where: str) -> tuple[Any, dict[str, float]]:
    """The section without what it says of a board's clock, and that, or a declared rate's sd."""
    if not isinstance(section, dict):
        return section, {}
    rest = {key: value for key, value in section.items() if key != "clock_sd"}
    if len(rest) < len(section):
        return rest, {"clock_sd": layouts.positive(section["clock_sd"], f"{where}: time: clock_sd")}
    return rest, {"clock_sd": SETTINGS.clock_sd} if "rate" in section else {}


def _time(table, section, where, layout_name) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Times (T,) s, the rows that they are of, and lines on what was done to the stamps."""
    values, unit = stamps_of(table, section, where, layout_name)
    if "rate" in section:
        return values, np.arange(len(values)), []
    values, rows, lines = written.in_order(values, table, f"{where}: column {section['column']!r}")
    table = table.iloc[rows]
    back = np.flatnonzero(np.diff(values) <= 0)
    if back.size:
        i = back[0]
        raise InputError(
            f"{where}: column {section['column']!r}: expected a time that increases, found"
            f" {values[i + 1]:.15g} after {values[i]:.15g} in data row {table.index[i + 1] + 1}"
            f" ({back.size} such steps)"
        )
    # from the first sample: microseconds since 1970 would cost the last digits
    return unit * (values - values[:1]).astype(float), rows, lines


def read_tables(
    paths: Sequence[str | PathLike], columns: str | PathLike
) -> tuple[Recording | Rig, list[str]]:
    """One table of a board with whole rows, or logs with stamps of their own; how it is written.

    ``columns`` is the YAML of docs/convert.md. InputError, with the row or the key, for anything
    that does not fit.
    """
    layout, files = layouts.read_layout(columns), [Path(path) for path in paths]
    several = "imus" in layout or len(files) == 1
    require(several, str(columns), "'imus', one for each log", "triads of one table")
    loaded, lines = {}, []
    for path in files:
        loaded[path], said = load(path, layout, columns)
        lines += said
    if "imus" in layout:
        return _read(loaded, layout, layout["imus"], str(columns)), lines
    table = loaded[files[0]]
    of_triads = table.columns.isin(_named([layout[kind] for kind in layouts.KINDS]))
    blank = table.loc[:, of_triads].isna().mean()
    slow = (blank > (0.0 if len(table) > SETTINGS.long_log else SETTINGS.blank_share)).any()
    if slow and "incomplete_rows" not in layout:
        freely = "output_rate" not in layout
        require(freely, f"{columns}: output_rate", "none where cells are blank", "one")
        return _read(loaded, layout, _imus(layout, str(columns)), str(columns)), lines
    found, said = recording_of(table, layout, files[0], columns)
    return found, lines + said


def _read(loaded, layout, imus: dict[str, dict], name: str) -> Rig:
    read, unused, stamped = {}, list(loaded), True
    for label, imu in imus.items():
        where = f"{name}: imus {label!r}"
        units = [layouts.unit_of(imu[kind], kind, where) for kind in layouts.KINDS]
        paths = [_file(log, label, list(loaded), where) for log in pair(imu.get("log"))]
        times = pair(imu.get("time", layout.get("time")))
        stamped &= len(loaded) == 1 or not any(isinstance(t, dict) and "rate" in t for t in times)
        six = imu.get("columns", layout.get("columns"))
        expected = "six columns, three of the accelerometer and three of the gyroscope"
        require(isinstance(six, list) and len(six) == 6, where, expected, repr(six))
        unused = [path for path in unused if path not in paths]
        read[label] = [
            _readings(_own(loaded[path], layout, label, where), str(path), names, time, unit, where)
            for path, names, time, unit in zip(paths, (six[:3], six[3:]), times, units, strict=True)
        ]
    if unused:
        raise InputError(f"{unused[0]}: expected an IMU of {name} to be in it, found none")
    rig = to_rig(imus, read, layout, name, ", ".join(path.name for path in loaded))
    return rig._replace(stamped=stamped)


def _own(table: pd.DataFrame, layout, label: str, where: str) -> pd.DataFrame:
    """The rows of one IMU, where a column numbers the IMUs."""
    if "sensor" not in layout:
        return table
    stamped = "rate" not in str(layout.get("time"))
    require(stamped, where, "stamps, as each row is of one sensor", "a rate")
    name = str(layout["sensor"])
    require(name in table.columns, where, f"a column {name!r}", _alike(name, table))
    own = table[table[name].map(written.plain) == label]
    have = ", ".join(map(written.plain, table[name].unique()[: SETTINGS.few_stamps]))
    require(len(own) > 0, where, f"rows of it by column {name!r}", have)
    return own


def _file(log: Any, label: str, files: list[Path], where: str) -> Path:
    """The file that ends as the YAML says; by default the only one, or the one of that label."""
    if log is None and len(files) == 1:
        return files[0]
    want = PurePath(label if log is None else str(log)).parts
    n = len(want)
    found = [p for p in files if n and want in (p.parts[-n:], p.with_suffix("").parts[-n:])]
    expected = f"one of {', '.join(map(str, files))} to be {'/'.join(want)}"
    require(len(found) == 1, where, expected, f"{len(found)}: 'log' names it")
    return found[0]


def _readings(table, path: str, names, time, unit: float, where: str) -> Readings:
    names = layouts.three_columns(names, where)
    values = [column(table, name, path, blank=True).astype(float) for name in names]
    stamps, second = stamps_of(table, time, path, where, blank=True)
    steps = np.diff(stamps[np.isfinite(stamps)])
    if len(steps) and np.mean(steps == 0) > SETTINGS.shared_stamps and written.numbering(table):
        raise InputError(f"{path}: {written.shared_words(steps, table)}")
    with np.errstate(over="ignore"):  # as in `_sensors`
        readings = unit * np.stack(values, axis=1)
    lines: list[str] = []
    if len(steps) == len(stamps) - 1 > 0 and np.mean(steps == 0) < SETTINGS.equal_stamps:
        stamps, rows, lines = written.in_order(stamps, table, "stamps")
        readings = readings[rows]
    return Readings(stamps, second, readings, f"{path}: {', '.join(names)}", tuple(lines))


def _imus(layout, where: str) -> dict[str, dict]:
    """A board's triads as IMUs, where some are slower than the log: those of a label are one."""
    force, rate = (layout[kind]["triads"] for kind in layouts.KINDS)
    found = {}
    for label, triad in force.items():
        both = triad, rate.get(label, {})
        axes = [one.get("axes", list("xyz")) for one in both]
        if not both[1] or len(rate) != len(force) or axes[0] != axes[1]:
            raise InputError(
                f"{where}: {label!r}: expected, as some cells are blank, an accelerometer and a"
                f" gyroscope of each label with the same axes, found others{BLANK}"
            )
        columns = [layouts.three_columns(one["columns"], f"{where}: {label!r}") for one in both]
        found[label] = {
            "columns": sum(columns, []), "axes": axes[0],
            **{kind: layout[kind] for kind in layouts.KINDS},
            **{key: triad[key] for key in ("position",) if key in triad},
        }  # fmt: skip
    return found
