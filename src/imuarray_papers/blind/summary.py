"""Graded rows as tables: recordings, confusion, coverage; and the acceptance criteria."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import binomtest
from scipy.stats import t as student

from imuarray_papers.blind.cases import KINDS, PAIR_SIZE
from imuarray_papers.blind.inject import EFFECTS

NOTHING, UNEXPLAINED, CRASH = "nothing", "unexplained", "crash"
STANDARD = {"imus": 8, "sampling_rate": 125.0, "duration": 24.0}  # what the criteria are set for
LARGE = 8.0  # sigma, from which an effect is to be found
LEVEL = 0.95  # of all intervals
REACHED = 0.98  # of a size that was asked for counts as that size
LONGEST = 60.0  # s for a recording
UPPER_LIMIT, UPPER_COUNT = 0.04, 400  # of the false alarms' share, over so many recordings
PASS, NONE = "pass", "no recordings"
COVERED = "covered"


def share_limits(count: int, number: int) -> tuple[float, float]:
    """Clopper and Pearson's 95 % limits of a share; 0 and 1 where there is no recording."""
    if not number:
        return 0.0, 1.0
    limits = binomtest(int(count), int(number)).proportion_ci(LEVEL, method="exact")
    return float(limits.low), float(limits.high)


def said(causes: list[dict]) -> str:
    """Causes in one line: 'sensor_delay of 3, 4 (or sensor_clock)'."""
    words = []
    for cause in causes:
        others = ", ".join(cause["indistinguishable_from"])
        words.append(f"{cause['effect']} of {', '.join(map(str, cause['sensors']))}")
        words[-1] += f" (or {others})" if others else ""
    return "; ".join(words)


def recordings(rows: list[dict]) -> pd.DataFrame:
    """A line for each graded recording, in plain columns (units in the names; rates in Hz).

    ``found``, ``sensors_right``: of all its effects; ``crash`` rows have neither gain nor
    positions.
    """
    lines = []
    for row in rows:
        truth = row["truth"]
        line = {name: row[name] for name in ("case", "kind", "imus", "rails")}
        line |= {"sampling_rate": row["sampling_rate"], "duration_s": row["duration"]}
        line["standard"] = all(row[name] == value for name, value in STANDARD.items())
        line["effects"] = "+".join(effect["effect"] for effect in truth)
        line["sensors"] = "; ".join(", ".join(map(str, effect["sensors"])) for effect in truth)
        line |= {name: row[name] for name in ("sigma", "sigma_exact")}
        line["least_sigma"] = min((effect["sigma"] for effect in truth), default=0.0)
        line |= {"says": said(row["causes"]), "unexplained": row["unexplained"]}
        line |= {name: row[name] for name in ("crash", "right_set", "confident")}
        line |= {"named": bool(row["causes"]), "wrong": bool(row["wrong_names"])}
        for name in ("found", "sensors_right"):
            line[name] = all(effect[name] for effect in truth)
        line |= row["extended"] or dict.fromkeys(("position_rmse_m", "covered", "coordinates"))
        line |= {"seconds": row["seconds"], "cpu_seconds": row["cpu_seconds"]}
        # either is an upper limit of what it takes where nothing else runs
        line["least_seconds"] = min(row["seconds"], row["cpu_seconds"])
        lines.append(line | {"error": row["error"] or ""})
    return pd.DataFrame(lines)


def confusion(rows: list[dict]) -> pd.DataFrame:
    """Names by truth, a line for each truth and each name that occurs (or `NOTHING`, ...).

    Of single effects, those of 8 sigma or more. ``right``, ``wrong``: numbers of recordings with
    the name, where its class holds an effect of the truth and where it does not; a recording with
    several causes is in several columns. `UNEXPLAINED` counts the flag, whatever is named.
    """
    lines = []
    for number, row in enumerate(rows):
        if row["kind"] == "pair" or (row["kind"] == "one" and row["sigma"] < REACHED * LARGE):
            continue
        truth = "+".join(effect["effect"] for effect in row["truth"]) or "clean"
        named = _columns(row).items()
        lines += [(row["kind"], truth, name, number, right, not right) for name, right in named]
    keys = ["kind", "truth", "named", "recordings"]
    table = pd.DataFrame(lines, columns=[*keys, "right", "wrong"])
    table["recordings"] = table.groupby(["kind", "truth"]).recordings.transform("nunique")
    table = table.groupby(keys, sort=False)[["right", "wrong"]].sum().reset_index()
    # kinds in the matrix' order, effects in the registry's
    order = [*KINDS, *EFFECTS].index
    table = table.sort_values(["kind", "truth"], key=lambda column: column.map(order))
    for name in ("right", "wrong"):
        table[f"{name}_share"] = table[name] / table.recordings
    return table.reset_index(drop=True)


