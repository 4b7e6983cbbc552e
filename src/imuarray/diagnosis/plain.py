"""What parameters of effects mean, in plain words: whose, how much, against what.

A delay or a turn common to all IMUs is nobody's: where one IMU stands out, the others are what it
is held against.
"""

from typing import NamedTuple

import numpy as np

from imuarray.diagnosis.quantities import DEGREE, joined, number, plus_minus, quantity
from imuarray.model.catalogue import OFF_COLUMNS, OFF_ROWS
from imuarray.model.effects import known_effect

OUT = 5.0  # sds, and times the usual distance from the median, from which one stands out
SURE = 3.0  # sds of a single turn that is spoken of
SEEN = 2.0  # sds of a lag
FEW = 4  # IMUs that are spoken of one by one


class Sizes(NamedTuple):
    """An effect's parameters (K, m): of which IMUs, named how, values in SI units, sds."""

    labels: list[str]
    components: list[str]
    values: np.ndarray
    sds: np.ndarray

    @classmethod
    def of(cls, found: dict[tuple[str, str], tuple[float, float | None]], labels) -> "Sizes":
        """From {(component, IMU): (value, sd)}; zero where an IMU has none, NaN without an sd."""
        parts, labels = list(dict.fromkeys(part for part, _ in found)), list(labels)
        table = [[found.get((part, label), (0.0, 0.0)) for part in parts] for label in labels]
        values, sds = np.moveaxis(np.array(table, float), -1, 0)
        return cls(labels, parts, values, sds)


def plain(effect: str, sizes: Sizes) -> list[str]:
    """Sentences on an effect without its name; none where there are no plainer words than it."""
    return WORDS[effect](sizes) if effect in WORDS else []


def plainly(effect: str, sizes: Sizes) -> list[str]:
    """The same, with an effect's own meaning where there are none."""
    return plain(effect, sizes) or [f"{known_effect(effect).meaning or effect.replace('_', ' ')}"]


