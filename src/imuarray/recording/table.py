"""Anybody's logger: a CSV file, and a small YAML that names its columns and units."""

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from imuarray.errors import LARGEST, SMALLEST, InputError
from imuarray.recording.record import Recording
from imuarray.recording.units import factor
from imuarray.recording.validate import is_rotation

LEAVE_OUT = "leave out"  # what `incomplete_rows` may be
OFTEN = 0.1  # share of blank cells from which a sensor is slower than the log
BLANK = (
    "; is this sensor slower than the log? `incomplete_rows: leave out` keeps the rows that are"
    " whole; where there are none, bring the sensors to common instants first"
)
WIDEST = 2.0  # m; beyond this, positions without a declared unit are taken to be in another
WHITESPACE = r"\s+"  # the one delimiter longer than a character
KEYS = {
    "delimiter": False, "comment": False, "time": True, "incomplete_rows": False,
    "position_unit": False, "position_prior": False, "output_rate": False,
    "accelerometers": True, "gyroscopes": True,
}  # fmt: skip
KINDS = "accelerometers", "gyroscopes"
SENSOR_KEYS = {"unit": True, "scale": False, "noise": True, "range": True, "triads": True}
TRIAD_KEYS = {"columns": True, "position": False, "axes": False}


class _Loader(yaml.SafeLoader):
    """Safe YAML that refuses a key given twice: the second would silently replace the first.

    Keys (labels among them) and the names of columns are text as it stands: 010 and yes, too.
    """

    def construct_mapping(self, node, deep=False):
        scalars = [pair for pair in node.value if isinstance(pair[0], yaml.ScalarNode)]
        keys = [key.value for key, _ in scalars]
        for key, value in scalars:
            names = value.value if isinstance(value, yaml.SequenceNode) else [value]
            for name in [key] + names * (key.value in ("column", "columns")):
                if isinstance(name, yaml.ScalarNode) and not name.tag.endswith(":merge"):
                    name.tag = "tag:yaml.org,2002:str"
        twice = next((key for i, key in enumerate(keys) if key in keys[:i]), None)
        if twice is not None:
            line = node.start_mark.line + 1
            raise yaml.YAMLError(f"the key {twice!r} twice in the section at line {line}")
        return super().construct_mapping(node, deep)


