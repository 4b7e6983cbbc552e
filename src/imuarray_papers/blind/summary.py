"""Graded rows as tables: recordings, confusion and coverage."""

from collections import Counter

import numpy as np
import pandas as pd
from scipy.stats import binomtest
from scipy.stats import t as student

from imuarray_papers.blind.cases import KINDS
from imuarray_papers.blind.inject import EFFECTS

NOTHING, UNEXPLAINED, CRASH = "nothing", "unexplained", "crash"
STANDARD = {"imus": 8, "sampling_rate": 125.0, "duration": 24.0}  # what the criteria are set for
LARGE = 8.0  # sigma, from which an effect is to be found
LEVEL = 0.95  # of all intervals
REACHED = 0.98  # of a size that was asked for counts as that size


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
        for name in ("position_rmse_m", "covered", "coordinates"):
            line[name] = None if row["crash"] else row["extended"][name]
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
    tally: dict[tuple, Counter] = {}
    for row in rows:
        if row["kind"] == "pair" or (row["kind"] == "one" and row["sigma"] < REACHED * LARGE):
            continue
        truth = "+".join(effect["effect"] for effect in row["truth"]) or "clean"
        counts = tally.setdefault((row["kind"], truth), Counter())
        counts["recordings"] += 1
        for name, right in _columns(row).items():
            counts[name, right] += 1
    lines = []
    for (kind, truth), counts in sorted(tally.items(), key=lambda item: _order(*item[0])):
        number = counts["recordings"]
        for name in dict.fromkeys(key[0] for key in counts if key != "recordings"):
            right, wrong = counts[name, True], counts[name, False]
            line = {"kind": kind, "truth": truth, "named": name, "recordings": number}
            share = {"right_share": right / number, "wrong_share": wrong / number}
            lines.append(line | {"right": right, "wrong": wrong} | share)
    return pd.DataFrame(lines)


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


def _order(kind: str, name: str) -> tuple:
    """Kinds in the matrix' order, effects in the registry's."""
    return KINDS.index(kind), [*EFFECTS].index(name) if name in EFFECTS else -1


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
