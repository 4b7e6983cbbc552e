"""A draft of the YAML that describes a table, from its header and its readings."""

import re
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from imuarray.errors import InputError, expecting, require
from imuarray.recording import written
from imuarray.recording.table import load
from imuarray.recording.units import FASTEST, GRAVITY, SLOWEST, UNITS

KINDS = {"accelerometers": r"^a|acc|force", "gyroscopes": r"^g|^w|gyr|rate|omega|ang"}
OTHERS = r"^m|mag|euler|^q"  # triads that are neither
TIME = r"time|stamp|^t$|_t$|sec|millis|micros"
WITHIN = 0.2  # of one unit of gravity, by which readings at rest may be off
COUNTS = 2.0 ** np.arange(8, 17)  # of raw readings, in 1 g
RANGES = {
    "g": (2, 4, 8, 16, 24, 32, 64), "mg": (2000, 4000, 8000, 16000, 32000),
    "m/s^2": tuple(round(g * GRAVITY, 1) for g in (2, 4, 8, 16, 24, 32, 64)),
    "deg/s": (125, 250, 500, 1000, 2000, 4000),
    "rad/s": tuple(round(float(np.radians(r)), 1) for r in (125, 250, 500, 1000, 2000, 4000)),
}  # fmt: skip
SPINNING = 40.0  # rad/s, faster than a hand turns a board
LEAST = 3  # rows
UNKNOWN = "?"
SCHEMA = Path(__file__).with_name("columns.schema.json")


class Triad(NamedTuple):
    """Three columns of a sensor, and the label of its IMU."""

    kind: str
    label: str
    columns: tuple[str, str, str]


def draft(paths: Sequence[Path]) -> tuple[str, list[str]]:
    """The text of a ``columns.yaml`` for a table, or for a log of each IMU; and what is not known.

    What is not known for sure is marked by a comment. InputError where a table has no columns that
    go by x, y and z, or logs differ in them.
    """
    tables = [_read(path) for path in paths]
    found = [_triads(table, path) for table, path in zip(tables, paths, strict=True)]
    six = [name for triad in found[0] for name in triad.columns]
    for path, triads in zip(paths, found, strict=True):
        same = len(six) == 6 and [name for triad in triads for name in triad.columns] == six
        require(same or len(paths) == 1, path, "one IMU, its columns as the first log's", six)
    (time, rate, asked), table = _time(tables[0]), pd.concat(tables, ignore_index=True)
    prior = ["position_unit: mm", "position_prior: 3.0  # mm, sd: 1.0 where machines placed them"]
    sections: list[str] = []
    for kind in KINDS:
        own = [triad for triad in found[0] if triad.kind == kind]
        lines, more = _section(table, kind, own, rate)
        sections, asked = sections + lines, asked + more
        if len(paths) == 1:
            place = "  # , position: [?, ?, ?]" if kind == "accelerometers" else ""
            sections += ["  triads:"] + [
                f'    "{t.label}": {{columns: [{", ".join(map(_quoted, t.columns))}]}}{place}'
                for t in own
            ]
    parts = [f"# yaml-language-server: $schema={SCHEMA}", time, *prior, *sections]
    if len(paths) > 1:
        parts.insert(2, f"columns: [{', '.join(map(_quoted, six))}]")
        names = [path.stem for path in paths], [path.resolve().parent.name for path in paths]
        numbers = [str(number + 1) for number in range(len(paths))]
        labels = next((own for own in names if len(set(own)) == len(own)), numbers)
        parts += ["imus:"] + [f'  "{label}": {{}}  # position: [?, ?, ?]' for label in labels]
    asked.append("positions: from the drawing, else they begin from the motion")
    return "\n".join(parts) + "\n", asked + ["axes: where a chip is turned on the board"] * (
        len(paths) == 1
    )


def _triads(table: pd.DataFrame, path: Path) -> list[Triad]:
    """Accelerometers first; InputError for a table without one."""
    triads = sorted(triads_of(list(table.columns)), key=lambda triad: triad.kind)
    if not triads or triads[0].kind != "accelerometers":
        raise InputError(
            f"{path}: expected columns of accelerometers that differ by x, y, z (ax1, ay1, az1),"
            f" found {', '.join(map(str, table.columns[:12]))}"
        )
    return triads


def _read(path: Path) -> pd.DataFrame:
    """The table: its header is the first line of words that is as wide as those below it."""
    with expecting(path, "a CSV file with a header", (OSError, ValueError)):
        with open(path, encoding=written.encoding_of(path), errors="replace") as file:
            lines = [line.rstrip("\n") for line in islice(file, written.HEAD)]
    width, number, sep = max(_header(lines, sep) for sep in written.DELIMITERS)
    require(width >= 0, path, "a header with names that differ by x, y, z", "none")
    names = [name.strip().strip('"') for name in lines[number].split(sep)]
    return load(path, {"columns": names}, path)[0]


def _header(lines: list[str], sep: str) -> tuple[int, int, str]:
    """(delimiters, number of the header, ``sep``) of the first words as wide as most lines."""
    widths = [line.count(sep) for line in lines]
    most = int(np.median(widths or [0]))
    words = [n for n, line in enumerate(lines) if widths[n] == most and re.search("[xX]", line)]
    return (most, words[0], sep) if words else (-1, 0, sep)