def read_columns(path: str | PathLike) -> dict[str, Any]:
    """The YAML that describes a CSV; InputError for a missing file or a wrong key."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: expected a YAML file that names the columns, found none")
    try:
        layout = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        # ValueError: bytes that are no UTF-8, a date with a 13th month
        raise InputError(f"{path}: expected YAML, found {' '.join(str(error).split())}") from None
    _require_keys(layout, KEYS, str(path))
    for kind in KINDS:
        _require_keys(layout[kind], SENSOR_KEYS, f"{path}: {kind}")
        triads = layout[kind]["triads"]
        if not isinstance(triads, dict) or not triads:
            raise InputError(f"{path}: {kind}: expected triads by label, found {triads!r}")
        for label, triad in triads.items():
            needed = TRIAD_KEYS | {"position": kind == "accelerometers"}
            _require_keys(triad, needed, f"{path}: {kind} {label!r}")
    return layout


def read_csv(path: str | PathLike, columns: str | PathLike) -> Recording:
    """A table; the YAML file ``columns`` names its columns and units (docs/convert.md).

    InputError, with the row or the key, for anything that does not fit.
    """
    layout, where = read_columns(columns), str(path)
    table, account = _whole(_load(path, layout, columns), layout, str(columns))
    length = factor("length", layout.get("position_unit", "m"), f"{columns}: position_unit")
    force, labels = _sensors(table, layout, "accelerometers", "force", where, str(columns))
    rate, rate_labels = _sensors(table, layout, "gyroscopes", "rate", where, str(columns))
    places = [
        _three(triad["position"], f"{columns}: accelerometers {label!r}: position")
        for label, triad in layout["accelerometers"]["triads"].items()
    ]
    size = float(np.ptp(places, axis=0).max())
    if "position_unit" not in layout and size > WIDEST:
        raise InputError(
            f"{columns}: expected positions within {WIDEST:g} m of each other, found {size:g}:"
            " name the position_unit, mm or m"
        )
    numbers = _numbers(layout, str(columns))
    if "output_rate" in layout:
        numbers["output_period"] = 1 / _positive(layout["output_rate"], f"{columns}: output_rate")
    prior = _positive(layout.get("position_prior", 3e-3 / length), f"{columns}: position_prior")
    return Recording(
        time=_time(table, layout["time"], where, str(columns)), specific_force=force,
        angular_rate=rate, accelerometer_position=length * np.array(places),
        accelerometer_labels=labels, gyroscope_labels=rate_labels,
        accelerometer_axes=_axes(layout, str(columns)),
        position_prior_sd=length * prior, source=Path(path).name, selected=account, **numbers,
    )  # fmt: skip


def _require_keys(section: Any, keys: dict[str, bool], where: str) -> None:
    if not isinstance(section, dict):
        raise InputError(f"{where}: expected the keys {', '.join(keys)}, found {section!r}")
    unknown = [key for key in section if key not in keys]
    missing = [key for key, needed in keys.items() if needed and key not in section]
    if unknown or missing:
        found = f"an unknown key {unknown[0]!r}" if unknown else f"no {missing[0]!r}"
        raise InputError(f"{where}: expected the keys {', '.join(keys)}, found {found}")


def _load(path, layout, columns) -> pd.DataFrame:
    """The table; its columns are as the header names them, so that two of a name are seen."""
    options = {"sep": layout.get("delimiter", ","), "comment": layout.get("comment")}
    comment = "#" if options["comment"] is None else options["comment"]
    for key, value in (("delimiter", options["sep"]), ("comment", comment)):
        runs = key == "delimiter" and value == WHITESPACE
        if not isinstance(value, str) or (len(value) != 1 and not runs):
            raise InputError(f"{columns}: {key}: expected one character, found {value!r}")
    try:
        # Two rows: a first data row longer than the header is an error here, while with a header
        # pandas would take its first cell for an index and move every name by one column.
        head = pd.read_csv(path, skipinitialspace=True, header=None, nrows=2, dtype=str, **options)
        table = pd.read_csv(path, skipinitialspace=True, **options)
        table.columns = head.iloc[0].fillna("").str.strip()
    except (OSError, ValueError, UnicodeDecodeError) as error:
        message = " ".join(str(error).split())
        raise InputError(f"{path}: expected a CSV file with a header, found {message}") from None
    return table


def _whole(table, layout, columns: str) -> tuple[pd.DataFrame, str]:
    """The rows to be used, numbered as in the file, and how many of how many."""
    if "incomplete_rows" not in layout:
        return table, ""
    rule = layout["incomplete_rows"]
    if rule != LEAVE_OUT:
        raise InputError(f"{columns}: incomplete_rows: expected '{LEAVE_OUT}', found {rule!r}")
    triads = [triad for kind in KINDS for triad in layout[kind]["triads"].values()]
    used = [triad["columns"] for triad in triads if isinstance(triad["columns"], list)]
    used = table.columns.isin([str(name) for names in used for name in names])
    whole = table.loc[:, used].notna().all(axis=1)
    if whole.all():
        return table, ""
    return table[whole], f"{whole.sum()} of {len(table)} samples"


def _column(table, name, where) -> np.ndarray:
    if name not in table.columns:
        have = ", ".join(map(str, table.columns))
        raise InputError(f"{where}: expected a column {name!r}, found {have}")
    if list(table.columns).count(name) > 1:
        raise InputError(f"{where}: expected one column {name!r}, found several of that name")
    values = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        cell = table[name].iloc[bad[0]]
        shown = repr(cell) if isinstance(cell, str) else "inf" if np.isinf(cell) else "none or NaN"
        raise InputError(
            f"{where}: column {name!r}: expected numbers, found {shown} in data row"
            f" {table.index[bad[0]] + 1}"
            f" ({bad.size} of {values.size} rows)"
            + (BLANK if table[name].isna().mean() > OFTEN else "")
        )
    return values


def _is_number(value) -> bool:
    """Of a size that can be computed with: YAML has .nan, .inf, integers of any length."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= LARGEST


