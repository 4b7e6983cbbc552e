"""Effects in words: what they are, how large, how sure.

For the sentences of `diagnosis.json` and of both pages. A delay or a turn common to all IMUs is
nobody's: where one IMU stands out, the others are what it is held against.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from imuarray.model.effects import known_effect
from imuarray.words.numbers import (
    DEGREE,
    joined,
    number,
    plus_minus,
    quantity,
    span,
    symbols,
    unit_shown,
)

STATED = 3  # parameters that are stated one by one
OUT = 5.0  # sds, and times the usual distance from the median, from which one stands out
SURE = 3.0  # sds of a single turn that is spoken of
SEEN = 2.0  # sds of a lag
SHOWN_HZ = 5.0  # of a motion by hand, at which filters are compared
FAST = np.radians(1000.0)  # rad/s, at which what grows with the rate is said
FEW = 4  # IMUs that are spoken of one by one
# Entries beside a matrix' diagonal (xy, xz, yx, yz, zx, zy) whose difference is a turn about x, y
# and z, and whose sum is a skew.
BELOW, ABOVE = [5, 1, 2], [3, 4, 0]


def sensors_of(labels, imus) -> list[str]:
    """Labels of the IMUs, or ["all"]."""
    return ["all"] if len(imus) == len(labels) else [labels[k] for k in imus]


def imus_named(sensors) -> str:
    """'all IMUs', 'IMU 3', 'IMUs 3, 4'."""
    if sensors == ["all"]:
        return "all IMUs"
    return f"IMU{'s' if len(sensors) > 1 else ''} {', '.join(sensors)}"


def spelled(effect: str) -> str:
    """An effect's id without underscores."""
    return effect.replace("_", " ")


def equation(effect: str) -> str:
    """Change that an effect makes in a reading, in the model's own words."""
    item = known_effect(effect)
    if item.apply is None:
        return item.remedy or spelled(effect)
    text = symbols((item.apply.__doc__ or "").strip().split("\n")[0].rstrip("."))
    return text[:1].lower() + text[1:] if text[1:2].islower() else text


def in_short(cause: dict, labels, says: str = "") -> str:
    """Name of a cause, its kind and size in the words of one who holds the board."""
    effect, rows = cause["effect"], cause["parameters"]
    values = {name: (item["value"], item["sd"]) for name, item in rows.items()}
    found = sentences(effect, values, labels)
    told = says if says or found else sizes(cause, labels)
    said = "; ".join(filter(None, [*(found or meaning(effect)), told]))
    return f"{spelled(effect)}, {imus_named(cause['sensors'])}: {said}"


def sizes(cause: dict, labels) -> str:
    """A cause's parameters: each of a few, else their rms and the largest."""
    groups: dict[tuple[str, str], list] = {}
    effect = known_effect(cause["effect"])
    for name, item in cause["parameters"].items():
        part, label = split_name(name, labels)
        if part == "phase":
            continue
        unit = unit_shown(cause["effect"], name, item["unit"])
        kind = part.split("_")[0] if effect.scanned and unit != "m" else ""
        if effect.kind != "mean":
            kind = "correlation time" if part.startswith("correlation_time") else part.split("_")[0]
        groups.setdefault((kind, unit), []).append((part, label, item))
    return ", ".join(_group(kind, unit, items) for (kind, unit), items in groups.items())


def _group(kind, unit, items) -> str:
    values = np.array([item["value"] for *_, item in items])
    # the sign of a clock's frequency says which way its sawtooth runs
    values = np.abs(values) if kind == "frequency" else values
    several = len({label for _, label, _ in items}) > 1
    if len(items) <= STATED:
        size = np.max(np.abs(values))
        return ", ".join(
            f"{part_in_words(part)}{f' of IMU {label}' if several and label else ''} ".replace(
                "value ", ""
            )
            + quantity(value, item["sd"], unit, size)
            for value, (part, label, item) in zip(values, items, strict=True)
        )
    if kind:
        return f"{kind} {span(float(values.min()), float(values.max()), unit)}"
    place = int(np.argmax(np.abs(values)))
    part, label, item = items[place]
    rms = quantity(float(np.sqrt(np.mean(values**2))), None, unit)
    largest = quantity(float(values[place]), item["sd"], unit)
    text = f"rms {rms}, the largest, {part_in_words(part)} of IMU {label}, {largest}"
    if item["sd"] is not None and abs(values[place]) < 2 * item["sd"]:
        text += " (single values are uncertain: the motion can take up combinations of them)"
    return text


def split_name(name: str, labels) -> tuple[str, str]:
    """(component, IMU) of a parameter's name; IMU is "" where the name has none."""
    for label in sorted(labels, key=len, reverse=True):
        if name.endswith(f"_{label}"):
            return name[: -len(label) - 1], label
    return name, ""


