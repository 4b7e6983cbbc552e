"""The acceptance criteria that the diagnosis is held against, and whether it meets them."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from imuarray_papers.blind.cases import KINDS, PAIR_SIZE
from imuarray_papers.blind.summary import LARGE, REACHED, coverage_limits, share_limits

LONGEST = 60.0  # s for a recording
UPPER_LIMIT, UPPER_COUNT = 0.04, 400  # of the false alarms' share, over so many recordings
PASS, NONE = "pass", "no recordings"
COVERED = "covered"


class Criterion(NamedTuple):
    """A limit on a share of recordings.

    Attributes
    ----------
    id, says : str
    kinds : tuple of str
        Kinds of cases that it is about.
    hit : str
        Column of `imuarray_papers.blind.summary.recordings` that says what is counted; `COVERED`:
        the mean share of intervals instead. A crash has a criterion of its own: it is a miss where
        the share must be large, else left out.
    aim : tuple of two floats, or None
        Lowest and highest share that will do; None for what is counted without a limit.
    size : tuple of str and float, or None
        Only recordings with at least so much in a column.
    """

    id: str
    says: str
    kinds: tuple[str, ...]
    hit: str
    aim: tuple[float, float] | None
    size: tuple[str, float] | None = None

    def measure(self, table: pd.DataFrame) -> dict:
        """``recordings``, how many are hit (``count``), their ``share`` and its 95 % limits."""
        part = table[table.kind.isin(self.kinds)]
        if self.size is not None:
            part = part[part[self.size[0]] >= self.size[1]]
        if self.hit != "crash" and (self.aim is None or self.aim[1] < 1):
            part = part[~part.crash]
        number = len(part)
        if self.hit == COVERED:
            count = None
            limits = coverage_limits(part) if number else (np.nan,) * 3
        else:
            # a crash leaves None
            count = int(part[self.hit].eq(True).sum())
            share = count / number if number else np.nan
            limits = share, *share_limits(count, number)
        names = ("recordings", "count", "share", "low", "high")
        return dict(zip(names, (number, count, *limits), strict=True))


LARGE_ONE = ("sigma", REACHED * LARGE)
FULL_PAIR = ("least_sigma", REACHED * PAIR_SIZE)
CRITERIA = (
    Criterion("false_alarms", "clean: any cause named", ("clean",), "named", (0.0, 0.02)),
    Criterion("clean_unexplained", "clean: unexplained raised", ("clean",), "unexplained", None),
    Criterion(
        "one_found", "one effect, 8 sigma or more: right class", ("one",), "found", (0.97, 1.0),
        LARGE_ONE,
    ),
    Criterion(
        "one_wrong", "one effect, 8 sigma or more: a wrong name", ("one",), "wrong", (0.0, 0.01),
        LARGE_ONE,
    ),
    Criterion(
        "one_sensors", "one effect, 8 sigma or more: right class and right sensors", ("one",),
        "sensors_right", (0.95, 1.0), LARGE_ONE,
    ),
    Criterion(
        "pair_set", "two effects, 12 sigma each: exactly the right set", ("pair",), "right_set",
        (0.90, 1.0), FULL_PAIR,
    ),
    Criterion("gauge", "gauges: a single confident name", ("gauge",), "confident", (0.0, 0.0)),
    Criterion(
        "outside", "outside the catalogue: named, unexplained not raised", ("outside",),
        "confident", (0.0, 0.03),
    ),
    Criterion(
        "struck", "struck from the catalogue: named, unexplained not raised", ("struck",),
        "confident", (0.0, 0.03),
    ),
    Criterion("time", "longer than 60 s", KINDS, "long", (0.0, 0.0)),
    Criterion("crashes", "no answer at all", KINDS, "crash", (0.0, 0.0)),
    *(
        Criterion(
            f"coverage_{name}", f"95 % intervals of the extended model cover: {words}", kinds,
            COVERED, (0.92, 0.98),
        )
        for name, words, kinds in (*((kind, kind, (kind,)) for kind in KINDS),
                                   ("all", "all sets", KINDS))
    ),
)  # fmt: skip


def criteria(table: pd.DataFrame) -> pd.DataFrame:
    """Each criterion with its measured share; ``table`` from `blind.summary.recordings`.

    ``share``, ``low``, ``high`` are for the recordings that the criteria are set for (8 IMUs,
    125 Hz, 24 s); the columns ``all_`` for every one. Limits: 95 %, Clopper and Pearson's for
    shares of recordings; between recordings for the coverage. ``sure``: whether they exclude the
    limit.
    """
    table = table.assign(long=table.least_seconds > LONGEST)
    lines = []
    for item in CRITERIA:
        line, every = item.measure(table[table.standard]), item.measure(table)
        number, low, high = line["recordings"], line["low"], line["high"]
        lines.append({
            "id": item.id, "bar": item.says, "aim": _aim_text(item.aim), **line,
            "verdict": verdict(item.aim, number, line["share"]),
            "sure": is_sure(item.aim, number, low, high),
            **{f"all_{name}": value for name, value in every.items()},
        })  # fmt: skip
    lines.insert(1, _upper_line(lines[0]))
    return pd.DataFrame(lines)


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
