"""The acceptance criteria that the diagnosis is held against, and whether it meets them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from imuarray_papers.blind.cases import KINDS, PAIR_SIZE
from imuarray_papers.blind.summary import LARGE, REACHED, coverage_limits, share_limits

COVERAGE = (0.92, 0.98)  # of 95 % intervals
LONGEST = 60.0  # s for a recording
UPPER_LIMIT, UPPER_COUNT = 0.04, 400  # of the false alarms' share, over so many recordings
PASS, NONE = "pass", "no recordings"


@dataclass(frozen=True)
class Criterion:
    """A limit on a share of recordings.

    Attributes
    ----------
    id, says : str
    kinds : tuple of str
        Kinds of cases that it is about.
    hit : str
        Column of `imuarray_papers.blind.summary.recordings` that says what is counted.
    limit : float or None
        None for what is counted without a limit.
    least : bool
        Whether the share must be at least the limit (a crash is then a miss), or at most (a
        crash is then left out: it has a criterion of its own).
    size : tuple of str and float, or None
        Only recordings with at least so much in a column.
    """

    id: str
    says: str
    kinds: tuple[str, ...]
    hit: str
    limit: float | None
    least: bool = False
    size: tuple[str, float] | None = None

    @property
    def aim(self) -> tuple[float, float] | None:
        """Lowest and highest share that will do."""
        if self.limit is None:
            return None
        return (self.limit, 1.0) if self.least else (0.0, self.limit)

    def measure(self, table: pd.DataFrame) -> tuple:
        """Recordings, how many are hit, their share and its 95 % limits."""
        part = table[table.kind.isin(self.kinds)]
        if self.size is not None:
            part = part[part[self.size[0]] >= self.size[1]]
        if not self.least and self.hit != "crash":
            part = part[~part.crash]
        # a crash leaves None
        number, count = len(part), int(part[self.hit].eq(True).sum())
        return number, count, count / number if number else np.nan, *share_limits(count, number)


ONE = {"kinds": ("one",), "size": ("sigma", REACHED * LARGE)}
FULL_PAIRS = {"kinds": ("pair",), "size": ("least_sigma", REACHED * PAIR_SIZE)}
CRITERIA = (
    Criterion("false_alarms", "clean: any cause named", ("clean",), "named", 0.02),
    Criterion("clean_unexplained", "clean: unexplained raised", ("clean",), "unexplained", None),
    Criterion(
        "one_found", "one effect, 8 sigma or more: right class", hit="found", limit=0.97,
        least=True, **ONE,
    ),
    Criterion(
        "one_wrong", "one effect, 8 sigma or more: a wrong name", hit="wrong", limit=0.01, **ONE
    ),
    Criterion(
        "one_sensors", "one effect, 8 sigma or more: right class and right sensors",
        hit="sensors_right", limit=0.95, least=True, **ONE,
    ),
    Criterion(
        "pair_set", "two effects, 12 sigma each: exactly the right set", hit="right_set",
        limit=0.90, least=True, **FULL_PAIRS,
    ),
    Criterion("gauge", "gauges: a single confident name", ("gauge",), "confident", 0.0),
    Criterion(
        "outside", "outside the catalogue: named, unexplained not raised",
        ("outside",), "confident", 0.03,
    ),
    Criterion(
        "struck", "struck from the catalogue: named, unexplained not raised",
        ("struck",), "confident", 0.03,
    ),
    Criterion("time", "longer than 60 s", KINDS, "long", 0.0),
    Criterion("crashes", "no answer at all", KINDS, "crash", 0.0),
)  # fmt: skip


def criteria(table: pd.DataFrame) -> pd.DataFrame:
    """Each criterion with its measured share; ``table`` from `blind.summary.recordings`.

    ``share``, ``low``, ``high`` are for the recordings that the criteria are set for (8 IMUs,
    125 Hz, 24 s); the columns ``all_`` for every one. Limits: 95 %, Clopper and Pearson's for
    shares of recordings; between recordings for the coverage. ``sure``: whether they exclude the
    limit.
    """
    table = table.assign(long=table.least_seconds > LONGEST)
    lines = [_line(item.id, item.says, item.aim, table, item.measure) for item in CRITERIA]
    lines.insert(1, _upper_line(lines[0]))
    for kind in (*KINDS, None):
        words = f"95 % intervals of the extended model cover: {kind or 'all sets'}"
        part = table if kind is None else table[table.kind == kind]
        lines.append(_line(f"coverage_{kind or 'all'}", words, COVERAGE, part, _covered))
    return pd.DataFrame(lines)


def _line(id, says, aim: tuple | None, table: pd.DataFrame, measure: Callable) -> dict:
    """A row of the table; ``aim``: lowest and highest share that will do, or None."""
    names = ("recordings", "count", "share", "low", "high")
    line = dict(zip(names, measure(table[table.standard]), strict=True))
    every = dict(zip([f"all_{name}" for name in names], measure(table), strict=True))
    number, low, high = line["recordings"], line["low"], line["high"]
    return {
        "id": id, "bar": says, "aim": _aim_text(aim), **line,
        "verdict": verdict(aim, number, line["share"]), "sure": is_sure(aim, number, low, high),
        **every,
    }  # fmt: skip


def _covered(part: pd.DataFrame) -> tuple:
    part = part[~part.crash]
    if part.empty:
        return 0, None, np.nan, np.nan, np.nan
    return len(part), None, *coverage_limits(part, "extended")


def _upper_line(first: dict) -> dict:
    """The criterion on the upper limit of the false alarms' share, of enough recordings."""
    aim = (0.0, UPPER_LIMIT)
    line = {**first, "id": "false_alarms_limit", "aim": _aim_text(aim), "sure": None}
    line["bar"] = f"the same: upper 95 % limit, over {UPPER_COUNT} or more recordings"
    enough = first["recordings"] >= UPPER_COUNT
    line["verdict"] = verdict(aim, 1, first["high"]) if enough else f"needs {UPPER_COUNT}"
    return line


def _aim_text(aim: tuple | None) -> str:
    if aim is None:
        return ""
    low, high = (f"{100 * value:g}" for value in aim)
    if aim[1] == 1.0:
        return f"at least {low} %"
    if aim[1] == 0.0:
        return "never"
    return f"at most {high} %" if aim[0] == 0.0 else f"{low} to {high} %"


def verdict(aim: tuple | None, number: int, share: float) -> str:
    """'pass', or by how many percentage points the share misses the limit."""
    if aim is None:
        return ""
    if not number:
        return NONE
    miss = max(aim[0] - share, share - aim[1])
    return PASS if miss <= 0 else f"short by {100 * miss:.1f} points"


def is_sure(aim: tuple | None, number: int, low: float, high: float) -> bool | None:
    """The verdict where it holds anywhere between the limits, else None."""
    if aim is None or not number or np.isnan(low):
        return None
    inside = aim[0] <= low and high <= aim[1]
    return bool(inside or high < aim[0] or low > aim[1])