def part_in_words(part: str) -> str:
    """'accelerometer z, degree 1' of 'accelerometer_z_degree1'."""
    return part.replace("_degree", ", degree ").replace("_", " ")


def meaning(effect: str) -> list[str]:
    """The name of an effect in words, where nothing is known of its size."""
    return [known_effect(effect).meaning or spelled(effect)]


def sentences(effect: str, found: dict[str, tuple[float, float | None]], labels) -> list[str]:
    """Sentences on an effect without its name; none where there are no plainer words than it.

    ``found``: {parameter: (value, sd)} in SI units, of the IMUs named ``labels``.
    """
    return WORDS[effect](Sizes.of(found, labels)) if found and effect in WORDS else []


class Sizes(NamedTuple):
    """An effect's parameters (K, m): of which IMUs, named how, values in SI units, sds."""

    labels: list[str]
    components: list[str]
    values: np.ndarray
    sds: np.ndarray

    @classmethod
    def of(cls, found: dict[str, tuple[float, float | None]], labels) -> "Sizes":
        """From {name: (value, sd)}; zero where an IMU has none, NaN without an sd."""
        rows = {split_name(name, labels): row for name, row in found.items()}
        parts, labels = list(dict.fromkeys(part for part, _ in rows)), list(labels)
        table = [[rows.get((part, label), (0.0, 0.0)) for part in parts] for label in labels]
        values, sds = np.moveaxis(np.array(table, float), -1, 0)
        return cls(labels, parts, values, sds)


def standing_out(values, sds) -> tuple[np.ndarray, float]:
    """(K,) bool, the values that stand out of (K,), and the mean of the others.

    Of two the second is held against the first.
    """
    if len(values) == 2:
        return np.array([False, True]), float(values[0])
    off = np.abs(values - np.median(values))
    out = off > OUT * np.maximum(1.48 * np.median(off), np.nan_to_num(sds))
    return out, float(np.mean(values[~out]))


def _late(sizes: Sizes) -> list[str]:
    values, sds = sizes.values[:, 0], sizes.sds[:, 0]
    # where the mean of all is zero, a delay against the others' mean is larger, its sd as well
    larger = len(values) / max(len(values) - 1, 1) if np.all(sds > 0) else 1.0
    return _read(sizes.labels, -values, larger * sds)


def lags_apart(found: dict[str, dict], labels) -> tuple[dict[str, dict], list[str]]:
    """({effect: {parameter: (value, sd)}} with each gyroscope's lag behind its own accelerometer,
    sentences on late ones), where accelerometers have lags of their own.

    Both are behind the motion then: an IMU that is read late has two that are alike.
    """
    if not {"gyroscope_delay", "accelerometer_filter"} <= found.keys():
        return found, []
    if found.keys() & {"sensor_delay", "sensor_clock"}:  # these say when an IMU is read
        return found, []
    lags, other = (
        np.array([found[effect].get(f"{name}_{label}", (0.0, 0.0)) for label in labels], float)
        for effect, name in (("accelerometer_filter", "lag"), ("gyroscope_delay", "delay"))
    )
    own, sds = other[:, 0] - lags[:, 0], np.hypot(other[:, 1], lags[:, 1])
    there = np.array([f"delay_{label}" in found["gyroscope_delay"] for label in labels])
    rows = {f"delay_{labels[k]}": (own[k], sds[k]) for k in np.flatnonzero(there)}
    alike = there & (np.abs(own - np.median(own[there])) < OUT * sds)
    whose = np.where(alike, "IMU", "accelerometer")
    return found | {"gyroscope_delay": rows}, _read(labels, -lags[:, 0], lags[:, 1], whose)


def _read(labels, ages, sds, whose=None) -> list[str]:
    """Words on IMUs that are read late, or on triads ``whose``, by ages (K,) s at the stamps."""
    whose = ["IMU"] * len(labels) if whose is None else whose
    if len(ages) < 2:
        return []
    out, usual = standing_out(ages, sds)
    said = []
    for k in np.flatnonzero(out):
        way, side = ("late", "before") if ages[k] > usual else ("early", "after")
        size = plus_minus(1e3 * abs(ages[k] - usual), 1e3 * sds[k])
        said.append(
            f"{whose[k]} {labels[k]} is read {size} ms {way}: it shows the motion that long"
            f" {side} its stamp"
        )
    rest = ages[~out] - usual
    if len(rest) < 2 or np.abs(rest).max() < OUT * np.nanmax(sds):
        return said
    return said + [
        f"{'the others' if said else 'the IMUs'} are read at instants of their own, from"
        f" {number(1e3 * rest.max(), 2)} ms late to {number(-1e3 * rest.min(), 2)} ms early against"
        " their mean"
    ]