def _columns(row: dict) -> dict[str, bool]:
    """The columns of a recording in the confusion matrix, and whether each is right."""
    if row["crash"]:
        return {CRASH: False}
    found = {cause["effect"]: cause["effect"] not in row["wrong_names"] for cause in row["causes"]}
    if not found and not row["unexplained"]:
        found[NOTHING] = row["kind"] in ("clean", "gauge")
    if row["unexplained"]:
        found[UNEXPLAINED] = row["kind"] in ("outside", "struck")
    return found


def coverage_limits(part: pd.DataFrame) -> tuple[float, float, float]:
    """Mean share of 95 % intervals that cover, with 95 % limits (Student's t over the recordings).

    The error is no less than that of independent coordinates covered as they should be: a few
    recordings may agree by chance. No limits where there are fewer than two recordings.
    """
    shares = (part.covered / part.coordinates).astype(float)
    share, count = float(shares.mean()), len(shares)
    error = shares.std(ddof=1) / np.sqrt(count) if count > 1 else np.nan
    least = np.sqrt(LEVEL * (1 - LEVEL) / part.coordinates.sum())
    reach = student.ppf((1 + LEVEL) / 2, count - 1) * np.fmax(error, least)
    return share, float(np.maximum(share - reach, 0.0)), float(np.minimum(share + reach, 1.0))


class Criterion(NamedTuple):
    """A limit on a share of recordings.

    Attributes
    ----------
    id, says : str
    kinds : tuple of str
        Kinds of cases that it is about.
    hit : str
        Column of `recordings` that says what is counted; `COVERED`: the mean share of intervals
        instead. A crash has a criterion of its own: it is a miss where the share must be large,
        else left out.
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
        for name, words, kinds in [*((k, k, (k,)) for k in KINDS), ("all", "all sets", KINDS)]
    ),
)  # fmt: skip


def criteria(table: pd.DataFrame) -> pd.DataFrame:
    """Each criterion with its measured share; ``table`` from `recordings`.

    ``share``, ``low``, ``high`` are for the recordings that the criteria are set for (8 IMUs,
    125 Hz, 24 s); the columns ``all_`` for every one. Limits: 95 %, Clopper and Pearson's for
    shares of recordings; between recordings for the coverage. ``sure``: whether they exclude the
    limit.
    """
    table = table.assign(long=table.least_seconds > LONGEST)
    lines = []
    for item in CRITERIA:
        line, every = item.measure(table[table.standard]), item.measure(table)
        limits = (line[name] for name in ("share", "low", "high"))
        aim, verdict, sure = judged(item.aim, line["recordings"], *limits)
        lines.append(
            {"id": item.id, "bar": item.says, "aim": aim, **line, "verdict": verdict, "sure": sure}
            | {f"all_{name}": value for name, value in every.items()}
        )
    # the false alarms' share once more: its upper limit, of enough recordings
    first = lines[0]
    aim, verdict, _ = judged((0.0, UPPER_LIMIT), 1, first["high"])
    lines.insert(1, first | {
        "id": "false_alarms_limit", "aim": aim, "sure": None,
        "bar": f"the same: upper 95 % limit, over {UPPER_COUNT} or more recordings",
        "verdict": verdict if first["recordings"] >= UPPER_COUNT else f"needs {UPPER_COUNT}",
    })  # fmt: skip
    return pd.DataFrame(lines)


def judged(aim: tuple | None, number: int, share: float, low=np.nan, high=np.nan) -> tuple:
    """An aim in words, the verdict on a share, and whether its limits are sure of that.

    The verdict is 'pass', or by how many percentage points the share misses the aim. Sure is the
    verdict (bool) where it holds anywhere between the limits, else None.
    """
    if aim is None:
        return "", "", None
    least, most = aim
    words = f"{100 * least:g} to {100 * most:g} %"
    if least == 0.0:
        words = f"at most {100 * most:g} %" if most else "never"
    elif most == 1.0:
        words = f"at least {100 * least:g} %"
    if not number:
        return words, NONE, None
    miss = max(least - share, share - most)
    inside = least <= low and high <= most
    sure = None if np.isnan(low) else bool(inside or high < least or low > most)
    return words, PASS if miss <= 0 else f"short by {100 * miss:.1f} points", sure
