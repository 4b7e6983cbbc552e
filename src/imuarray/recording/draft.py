"""A draft of the YAML that describes a table, from its header and its readings."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from imuarray.errors import expecting, require
from imuarray.recording import written
from imuarray.recording.layout import SCHEMA
from imuarray.recording.settings import SETTINGS
from imuarray.recording.table import load
from imuarray.recording.units import GRAVITY, UNITS

# what a column's words, or else its unit, tell of the sensor; neither kind's are left out
KINDS = {
    "accelerometers": r"^(a|acc.*|force|alpha)$",
    "gyroscopes": r"^(g|w|gyr.*|omega|ang.*|rate)$",
}
OF_UNIT = {"gyroscopes": r"(deg|rad|°).*s|dps", "accelerometers": r"^m?g$|^m.*s"}
OTHERS = r"mag|grav|euler|quat|angle|orient"
TIME = r"time|stamp|^t$|_t$|sec|millis|micros|^(ns|us|ms|s)$"
FINE = "sampletimefine"  # as Xsens has it, in 0.1 ms, or us
UNIT = r"[\[(]([^\[(]*[^\[(\d][^\[(]*)[\])]"  # in brackets; a number there is none
AXES = (("[xX]", {"x": "yz", "X": "YZ"}), (r"(?<=\[)0(?=\])", {"0": "12"}))
COUNTS = 2.0 ** np.arange(8, 17)  # of raw readings, in 1 g
RANGES = {
    "g": (2, 4, 8, 16, 24, 32, 64), "mg": (2000, 4000, 8000, 16000, 32000),
    "m/s^2": tuple(round(g * GRAVITY, 1) for g in (2, 4, 8, 16, 24, 32, 64)),
    "deg/s": (125, 250, 500, 1000, 2000, 4000),
    "mdeg/s": tuple(1000 * r for r in (125, 250, 500, 1000, 2000, 4000)),
    "rad/s": tuple(round(float(np.radians(r)), 1) for r in (125, 250, 500, 1000, 2000, 4000)),
}  # fmt: skip
UNKNOWN = '"?"'
WORDS = {"mdeg/s": "mdeg|mdps|m°", "deg/s": "deg|dps|°", "rad/s": "rad"}
RAW = "scale", "noise", "range"  # not known of counts


class Triad(NamedTuple):
    """Three columns of a sensor, the label of its IMU, and their unit, if it is written."""

    kind: str
    label: str
    columns: tuple[str, str, str]
    unit: str = ""


def draft(paths: Sequence[Path]) -> tuple[str, list[str]]:
    """The text of a ``columns.yaml`` for a table, or for a log of each IMU; and what is not known.

    What is not known for sure is marked by a comment. InputError where a table has no columns that
    go by x, y and z, or logs differ in them.
    """
    read = [_read(path) for path in paths]
    found = [_triads(*each, path) for each, path in zip(read, paths, strict=True)]
    six = [name for triad in found[0] for name in triad.columns]
    for path, triads in zip(paths, found, strict=True):
        same = len(six) == 6 and [name for triad in triads for name in triad.columns] == six
        require(same or len(paths) == 1, path, "one IMU, its columns as the first log's", six)
    (first, units), table = read[0], pd.concat([table for table, _ in read], ignore_index=True)
    (time, rate, asked), sensor = _time(first, units), ""
    if len(paths) == 1 and len(six) == 6 and "column:" in time:
        sensor = written.numbering(table)
    table = table.sort_values(sensor, kind="stable") if sensor else table
    prior = ["position_unit: mm", "position_prior: 3.0  # mm, sd: 1.0 where machines placed them"]
    sections: list[str] = []
    for kind in KINDS:
        own = [triad for triad in found[0] if triad.kind == kind]
        raw = any(line.startswith("  scale:") for line in sections)
        lines, more = _section(table, kind, own, rate, raw)
        sections, asked = sections + lines, asked + more
        if len(paths) == 1 and not sensor:
            place = "  # , position: [?, ?, ?]" if kind == "accelerometers" else ""
            sections += ["  triads:"] * bool(own) + [
                f'    "{t.label}": {{columns: [{", ".join(map(_quoted, t.columns))}]}}{place}'
                for t in own
            ]
    parts = [f"# yaml-language-server: $schema={SCHEMA}", time, *prior, *sections]
    if len(paths) > 1 or sensor:
        labels = map(written.plain, table[sensor].unique()) if sensor else _labels_of(paths)
        parts.insert(2, f"columns: [{', '.join(map(_quoted, six))}]")
        if sensor:
            parts.insert(2, f"sensor: {_quoted(sensor)}  # the column that numbers the IMUs")
        parts += ["imus:"] + [f'  "{label}": {{}}  # position: [?, ?, ?]' for label in labels]
    if first.columns[0] == "1":
        asked.append("columns: no header; whose they are is guessed by gravity at rest")
    asked.append("positions: from the drawing, else they begin from the motion")
    if len(paths) == 1:
        asked.append("axes: where a chip is turned on the board")
    return "\n".join(parts) + "\n", asked


def _labels_of(paths) -> list[str]:
    """The files' names, or their folders' where those are one, or numbers."""
    names = [path.stem for path in paths], [path.resolve().parent.name for path in paths]
    numbers = [str(number + 1) for number in range(len(paths))]
    return next((own for own in names if len(set(own)) == len(own)), numbers)


def _triads(table: pd.DataFrame, units: dict[str, str], path: Path) -> list[Triad]:
    """Accelerometers first; InputError for a table without one."""
    names = list(table.columns)
    found = by_place(table) if names[0] == "1" else triads_of(names, units)
    triads = sorted(found, key=lambda triad: triad.kind)
    expected = "columns of accelerometers that differ by x, y, z (ax1, ay1, az1)"
    found = ", ".join(map(str, table.columns[:12]))
    require(triads and triads[0].kind == "accelerometers", path, expected, found)
    return triads


def _read(path: Path) -> tuple[pd.DataFrame, dict[str, str]]:
    """The table, and units that a row of them gives to its columns.

    Its header is the first line of words that is as wide as those below it; without one, columns
    go by their place from 1.
    """
    with expecting(path, "a CSV file with a header", written.UNREADABLE):
        _, lines = written.head_of(path)
    found = (_header(lines, sep) for sep in written.DELIMITERS)
    width, number, sep = max(found, key=lambda one: one[0])
    if width < 0:
        number, sep = written.begin_of(lines)
        count = len(written.cells_of("".join(lines[number : number + 1]), sep))
        expected = "a header with names that differ by x, y, z or [0], [1], or numbers alone"
        require(count > 6, path, expected, "neither")
        return load(path, {"columns": [str(k + 1) for k in range(count)]}, path)[0], {}
    names = written.cells_of(lines[number], sep)
    below = written.cells_of("".join(lines[number + 1 : number + 2]), sep)
    units = dict(zip(names, below, strict=False)) if written.are_words(below) else {}
    return load(path, {"columns": names}, path)[0], units


def _header(lines: list[str], sep: str) -> tuple[int, int, str]:
    """(cells, number of the header, ``sep``) of the first words as wide as most lines."""
    widths = [len(written.cells_of(line, sep)) for line in lines]
    most = int(np.median(widths or [0]))
    marks = "|".join(mark for mark, _ in AXES)
    words = [n for n, line in enumerate(lines) if widths[n] == most and re.search(marks, line)]
    return (most, words[0], sep) if words else (-1, 0, sep)


def by_place(table: pd.DataFrame) -> list[Triad]:
    """Columns without names, three by three: those that show gravity at rest are accelerometers.

    A column whose values rise steadily, as stamps and counts do, is none of a sensor's.
    """
    values = table.apply(pd.to_numeric, errors="coerce").dropna(axis="columns", how="all")
    own = [name for name, x in values.items() if (x.diff() > 0).mean() < SETTINGS.draft_rises]
    require(len(own) % 3 == 0, "columns", "three of each sensor beside the stamps", len(own))
    found: list[Triad] = []
    for place in range(0, len(own), 3):
        three = tuple(own[place : place + 3])
        readings = values[list(three)].to_numpy(float)[:, None]
        still = readings[_quietest(readings, len(table) / 100)]
        kind = [*KINDS][_force(still)[0] == UNKNOWN]
        found.append(Triad(kind, str(1 + sum(one.kind == kind for one in found)), three))
    return found


def triads_of(names: list[str], units: dict[str, str] | None = None) -> list[Triad]:
    """Columns that differ in one letter, x, y or z, or as [0], [1], [2]: kind, label, names.

    The kind follows from words in the names, or from units: theirs, or ``units`` by name.
    """
    found: list[tuple[str, str, tuple, str]] = []
    for name in names:
        for match, to in [(m, to) for mark, to in AXES for m in re.finditer(mark, name)]:
            place = match.start()
            three = tuple(name[:place] + one + name[place + 1 :] for one in match[0] + to[match[0]])
            if all(other in names for other in three):
                plain = name[:place] + name[place + 1 :]
                unit = re.search(UNIT, plain)
                plain = plain.replace(unit[0], "") if unit else plain
                words = unit[1] if unit else (units or {}).get(name, "")
                found.append((_kind(plain, words), plain, three, words))
                break
    out = []
    for kind in KINDS:
        own = [item for item in found if item[0] == kind]
        labels = _labels([plain for _, plain, _, _ in own])
        out += [Triad(kind, label, *item[2:]) for label, item in zip(labels, own, strict=True)]
    return out


def _kind(plain: str, unit: str) -> str:
    """The kind of sensor by its columns' name without the axis, and their unit; or ""."""
    words = re.findall("[A-Z]?[a-z]+|[A-Z]+", re.sub("imu|sensor", " ", plain, flags=re.I))
    if re.search(OTHERS, plain.lower()):
        return ""
    by_unit = next((kind for kind, text in OF_UNIT.items() if re.search(text, unit.lower())), "")
    words.sort(key=lambda word: len(word) == 1 and word.isupper())  # of IMU "A" the gyroscope: g_A
    named = (kind for word in words for kind, text in KINDS.items() if re.match(text, word.lower()))
    return by_unit or next(named, "")