def _lag(sizes: Sizes) -> list[str]:
    values, sds = sizes.values[:, 0], sizes.sds[:, 0]
    out = standing_out(values, sds)[0] if len(values) > 2 else np.zeros(len(values), bool)
    usual, error = float(np.mean(values[~out])), float(np.sqrt(np.mean(sds[~out] ** 2)))
    size = f"{plus_minus(1e3 * abs(usual), 1e3 * error)} ms"
    side = "run ahead of" if usual > 0 else "lag behind"
    said = [f"the gyroscopes {side} the accelerometers by {size}"]
    if usual == error == 0:  # it is of those that stand out alone
        said = []
    elif abs(usual) < SEEN * error:
        said = [f"no lag seen between gyroscopes and accelerometers ({size})"]
    for k in np.flatnonzero(out):
        own = plus_minus(1e3 * abs(values[k]), 1e3 * sds[k])
        side = "ahead of" if values[k] > 0 else "behind"
        said.append(f"gyroscope {sizes.labels[k]} is {own} ms {side} its accelerometer")
    return said


def _filtered(kind: str, sizes: Sizes) -> list[str]:
    """By what sensors show less of a motion at `SHOWN_HZ`: gyroscopes, or one among the others."""
    each = dict(zip(sizes.components, sizes.values.T, strict=True))
    share = (2 * np.pi * SHOWN_HZ) ** 2
    less = share * (each["droop"] - each.get("lag", 0.0) ** 2 / 2)
    sds = share * sizes.sds[:, sizes.components.index("droop")]
    out, usual = standing_out(less, sds) if len(less) > 2 else (np.zeros(len(less), bool), 0.0)
    said = [(f"{kind} {sizes.labels[k]} shows", less[k] - usual, sds[k], "the others")
            for k in np.flatnonzero(out)]  # fmt: skip
    if "lag" not in each and not out.all():
        mean, sd = np.mean(less[~out]), np.mean(sds[~out])
        if sd > 0:  # else it is of those that stand out alone
            said.insert(0, ("the gyroscopes show", mean, sd, "the accelerometers"))
    return [
        f"of motion at {SHOWN_HZ:g} Hz {shows} {quantity(abs(x), sd, '%')}"
        f" {'less' if x > 0 else 'more'} than {others}, by a filter"
        for shows, x, sd, others in said
    ]


def _averaged(sizes: Sizes) -> list[str]:
    mean, sd = float(np.mean(sizes.values)), float(np.mean(sizes.sds))
    if mean < -SEEN * sd:
        return ["accelerometers depart from the rate's square as no filter makes them"]
    if mean < SEEN * sd:
        return ["the sensors' filters are allowed for, and average over no time that is seen"]
    corner = 1 / (2 * np.pi * np.sqrt(mean))
    return [f"the sensors' filters average like a low pass of some {number(corner, 2)} Hz"]


def _curved(sizes: Sizes) -> list[str]:
    mean = float(np.mean(sizes.values @ [FAST, FAST**2]))  # errors of the two go together
    more, size = "more" if mean > 0 else "less", quantity(abs(mean), None, "%")
    return [f"at 1000 deg/s the gyroscopes show {size} {more} than at rest"]


def _with_rate(sizes: Sizes) -> list[str]:
    """Accelerometers whose readings grow with the square of the rate, against the others."""
    values = FAST**2 * (sizes.values - np.median(sizes.values, axis=0))
    sds, said = FAST**2 * sizes.sds, []
    for label, value, sd in zip(sizes.labels, values, sds, strict=True):
        if np.any(np.abs(value) > OUT * sd):
            rows = zip(sizes.components, value, sd, strict=True)
            axes = joined(f"{axis} {quantity(x, error, 'm s-2')}" for axis, x, error in rows)
            said.append(f"at 1000 deg/s accelerometer {label} is off by {axes}")
    return said or ["accelerometers' offsets by the rate are allowed for, and none is surely there"]


def _clocks(sizes: Sizes) -> list[str]:
    period, age = (sizes.components.index(name) for name in ("period", "offset"))
    periods = np.abs(sizes.values[:, period])
    sure = periods > SURE * np.nan_to_num(sizes.sds[:, period])
    said = []
    if sure.any():
        whose = "the IMUs" if sure.all() else f"IMUs {joined(np.array(sizes.labels)[sure])}"
        verb = f"{whose} sample on clocks of their own"
        if sure.sum() == 1:
            verb = f"IMU {sizes.labels[int(np.argmax(sure))]} samples on a clock of its own"
        size = quantity(float(np.median(periods[sure])), None, "s")
        said.append(f"{verb}: a reading is up to {size} old, in a sawtooth")
    return said + _read(sizes.labels, sizes.values[:, age], sizes.sds[:, age])


