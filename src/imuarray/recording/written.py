"""Tables as loggers and spreadsheets write them: encoding, heads, decimal marks, dates, stamps."""

import bz2
import gzip
import lzma
import re
import warnings
import zlib
from collections import deque
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd

from imuarray.errors import InputError, require
from imuarray.recording.settings import SETTINGS

WHITESPACE = r"\s+"  # the one delimiter longer than a character
DELIMITERS = ",", ";", "\t", "|", WHITESPACE  # the first of those that part as much
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}
# largest value, and one more, of counters that begin anew
COUNTERS = {2**16: "16 bits", 10**9: "a second's nanoseconds", 2**32: "32 bits"}
DAY = 86400 * 10**9  # ns
PACKED = {".gz": gzip.open, ".xz": lzma.open, ".bz2": bz2.open}  # as pandas infers them
UNREADABLE = (OSError, ValueError, EOFError, zlib.error, lzma.LZMAError)


def opened(path: Path, mode: str = "rb", **how):
    """A table's file, unpacked where its name says that it is packed."""
    return PACKED.get(path.suffix, open)(path, mode, **how)


def form_of(path: Path, named: set[str], given: dict) -> tuple[dict, list[str]]:
    """Options of `pandas.read_csv` for a table, and lines that say what was found.

    ``named``: columns that it must have, ``given``: the YAML's own options.

    The header is the first line that has the most of the columns, as its delimiter parts them.
    Without one, where all columns go by their place from 1, the table begins with the first line
    of numbers as wide as most.
    """
    encoding, lines = head_of(path)
    asked = given.get("sep")
    tried = (
        (len(named & set(cells_of(line, delimiter))), number, delimiter)
        for number, line in enumerate(lines) for delimiter in ([asked] if asked else DELIMITERS)
    )  # fmt: skip
    best, skip, sep = max(tried, key=lambda one: one[0], default=(0, 0, asked or DELIMITERS[0]))
    headless = best < len(named) and all(name.isdigit() for name in named)
    if headless:
        skip, sep = begin_of(lines, asked)
        skip -= 1
    comma = sep != "," and any(
        DECIMAL_COMMA.fullmatch(cell) for line in lines[skip + 1 :] for cell in cells_of(line, sep)
    )
    below = cells_of("".join(lines[skip + 1 : skip + 2]), sep)
    units = best > 0 and not headless and are_words(below)
    said = [f"encoding {encoding}"] * (encoding != "utf-8")
    said += ["no header: columns by their place"] * headless
    said += [f"{skip} lines before the header left out"] * (skip > 0)
    shown = "blanks" if sep == WHITESPACE else repr(sep)
    said += [f"columns parted by {shown}"] * (sep != (asked or ","))
    said += ["decimal commas"] * comma + ["a line of units below the header left out"] * units
    options = given | {
        "sep": sep, "skiprows": [*range(skip + headless), *[skip + 1] * units],
        "encoding": encoding, "decimal": "," if comma else ".", "header": None if headless else 0,
    }  # fmt: skip
    return options, [f"{path.name}: {', '.join(said)}"] if said else []


def begin_of(lines: list[str], asked: str | None = None) -> tuple[int, str]:
    """(number of the first line that is as wide as most and has no words, its delimiter)."""
    sep = asked or max(
        DELIMITERS, key=lambda sep: np.median([len(cells_of(line, sep)) for line in lines] or [0])
    )
    widths = [len(cells_of(line, sep)) for line in lines]
    usual = int(np.median(widths or [0]))
    whole = (n for n, line in enumerate(lines) if widths[n] == usual)
    return next((n for n in whole if re.match(r"[+-]?[.,]?\d", lines[n].strip(' "'))), 0), sep


def cells_of(line: str, delimiter: str) -> list[str]:
    """A line's cells without blanks and quotes."""
    parts = line.split() if delimiter == WHITESPACE else line.split(delimiter)
    return [part.strip().strip('"') for part in parts]