def _labels(names: list[str]) -> list[str]:
    """Labels of sensors of one kind: words and numbers that are not in all names."""
    parts = [re.findall(r"\d+|[A-Za-z]+", re.sub("m_?s_?2", "", name)) for name in names]
    shared = set.intersection(*map(set, parts)) if len(parts) > 1 else set()
    if len(parts) < 2:
        return [next((part for part in own if part.isdigit()), "1") for own in parts]
    labels = ["_".join(part for part in own if part not in shared) for own in parts]
    alone = all(labels) and len(set(labels)) == len(labels)
    return labels if alone else [str(number + 1) for number in range(len(names))]


def _time(table: pd.DataFrame, given: dict[str, str]) -> tuple[str, float, list[str]]:
    """(the line on time, samples a second, what is not known)."""
    named = [name for name in table.columns if re.search(TIME, str(name).lower())]
    for name in [*named, *filter(lambda name: _rises(table[name]), table.columns)]:
        values = table[name]
        if values.dtype.kind == "O":
            nanoseconds = written.seconds_of_dates(values)
            if nanoseconds is None:
                continue
            steps, units = np.diff(nanoseconds), {"ns": 1e-9}
        else:
            fine = FINE in str(name).lower()
            known = ("0.1 ms", "us") if fine else ("s", "ms", "us", "ns")
            units = {unit: UNITS["time"][unit] for unit in known}
            steps = np.diff(values.to_numpy(float))
        stamped = np.mean(steps > 0) > SETTINGS.draft_stamped if len(steps) else False
        step = float(np.median(steps[steps > 0])) if stamped else np.nan
        hint = re.search(r"(?:\b|_)(ns|us|ms|s)(?:\b|_)", f"{name} {given.get(name)}".lower())
        least, most = SETTINGS.slowest, SETTINGS.fastest / 5
        likely = [u for u, size in units.items() if least <= 1 / (step * size) <= most]
        likely.sort(key=lambda u: abs(np.log(step * units[u] * SETTINGS.draft_rate)))
        likely = [u for u in likely if hint and u == hint[1]] or likely
        if likely:
            rate, unit = 1 / (step * units[likely[0]]), likely[0]
            text = f"time: {{column: {_quoted(name)}, unit: {_quoted(unit)}}}"
            text += f"  # {rate:.4g} samples a second"
            return text, rate, [f"time: in {unit} or in {likely[1]}?"] if likely[1:] else []
    return "time: {rate: 100.0}  # ?", 100.0, ["time: no column of stamps: the rate in Hz"]