def _turned(kind: str, sizes: Sizes) -> list[str]:
    if sizes.values.shape[1] != len(BELOW) + len(ABOVE):
        return []
    below, above = (np.nan_to_num(sizes.values)[:, half] for half in (BELOW, ABOVE))
    turns, skew = (below - above) / 2, np.abs(below + above).max(axis=1) / 2
    errors = np.hypot(*(np.nan_to_num(sizes.sds)[:, half] for half in (BELOW, ABOVE))) / 2
    angles = np.linalg.norm(turns, axis=1)
    sds = np.sqrt(np.sum((turns * errors) ** 2, axis=1)) / np.maximum(angles, 1e-12)
    worst = int(np.argmax(skew))
    return [
        *_angles(kind, sizes.labels, angles, sds),
        f"axes of the {kind}s are skewed by up to {number(DEGREE * skew[worst], 2)} degrees"
        f" ({kind} {sizes.labels[worst]})",
    ]


def _angles(kind: str, labels, angles, sds) -> list[str]:
    """One by one those few that are surely not zero; else how large all are."""
    sure = angles > SURE * sds
    out = sure & standing_out(angles, sds)[0] if len(angles) > 2 else sure
    out = out if out.any() else sure
    if out.sum() > FEW:
        low, high = (number(DEGREE * end, 2) for end in (angles.min(), angles.max()))
        return [f"the {kind}s are turned by {low} to {high} degrees"]
    return [
        f"{kind} {labels[k]} is turned by {plus_minus(DEGREE * angles[k], DEGREE * sds[k])} degrees"
        for k in np.flatnonzero(out)
    ]


def _scaled(kind: str, sizes: Sizes) -> list[str]:
    means = np.nanmean(sizes.values, axis=1)
    sds = np.sqrt(np.nanmean(sizes.sds**2, axis=1) / sizes.values.shape[1])
    out, usual = standing_out(means, sds) if len(means) > 2 else (np.ones(len(means), bool), 0)
    said = []
    for k in np.flatnonzero(out):
        off, mean = sizes.values[k] - usual, means[k] - usual
        rows = zip(sizes.components, off, sizes.sds[k], strict=True)
        size = float(np.nanmax(np.abs(off)))
        axes = joined(f"{name} {quantity(v, sd, '%', size)}" for name, v, sd in rows)
        if np.ptp(off) < abs(mean):
            more = "too much" if mean > 0 else "too little"
            shown = quantity(abs(mean), sds[k], "%")
            said.append(f"{kind} {sizes.labels[k]} shows {shown} {more} ({axes})")
        else:
            said.append(f"the axes of {kind} {sizes.labels[k]} are scaled by {axes}")
    rest = sizes.values[~out]
    if len(rest) and np.nanmax(np.abs(rest)) > OUT * np.nanmax(sizes.sds):
        size = quantity(float(np.nanmax(np.abs(rest))), None, "%")
        among = "the others'" if said else f"the {kind}s'"
        said.append(f"{among} axes are scaled by up to {size}")
    return said


def _offset(kind: str, unit: str, sizes: Sizes) -> list[str]:
    ratio = np.abs(sizes.values) / np.where(sizes.sds > 0, sizes.sds, np.inf)
    k, i = np.unravel_index(np.argmax(ratio), ratio.shape)
    if ratio[k, i] < SURE:
        return [f"offsets of the {kind}s are allowed for, and none is surely there"]
    size = quantity(abs(sizes.values[k, i]), sizes.sds[k, i], unit)
    where = f"{kind} {sizes.labels[k]}, {sizes.components[i]}"
    return [f"the {kind}s have offsets, the surest {size} ({where})"]


def _places(sizes: Sizes) -> list[str]:
    size = quantity(float(np.sqrt(np.nanmean(sizes.values**2))), None, "m")
    return [f"the three axes of an accelerometer sit at places of their own, {size} apart (rms)"]


WORDS = {"sensor_delay": _late, "gyroscope_delay": _lag, "sensor_clock": _clocks}
WORDS["size_effect"] = _places
WORDS["accelerometer_rate_square"] = _with_rate
WORDS["gyroscope_curve"] = _curved
WORDS["accelerometer_band"] = _averaged
WORDS["gyroscope_filter"] = partial(_filtered, "gyroscope")
WORDS["accelerometer_filter"] = partial(_filtered, "accelerometer")
for _kind, _unit in (("accelerometer", "m s-2"), ("gyroscope", "rad s-1")):
    WORDS[f"{_kind}_misalignment"] = partial(_turned, _kind)
    WORDS[f"{_kind}_scale"] = partial(_scaled, _kind)
    WORDS[f"{_kind}_bias"] = partial(_offset, _kind, _unit)