def are_words(cells: list[str]) -> bool:
    """True of cells most of which are there, and none begins as a number or a date does."""
    words = [cell for cell in cells if cell and cell.lower() not in ("nan", "inf", "null", "na")]
    numbers = any(re.match(r"[+-]?[.,]?\d", word) for word in words)
    return 2 * len(words) > len(cells) and not numbers


def rows_of_numbers(table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """The table without its header again and lone comments among its rows; lines that say so."""
    first = table.iloc[:, 0] if table.shape[1] else pd.Series(dtype=float)
    if first.dtype.kind != "O":
        return table, []
    text = first.astype(str).str.strip()
    again = (text == str(table.columns[0])).to_numpy()
    remarks = text.str.match("#|//|%").to_numpy() & table.iloc[:, 1:].isna().all(axis=1).to_numpy()
    found = (again, "header again"), (remarks, "remarks")
    said = [f"{what}: {rows.sum()}, left out" for rows, what in found if rows.any()]
    if not said:
        return table, []
    parts = []
    for _, text in table[~(again | remarks)].reset_index(drop=True).items():
        numbers = pd.to_numeric(text, errors="coerce")  # words had made them text
        parts.append(numbers if numbers.notna().equals(text.notna()) else text)
    return pd.concat(parts, axis=1), said


def without_cut(table: pd.DataFrame, path: Path) -> tuple[pd.DataFrame, list[str]]:
    """The table without a last row that ends amid its line, as of a log cut off; a line on it."""
    whole = table.loc[:, table.columns != ""]  # a delimiter may end each line
    if len(table) < 2 or pd.notna(pd.to_numeric(whole.iloc[-1, -1], errors="coerce")):
        return table, []
    with opened(path) as file:
        last = deque(file, maxlen=1)[0].rstrip(b"\0")
    ended = last[-1:] in (b"", b"\n", b"\r")
    return (table, []) if ended else (table[:-1], ["the last row is cut off: left out"])


def plain(value) -> str:
    """A sensor's number or name in a cell as a label: 2 and 2.0 are "2"."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def head_of(path: Path) -> tuple[str, list[str]]:
    """(encoding, first lines), by the byte-order mark or by what the first bytes can be read as."""
    with opened(path) as file:
        start = file.read(SETTINGS.sniffed)
    sheet = "a spreadsheet, or an archive: save it as CSV"
    require(not start.startswith(b"PK\3\4"), str(path), "text, such as CSV", sheet)
    encoding = next((name for mark, name in MARKS.items() if start.startswith(mark)), "utf-8")
    try:
        if encoding == "utf-8":
            start[:-4].decode()  # the last character may be cut
    except UnicodeDecodeError:
        encoding = "utf-8" if b"\0" in start else "cp1252"
    with opened(path, "rt", encoding=encoding, errors="replace", newline=None) as file:
        return encoding, [line.rstrip("\n") for line in islice(file, SETTINGS.head)]


def seconds_of_dates(cells: pd.Series) -> np.ndarray | None:
    """Nanoseconds (N,) of cells that are dates or times of day; None where one is not.

    A time of day goes on past midnight.
    """
    if cells.dtype.kind != "O" or not len(cells) or not re.search(r"\d:\d\d", str(cells.iloc[0])):
        return None
    # 11:59:58:005 and 11:59:58,005
    text = cells.astype(str).str.strip().str.replace(r"(:\d\d:\d\d)[:,](?=\d)", r"\1.", regex=True)
    if re.fullmatch(r"(\d+:)?\d+:\d\d(\.\d*)?", text.iloc[0]):
        text = "00:" * (text.iloc[0].count(":") == 1) + text
        found = pd.to_timedelta(text, errors="coerce").to_numpy("timedelta64[ns]")
        if np.isnat(found).any():
            return None
        stamps = found.astype("int64")
        return stamps + DAY * np.cumsum(np.diff(stamps, prepend=stamps[:1]) < -DAY // 2)
    dotted = "." in text.iloc[0].split(":")[0]  # then the day comes first
    for how in ({"format": "ISO8601"}, {"dayfirst": dotted}, {"dayfirst": not dotted}):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # on a form that pandas has to guess
            dates = pd.to_datetime(text, utc=True, errors="coerce", **how)
        if dates.notna().all():
            return dates.dt.tz_localize(None).to_numpy("datetime64[ns]").astype("int64")
    return None


def in_order(stamps, table: pd.DataFrame, where: str) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """(stamps that increase, their rows, lines that say what was done) of a table's stamps (N,).

    A counter that begins anew is carried on; rows out of order are sorted where that leaves even
    steps; of rows with the stamp of the row before, copies are left out, others put midway. Where
    none of that does it stamps stay as they are. InputError where many rows share their stamps.
    """
    rows, said = np.arange(len(stamps)), []
    stamps, counter = _carried_on(stamps)
    if counter:
        said.append(f"{where}: a counter of {counter} began anew: carried on")
    steps, few = np.diff(stamps), SETTINGS.equal_stamps * len(stamps)
    if np.sum(steps == 0) > few and len(stamps) > SETTINGS.few_rows:
        raise InputError(f"{where}: {shared_words(steps, table)}")
    usual = np.median(steps) if len(steps) else 0.0
    if 0 < np.sum(steps < 0) < few:
        order = np.argsort(stamps, kind="stable")
        left = np.diff(stamps[order])
        if not np.any((left > 0) & (left < usual / 2)):  # a clock set back would leave such
            rows, stamps = order, stamps[order]
            said.append(f"{where}: {np.sum(steps < 0)} rows out of order: sorted by their stamps")
    again = np.flatnonzero(np.diff(stamps) == 0) + 1
    if not 0 < len(again) < few:
        return stamps, rows, said
    same = table.iloc[rows[again]].to_numpy() == table.iloc[rows[again - 1]].to_numpy()
    copies = again[same.all(axis=1)]
    if len(copies):
        rows, stamps = (np.delete(part, copies) for part in (rows, stamps))
        said.append(f"{where}: {len(copies)} rows are there twice: left out")
    again = np.flatnonzero(np.diff(stamps) == 0) + 1
    again = again[again < len(stamps) - 1]
    wide = again[stamps[again + 1] - stamps[again] > 1.5 * usual]
    if len(wide):
        half = (stamps[wide + 1] - stamps[wide]) / 2
        stamps = stamps.copy()
        stamps[wide] += half.astype(stamps.dtype)
        said.append(f"{where}: {len(wide)} rows with the stamp of the row before: put midway")
    return stamps, rows, said


def _carried_on(stamps) -> tuple[np.ndarray, str]:
    """Stamps of a counter that begins anew, and which of `COUNTERS` it is; "" where none does."""
    if stamps.dtype.kind == "i" and len(stamps) > 1:
        steps = np.diff(stamps)
        for size, counter in COUNTERS.items():
            if 0 <= stamps.min() and stamps.max() < size and steps.min() < -size / 2:
                turns = np.concatenate([[0], np.cumsum(steps < -size / 2)])
                return stamps + turns * size, counter
    return stamps, ""


def shared_words(steps, table: pd.DataFrame) -> str:
    """Words on many rows that share their stamps: bursts, ticks, or one row for each sensor."""
    share = f"expected a stamp of its own for each row, found {np.mean(steps == 0):.0%} of the rows"
    why = (
        f", and a column {name!r} that numbers the sensors: one row for each sensor; expected"
        f" `sensor: {name}` and `imus` by its numbers" if (name := numbering(table))
        else ": bursts of packets, or ticks of a coarse clock; log the sensors' own clock, or"
        " declare `time: rate`"
    )  # fmt: skip
    return f"{share} with the same stamp{why}"


def numbering(table: pd.DataFrame) -> str:
    """The column whose few values come equally often, as numbers of sensors do, or ""."""
    for place, name in enumerate(table.columns):
        counts = table.iloc[:, place].value_counts()
        few = 1 < len(counts) <= SETTINGS.most_sensors
        if few and counts.min() > 0.9 * counts.max() > SETTINGS.few_rows:
            return str(name)
    return ""
