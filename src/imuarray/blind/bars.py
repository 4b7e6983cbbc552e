"""The bars that the diagnosis is held against, and whether it clears them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from imuarray.blind.cases import KINDS
from imuarray.blind.matrix import PAIR_SIZE
from imuarray.blind.summary import REACHED, coverage_limits, is_large, share_limits

COVERAGE = (0.92, 0.98)  # of 95 % intervals
LONGEST = 60.0  # s for a recording
UPPER_LIMIT, UPPER_COUNT = 0.075, 400  # of the false alarms' share, over so many recordings
PASS, NONE = "pass", "no recordings"


@dataclass(frozen=True)
class Bar:
    """One bar on a share of recordings.

    Attributes
    ----------
    id, says : str
    select : callable (table of `recordings`) -> bool Series
    hit : callable (the same) -> bool Series, what is counted
    limit : float or None
        None for what is counted without a bar.
    least : bool
        Whether the share must be at least the limit (a crash is then a miss), or at most (a
        crash is then left out: it has a bar of its own).
    """

    id: str
    says: str
    select: Callable
    hit: Callable
    limit: float | None
    least: bool = False


def _kind(*kinds: str) -> Callable:
    return lambda table: table.kind.isin(kinds)


def _large(table: pd.DataFrame) -> pd.Series:
    return (table.kind == "one") & table.sigma.map(is_large)


def _full_pairs(table: pd.DataFrame) -> pd.Series:
    return (table.kind == "pair") & (table.least_sigma >= REACHED * PAIR_SIZE)


def _flag(name: str) -> Callable:
    # a crash leaves None
    return lambda table: table[name].eq(True)


BARS = (
    Bar("false_alarms", "clean: any cause named", _kind("clean"), _flag("named"), 0.05),
    Bar(
        "clean_unexplained", "clean: unexplained raised",
        _kind("clean"), _flag("unexplained"), None,
    ),
    Bar(
        "one_found", "one effect, 8 sigma or more: right class",
        _large, _flag("found"), 0.90, True,
    ),
    Bar("one_wrong", "one effect, 8 sigma or more: a wrong name", _large, _flag("wrong"), 0.02),
    Bar(
        "one_sensors", "one effect, 8 sigma or more: right class and right sensors",
        _large, _flag("sensors_right"), None, True,
    ),
    Bar(
        "pair_set", "two effects, 12 sigma each: exactly the right set",
        _full_pairs, _flag("right_set"), 0.85, True,
    ),
    Bar("gauge", "gauges: a single confident name", _kind("gauge"), _flag("confident"), 0.0),
    Bar(
        "outside", "outside the catalogue: named, unexplained not raised",
        _kind("outside"), _flag("confident"), 0.05,
    ),
    Bar(
        "struck", "struck from the catalogue: named, unexplained not raised",
        _kind("struck"), _flag("confident"), 0.05,
    ),
    Bar("time", "longer than 60 s", _kind(*KINDS), lambda t: t.least_seconds > LONGEST, 0.0),
    Bar("crashes", "no answer at all", _kind(*KINDS), _flag("crash"), 0.0),
)  # fmt: skip


def bars(table: pd.DataFrame) -> pd.DataFrame:
    """Each bar with its measured share; ``table`` as `imuarray.blind.summary.recordings` has it.

    ``share``, ``low``, ``high`` are for the recordings that the bars are set for (8 IMUs, 125 Hz,
    24 s); the columns ``all_`` for every one. Limits: 95 %, Clopper and Pearson's for shares of
    recordings; between recordings for the coverage. ``sure``: whether they exclude the bar.
    """
    lines = [_line(bar.id, bar.says, _aim(bar), table, _measure(bar)) for bar in BARS]
    lines.insert(1, _upper_line(lines[0]))
    for kind in (*KINDS, None):
        lines.append(_coverage_line(table, kind))
    return pd.DataFrame(lines)


def _line(id, says, aim: tuple, table: pd.DataFrame, measure: Callable) -> dict:
    """A row of the table of bars; ``aim``: lowest and highest share that will do, or None."""
    number, count, share, low, high = measure(table[table.standard])
    every = measure(table)
    return {
        "id": id, "bar": says, "aim": _aim_text(aim), "recordings": number, "count": count,
        "share": share, "low": low, "high": high, "verdict": verdict(aim, number, share),
        "sure": is_sure(aim, number, low, high),
        "all_recordings": every[0], "all_count": every[1], "all_share": every[2],
        "all_low": every[3], "all_high": every[4],
    }  # fmt: skip


def _aim(bar: Bar) -> tuple | None:
    if bar.limit is None:
        return None
    return (bar.limit, 1.0) if bar.least else (0.0, bar.limit)


def _measure(bar: Bar) -> Callable:
    def measure(table):
        part = table[bar.select(table)]
        if not bar.least and bar.id != "crashes":
            part = part[~part.crash]
        number, count = len(part), int(bar.hit(part).sum())
        return number, count, count / number if number else np.nan, *share_limits(count, number)

    return measure


def _coverage_line(table: pd.DataFrame, kind: str | None) -> dict:
    def measure(part):
        part = part[~part.crash & (part.kind == kind if kind else True)]
        if part.empty:
            return 0, None, np.nan, np.nan, np.nan
        return len(part), None, *coverage_limits(part, "extended")

    words = f"95 % intervals of the extended model cover: {kind or 'all sets'}"
    return _line(f"coverage_{kind or 'all'}", words, COVERAGE, table, measure)


def _upper_line(first: dict) -> dict:
    """The bar on the upper limit of the false alarms' share, where there are enough recordings."""
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
    """'pass', or by how many percentage points the share misses the bar."""
    if aim is None:
        return ""
    if not number:
        return NONE
    miss = max(aim[0] - share, share - aim[1])
    return PASS if miss <= 0 else f"short by {100 * miss:.1f} points"


def is_sure(aim: tuple | None, number: int, low: float, high: float) -> bool | None:
    """Whether the verdict holds anywhere between the limits; None where there is none."""
    if aim is None or not number or np.isnan(low):
        return None
    inside = aim[0] <= low and high <= aim[1]
    return bool(inside or high < aim[0] or low > aim[1])