def standing_out(values, sds) -> tuple[np.ndarray, float]:
    """Which of (K,) values stand out (K,) bool, and the mean of the others.

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


def _read(labels, ages, sds) -> list[str]:
    """Which IMUs are read late, by their ages (K,) s at the stamps."""
    if len(ages) < 2:
        return []
    out, usual = standing_out(ages, sds)
    said = [
        f"IMU {labels[k]} is read {plus_minus(1e3 * abs(ages[k] - usual), 1e3 * sds[k])} ms"
        + (
            " late: it shows the motion that long before its stamp"
            if ages[k] > usual
            else " early: it shows the motion that long after its stamp"
        )
        for k in np.flatnonzero(out)
    ]
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
    out, usual = standing_out(values, sds) if len(values) > 2 else (np.zeros(len(values), bool), 0)
    usual = float(np.mean(values[~out]))
    side = "run ahead of" if usual > 0 else "lag behind"
    error = float(np.sqrt(np.mean(sds[~out] ** 2)))
    size = f"{plus_minus(1e3 * abs(usual), 1e3 * error)} ms"
    said = [f"the gyroscopes {side} the accelerometers by {size}"]
    if abs(usual) < SEEN * error:
        said = [f"no lag seen between gyroscopes and accelerometers ({size})"]
    for k in np.flatnonzero(out):
        own = plus_minus(1e3 * abs(values[k]), 1e3 * sds[k])
        side = "ahead of" if values[k] > 0 else "behind"
        said.append(f"gyroscope {sizes.labels[k]} is {own} ms {side} its accelerometer")
    return said


def _turned(kind: str):
    def words(sizes: Sizes) -> list[str]:
        if sizes.values.shape[1] != len(OFF_ROWS):
            return []
        maps, spread = (np.zeros((len(sizes.values), 3, 3)) for _ in range(2))
        maps[:, OFF_ROWS, OFF_COLUMNS] = np.nan_to_num(sizes.values)
        spread[:, OFF_ROWS, OFF_COLUMNS] = np.nan_to_num(sizes.sds)
        turns = (maps - np.swapaxes(maps, 1, 2))[:, [2, 0, 1], [1, 2, 0]] / 2
        errors = np.hypot(spread, np.swapaxes(spread, 1, 2))[:, [2, 0, 1], [1, 2, 0]] / 2
        angles = np.linalg.norm(turns, axis=1)
        sds = np.sqrt(np.sum((turns * errors) ** 2, axis=1)) / np.maximum(angles, 1e-12)
        skew = np.abs(maps + np.swapaxes(maps, 1, 2)).max(axis=(1, 2)) / 2
        return _each(kind, sizes.labels, "is turned by", angles, sds) + _skewed(
            kind, sizes.labels, skew
        )

    return words


def _skewed(kind: str, labels, skew) -> list[str]:
    worst = int(np.argmax(skew))
    size = number(DEGREE * skew[worst], 2)
    return [f"axes of the {kind}s are skewed by up to {size} degrees ({kind} {labels[worst]})"]


def _each(kind: str, labels, verb: str, angles, sds) -> list[str]:
    """One by one those few that are surely not zero; else how large all are."""
    out = standing_out(angles, sds)[0] if len(angles) > 2 else np.ones(len(angles), bool)
    out = out & (angles > SURE * sds)
    if not out.any():
        out = angles > SURE * sds
    if 0 < out.sum() <= FEW:
        return [
            f"{kind} {label} {verb} {plus_minus(DEGREE * angle, DEGREE * sd)} degrees"
            for label, angle, sd in zip(*(np.array(x)[out] for x in (labels, angles, sds)),
                                        strict=True)
        ]  # fmt: skip
    ends = [number(DEGREE * end, 2) for end in (angles.min(), angles.max())]
    return [f"the {kind}s are turned by {ends[0]} to {ends[1]} degrees"] if out.any() else []


def _scaled(kind: str):
    def words(sizes: Sizes) -> list[str]:
        means = np.nanmean(sizes.values, axis=1)
        sds = np.sqrt(np.nanmean(sizes.sds**2, axis=1) / sizes.values.shape[1])
        out, usual = standing_out(means, sds) if len(means) > 2 else (np.ones(len(means), bool), 0)
        said = []
        for k in np.flatnonzero(out):
            off = sizes.values[k] - usual
            rows = zip(sizes.components, off, sizes.sds[k], strict=True)
            size = float(np.nanmax(np.abs(off)))
            axes = joined(f"{name} {quantity(v, sd, '%', size)}" for name, v, sd in rows)
            mean = means[k] - usual
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

    return words


def _offset(kind: str, unit: str):
    def words(sizes: Sizes) -> list[str]:
        ratio = np.abs(sizes.values) / np.where(sizes.sds > 0, sizes.sds, np.inf)
        k, i = np.unravel_index(np.argmax(ratio), ratio.shape)
        if ratio[k, i] < SURE:
            return [f"offsets of the {kind}s are allowed for, and none is surely there"]
        size = quantity(abs(sizes.values[k, i]), sizes.sds[k, i], unit)
        where = f"{kind} {sizes.labels[k]}, {sizes.components[i]}"
        return [f"the {kind}s have offsets, the surest {size} ({where})"]

    return words


def _places(sizes: Sizes) -> list[str]:
    size = quantity(float(np.sqrt(np.nanmean(sizes.values**2))), None, "m")
    return [f"the three axes of an accelerometer sit at places of their own, {size} apart (rms)"]


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


WORDS = {
    "sensor_delay": _late, "gyroscope_delay": _lag, "sensor_clock": _clocks,
    "gyroscope_misalignment": _turned("gyroscope"), "gyroscope_scale": _scaled("gyroscope"),
    "accelerometer_misalignment": _turned("accelerometer"),
    "accelerometer_scale": _scaled("accelerometer"), "size_effect": _places,
    "accelerometer_bias": _offset("accelerometer", "m s-2"),
    "gyroscope_bias": _offset("gyroscope", "rad s-1"),
}  # fmt: skip