def _rises(values: pd.Series) -> bool:
    """True of numbers that rise in nearly even steps, as stamps do; a count of rows is none.

    And of dates.
    """
    if values.dtype.kind == "O":
        return written.seconds_of_dates(values) is not None
    if values.dtype.kind not in "iuf" or len(values) <= SETTINGS.draft_rows:
        return False
    steps = np.diff(values.to_numpy(float))
    step = np.median(steps)
    even = np.mean(np.abs(steps - step) < SETTINGS.draft_even * step)
    return bool(np.all(steps > 0) and even > 0.5 and np.any(steps != 1))


def _section(table, kind: str, triads: list[Triad], rate: float, raw: bool):
    """(lines of one kind of sensor, what is not known of it); ``raw``: the other's are counts."""
    if not triads:
        return [], [f"{kind}: no columns that go by x, y, z"]
    columns = [list(triad.columns) for triad in triads]
    numbers = table[sum(columns, [])].apply(pd.to_numeric, errors="coerce")
    values = np.stack([numbers[three].to_numpy(float) for three in columns], axis=1)
    rows = int(np.isfinite(values).all(axis=2).sum(axis=0).min())
    require(rows >= SETTINGS.draft_rows, kind, f"{SETTINGS.draft_rows} rows of numbers", rows)
    quiet = _quietest(values, rate)
    noise = float(np.nanmedian(np.nanstd(np.diff(values[quiet], axis=0), axis=0)) / np.sqrt(2))
    if kind == "accelerometers":
        unit, scale = _force(values[quiet])
    else:
        words = " ".join([*triads[0].columns, triads[0].unit]).lower()
        named = [unit for unit, text in WORDS.items() if re.search(text, words)]
        fast = np.nanmax(np.abs(values)) > SETTINGS.spinning or noise > SETTINGS.noisiest
        unit, scale = [*named, "deg/s" if fast else "rad/s"][0], None
        if not named and np.nanmax(np.abs(values)) > RANGES["deg/s"][-1]:
            unit = UNKNOWN
        if raw and not named:
            asked = f"{kind}: scale, a count in deg/s: 1/131 where the range is 250, 1/16.4 at 2000"
            return [f"{kind}:", "  unit: deg/s", *(f"  {x}: {UNKNOWN}" for x in RAW)], [asked]
    largest = float(np.nanmax(np.abs(values)))
    shown = unit if unit in RANGES else next(iter(RANGES))
    least = [r for r in RANGES[shown] if r >= 0.99 * largest * (scale or 1.0)]
    full, noise = least[0] if least else largest, noise * (scale or 1.0)
    out = [
        f"{kind}:",
        f"  unit: {unit}",
        *([f"  scale: {_number(scale, 6)}"] if scale else []),
        f"  noise: {_number(noise, 2)}  # sd of a reading in the quietest second",
        f"  range: {_number(full, 6)}  # ? full scale, as the chip is set",
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
        if abs(size / one - 1) < SETTINGS.draft_gravity:
            return unit, None
    nearest = COUNTS[np.argmin(np.abs(np.log(COUNTS / max(size, 1e-300))))]
    raw = abs(size / nearest - 1) < SETTINGS.draft_gravity
    return ("g", 1 / nearest) if raw else (UNKNOWN, None)


def _number(value: float, digits: int) -> str:
    """Without an exponent: YAML takes 4e-05 for text."""
    return np.format_float_positional(value, digits, unique=False, fractional=False, trim="-")


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z_]\w*", name) else f'"{name}"'