def _positive(value, where: str) -> float:
    if not _is_number(value) or value < SMALLEST:
        raise InputError(f"{where}: expected a positive number, found {value!r}")
    return float(value)


def _three(value, where: str) -> list[float]:
    numbers = isinstance(value, list) and len(value) == 3
    if not numbers or not all(map(_is_number, value)):
        raise InputError(f"{where}: expected three numbers, found {value!r}")
    return [float(x) for x in value]


def _numbers(layout, where: str) -> dict[str, float]:
    """Noise and range of both kinds in SI units."""
    out = {}
    for kind, units in (("accelerometers", "force"), ("gyroscopes", "rate")):
        section, name = layout[kind], kind.removesuffix("s")
        unit = factor(units, section["unit"], f"{where}: {kind}: unit")
        for key, attribute in (("noise", "noise_sd"), ("range", "range")):
            value = _positive(section[key], f"{where}: {kind}: {key}")
            out[f"{name}_{attribute}"] = unit * value
    return out


def _sensors(table, layout, kind, units, where, layout_name):
    """Readings (T, K, 3) in SI units in the array frame, and the labels."""
    section = layout[kind]
    unit = factor(units, section["unit"], f"{layout_name}: {kind}: unit")
    scale = _positive(section.get("scale", 1.0), f"{layout_name}: {kind}: scale")
    parts = []
    for label, triad in section["triads"].items():
        place = f"{layout_name}: {kind} {label!r}"
        names = triad["columns"]
        if not isinstance(names, list) or len(set(map(str, names))) != 3 or len(names) != 3:
            raise InputError(f"{place}: expected three columns, found {names!r}")
        own = np.stack([_column(table, str(name), where) for name in names], axis=1)
        parts.append(unit * scale * own @ _turn(triad.get("axes", ["x", "y", "z"]), place).T)
    return np.stack(parts, axis=1), tuple(str(label) for label in section["triads"])


def _axes(layout, where: str) -> np.ndarray:
    """Rotations (A, 3, 3) from the accelerometers' own axes to the array's."""
    triads = layout["accelerometers"]["triads"].items()
    return np.array([_turn(triad.get("axes", list("xyz")), f"{where}: {n}") for n, triad in triads])


def _turn(axes, where: str) -> np.ndarray:
    """Rotation from the sensor's axes to the array's: [-y, -x, -z] or a 3 x 3 matrix.

    The shorthand lists, for the array's x, y and z, the sensor's axis that points along it.
    """
    expected = "expected axes such as [-y, -x, -z] or a 3 x 3 rotation matrix"
    if not isinstance(axes, list) or len(axes) != 3:
        raise InputError(f"{where}: {expected}, found {axes!r}")
    if all(isinstance(row, str) for row in axes):
        matrix = np.zeros((3, 3))
        for row, name in enumerate(axes):
            letter = name.lstrip("+-")
            if letter not in ("x", "y", "z"):
                raise InputError(f"{where}: {expected}, found {axes!r}")
            matrix[row, "xyz".index(letter)] = -1.0 if name.startswith("-") else 1.0
    else:
        matrix = np.array([_three(row, where) for row in axes])
    if not is_rotation(matrix):
        raise InputError(f"{where}: {expected}, found {axes!r}, which is no rotation")
    return matrix


def _time(table, section, where, layout_name) -> np.ndarray:
    if isinstance(section, dict) and set(section) == {"rate"}:
        return table.index.to_numpy() / _positive(section["rate"], f"{layout_name}: time: rate")
    if not isinstance(section, dict) or set(section) != {"column", "unit"}:
        raise InputError(
            f"{layout_name}: time: expected 'column' and 'unit', or 'rate' in Hz, found {section!r}"
        )
    unit = factor("time", section["unit"], f"{layout_name}: time: unit")
    values = _column(table, str(section["column"]), where)
    back = np.flatnonzero(np.diff(values) <= 0)
    if back.size:
        i = back[0]
        raise InputError(
            f"{where}: column {section['column']!r}: expected a time that increases, found"
            f" {values[i + 1]:.15g} after {values[i]:.15g} in data row {table.index[i] + 2}"
            f" ({back.size} such steps)"
        )
    # from the first sample: microseconds since 1970 would cost the last digits
    return unit * (values - values[0]) if values.size else values
