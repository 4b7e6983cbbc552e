"""Graded rows as tables: recordings, effects, detection, confusion, gain and coverage."""

from collections import Counter

import numpy as np
import pandas as pd
from scipy.stats import binomtest
from scipy.stats import t as student

from imuarray_papers.blind.cases import KINDS, SIZES
from imuarray_papers.blind.inject import EFFECTS
from imuarray_papers.blind.study import GAINS, MODELS

NOTHING, UNEXPLAINED, CRASH = "nothing", "unexplained", "crash"
ALL = "all effects"
STANDARD = {"imus": 8, "sampling_rate": 125.0, "duration": 24.0}  # what the criteria are set for
LARGE = 8.0  # sigma, from which an effect is to be found
LEVEL = 0.95  # of all intervals
REACHED = 0.98  # of a size that was asked for counts as that size
AMPLITUDE_BINS, PER_BIN = 6, 4  # at most so many bins, with at least so many recordings


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
        line["crash"] = row["grade"] == CRASH
        line |= {name: row[name] for name in ("grade", "right_set", "confident")}
        line |= {"named": bool(row["causes"]), "wrong": bool(row["wrong_names"])}
        for name in ("found", "sensors_right"):
            line[name] = all(effect[name] for effect in truth)
        line |= {f"{name}{end}": row[f"{name}{end}"] for name in GAINS for end in ("", "_se")}
        for model in MODELS:
            for name in ("position_rmse_m", "covered", "coordinates"):
                line[f"{model}_{name}"] = row[model][name] if row[model] else None
        line |= {"seconds": row["seconds"], "cpu_seconds": row["cpu_seconds"]}
        # either is an upper limit of what it takes where nothing else runs
        line["least_seconds"] = min(row["seconds"], row["cpu_seconds"])
        lines.append(line | {"error": row["error"] or ""})
    return pd.DataFrame(lines)


def effects(rows: list[dict]) -> pd.DataFrame:
    """A line for each effect of the truth: sizes, amplitude, found, named, sensors_right, wrong.

    ``sensors`` is "one", "two" or "all"; ``wrong``: whether its recording has a wrong name.
    """
    lines = []
    for row in rows:
        for effect in row["truth"]:
            line = {name: row[name] for name in ("case", "kind", "rails")} | effect
            few = "two" if len(effect["sensors"]) > 1 else "one"
            many = "all" if effect["sensors"] == ["all"] else few
            lines.append(line | {"sensors": many, "wrong": bool(row["wrong_names"])})
    columns = ["case", "kind", "rails", "effect", "sensors", "sigma", "sigma_exact", "amplitude",
               "unit", "found", "named", "sensors_right", "wrong"]  # fmt: skip
    return pd.DataFrame(lines, columns=columns)


def detection(table: pd.DataFrame, against: str) -> pd.DataFrame:
    """Rates of single effects found, by size; ``table`` as `effects` returns it.

    ``against``: "sigma" (bins around the sizes of the matrix, and all effects together too) or
    "amplitude" (bins of equal counts, in each effect's own unit). Crashes count as missed.
    """
    single = table[table.kind == "one"]
    groups = list(single.groupby("effect", sort=False))
    lines = []
    for name, part in groups + ([(ALL, single)] if against == "sigma" and groups else []):
        bins = _sigma_bins(part) if against == "sigma" else _equal_bins(part, against)
        lines += [_detected(name, against, members) for members in bins]
    return pd.DataFrame(lines)


def _sigma_bins(part: pd.DataFrame) -> list[pd.DataFrame]:
    """Parts with similar sizes, split halfway between those of the matrix, and by decades above."""
    levels = np.array([size for size in SIZES if size is not None])
    edges = [*np.sqrt(levels[1:] * levels[:-1]), 100.0, 1000.0]
    return [members for _, members in part.groupby(np.digitize(part.sigma, edges))]