def triads_of(names: list[str]) -> list[Triad]:
    """Columns that differ in one letter, x, y or z, by the kind of their sensor and its label."""
    found: list[Triad] = []
    for name in names:
        for place in [m.start() for m in re.finditer("[xX]", name)]:
            x = name[place]
            three = tuple(name[:place] + axis + name[place + 1 :] for axis in (x, *_after(x)))
            if all(other in names for other in three):
                plain = (name[:place] + name[place + 1 :]).lower()
                words = re.sub(r"[\[(].*|imu|sensor|\d+", "", plain).strip(" _.-/")
                kind = next((k for k, text in KINDS.items() if re.search(text, words)), UNKNOWN)
                if kind == UNKNOWN or re.search(OTHERS, words):
                    continue
                numbers = re.findall(r"\d+", re.sub(r"[\[(].*", "", plain))
                found.append(Triad(kind, numbers[0] if numbers else "1", three))
                break
    return found


def _after(x: str) -> tuple[str, str]:
    return ("y", "z") if x == "x" else ("Y", "Z")


def _time(table: pd.DataFrame) -> tuple[str, float, list[str]]:
    """(the line on time, samples a second, what is not known)."""
    for name in table.columns:
        values = table[name]
        if not re.search(TIME, str(name).lower()):
            continue
        if values.dtype.kind == "O":
            nanoseconds = written.seconds_of_dates(values)
            if nanoseconds is None:
                continue
            steps, units = np.diff(nanoseconds), {"ns": 1e-9}
        else:
            steps, units = np.diff(values.to_numpy(float)), UNITS["time"]
        step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else np.nan
        hint = re.search(r"(?:\b|_)(ns|us|ms|s)(?:\b|_)", str(name).lower())
        likely = [u for u, size in units.items() if SLOWEST <= 1 / (step * size) <= FASTEST / 5]
        likely = [u for u in likely if hint and u == hint[1]] or likely
        if likely:
            rate, unit = 1 / (step * units[likely[0]]), likely[0]
            text = f"time: {{column: {_quoted(name)}, unit: {unit}}}  # {rate:.4g} samples a second"
            return text, rate, [f"time: in {unit} or in {likely[1]}?"] if likely[1:] else []
    return "time: {rate: 100.0}  # ?", 100.0, ["time: no column of stamps: the rate in Hz"]


def _section(table, kind: str, triads: list[Triad], rate: float) -> tuple[list[str], list[str]]:
    """Lines of one kind of sensor, and what is not known of it."""
    if not triads:
        return [], [f"{kind}: no columns that go by x, y, z"]
    columns = [list(triad.columns) for triad in triads]
    numbers = table[sum(columns, [])].apply(pd.to_numeric, errors="coerce")
    values = np.stack([numbers[three].to_numpy(float) for three in columns], axis=1)
    rows = int(np.isfinite(values).all(axis=2).sum(axis=0).min())
    require(rows >= LEAST, kind, f"{LEAST} rows of numbers", rows)
    quiet = _quietest(values, rate)
    noise = float(np.nanmedian(np.nanstd(np.diff(values[quiet], axis=0), axis=0)) / np.sqrt(2))
    unit, scale = _force(values[quiet]) if kind == "accelerometers" else _rate(values, triads)
    largest = float(np.nanmax(np.abs(values)))
    shown = unit if unit in RANGES else next(iter(RANGES))
    least = [r for r in RANGES[shown] if r >= 0.99 * largest * (scale or 1.0)]
    noise *= scale or 1.0
    out = [
        f"{kind}:",
        f"  unit: {unit}",
        *([f"  scale: {scale:.6g}"] if scale else []),
        f"  noise: {noise:.2g}  # sd of a reading in the quietest second",
        f"  range: {least[0] if least else largest:g}  # ? full scale, as the chip is set",
    ]
    asked = [f"{kind}: range, the chip's full scale"]
    return out, asked + [f"{kind}: unit"] * (unit == UNKNOWN)


def _quietest(values, rate: float) -> slice:
    """The second in which readings (T, n, 3) differ least."""
    length = max(int(rate), 4)
    starts = range(0, max(len(values) - length, 0) + 1, length)
    spread = [float(np.nanmean(np.nanvar(values[s : s + length], axis=0))) for s in starts]
    first = starts[int(np.nanargmin(spread))]
    return slice(first, first + length)


def _force(still) -> tuple[str, float | None]:
    """Unit, and scale of raw counts, by gravity at rest (T, n, 3)."""
    size = float(np.nanmedian(np.linalg.norm(np.nanmean(still, axis=0), axis=1)))
    for unit, one in (("g", 1.0), ("m/s^2", GRAVITY), ("mg", 1000.0)):
        if abs(size / one - 1) < WITHIN:
            return unit, None
    nearest = COUNTS[np.argmin(np.abs(np.log(COUNTS / max(size, 1e-300))))]
    return ("g", 1 / nearest) if abs(size / nearest - 1) < WITHIN else (UNKNOWN, None)


def _rate(values, triads: list[Triad]) -> tuple[str, float | None]:
    """By the columns' own words, or by what a hand can do."""
    text = " ".join(triads[0].columns).lower()
    if re.search("deg|dps", text):
        return "deg/s", None
    if "rad" in text:
        return "rad/s", None
    return ("deg/s" if np.nanmax(np.abs(values)) > SPINNING else "rad/s"), None


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z_]\w*", name) else f'"{name}"'