def _equal_bins(part: pd.DataFrame, column: str) -> list[pd.DataFrame]:
    """Parts of about equal numbers in the order of ``column``; one if it does not vary."""
    ordered = part.sort_values(column, kind="stable")
    count = int(np.clip(len(part) // PER_BIN, 1, AMPLITUDE_BINS))
    if ordered[column].nunique() == 1:
        count = 1
    return [ordered.iloc[places] for places in np.array_split(np.arange(len(part)), count)]


def _detected(name: str, against: str, members: pd.DataFrame) -> dict:
    values, number = members[against].to_numpy(float), len(members)
    found, wrong = int(members.found.sum()), int(members.wrong.sum())
    low, high = share_limits(found, number)
    return {
        "effect": name,
        "against": against,
        "unit": "sigma" if against == "sigma" else members.unit.iloc[0],
        "smallest": values.min(),
        # within them: the mean of one value may miss it by a rounding
        "centre": float(np.clip(np.exp(np.log(values).mean()), values.min(), values.max())),
        "largest": values.max(),
        "recordings": number,
        "found": found,
        "share": found / number,
        "low": low,
        "high": high,
        "named_itself": int(members.named.sum()),
        "sensors_right": int(members.sensors_right.sum()),
        "wrong": wrong,
        "wrong_share": wrong / number,
    }


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
    if row["grade"] == CRASH:
        return {CRASH: False}
    found = {cause["effect"]: cause["effect"] not in row["wrong_names"] for cause in row["causes"]}
    if not found and not row["unexplained"]:
        found[NOTHING] = row["kind"] in ("clean", "gauge")
    if row["unexplained"]:
        found[UNEXPLAINED] = row["kind"] in ("outside", "struck")
    return found


def _order(kind: str, name: str) -> tuple:
    """Kinds in the matrix' order; all effects first, then each in the registry's."""
    known = [ALL, *EFFECTS]
    return KINDS.index(kind), known.index(name) if name in known else -1


def gain_table(table: pd.DataFrame) -> pd.DataFrame:
    """Gain, position RMSE and coverage by kind and effect; ``table`` from `recordings`.

    Gains are means over recordings (nats per sample, held out), with the standard error that
    comes of each recording's own; RMSE are pooled, metres; coverage is the mean share of the 3
    (A - 1) intervals, with the standard error between recordings, whose coordinates go together.
    """
    there = table[~table.crash].copy()
    groups = [(kind, ALL, part) for kind, part in there.groupby("kind")]
    for kind, part in there[~there.kind.isin(["clean", "pair"])].groupby("kind"):
        groups += [(kind, effect, few) for effect, few in part.groupby("effects")]
    lines = [{"kind": kind, "effect": name} | _gained(part) for kind, name, part in groups]
    lines.sort(key=lambda line: _order(line["kind"], line["effect"]))
    return pd.DataFrame(lines)


def _gained(part: pd.DataFrame) -> dict:
    number = len(part)
    line = {"recordings": number}
    for name in GAINS:
        line[name] = part[name].mean()
        line[f"{name}_se"] = np.sqrt(np.sum(part[f"{name}_se"] ** 2)) / number
        line[f"{name}_median"] = part[name].median()
    for model in MODELS:
        size = part[f"{model}_position_rmse_m"].astype(float)
        line[f"{model}_position_rmse_m"] = np.sqrt(np.mean(size**2))
        line[f"{model}_position_rmse_median_m"] = size.median()
        line[f"{model}_coverage"], line[f"{model}_coverage_se"] = coverage(part, model)
    return line


def coverage(part: pd.DataFrame, model: str) -> tuple[float, float]:
    """Mean share of 95 % intervals that cover, and its standard error between recordings."""
    share = (part[f"{model}_covered"] / part[f"{model}_coordinates"]).astype(float)
    if len(share) < 2:
        return float(share.mean()), np.nan
    return float(share.mean()), float(share.std(ddof=1) / np.sqrt(len(share)))


def coverage_limits(part: pd.DataFrame, model: str) -> tuple[float, float, float]:
    """Mean coverage with 95 % limits (Student's t over the recordings).

    The error is no less than that of independent coordinates covered as they should be: a few
    recordings may agree by chance. No limits where there are fewer than two recordings.
    """
    share, error = coverage(part, model)
    least = np.sqrt(LEVEL * (1 - LEVEL) / part[f"{model}_coordinates"].sum())
    reach = student.ppf((1 + LEVEL) / 2, len(part) - 1) * np.fmax(error, least)
    return share, float(np.maximum(share - reach, 0.0)), float(np.minimum(share + reach, 1.0))
