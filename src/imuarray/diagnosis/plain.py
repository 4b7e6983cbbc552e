"""Numbers with units as people read them, and what parameters mean in plain words.

SI in the files, degrees and micrometres on the page. A delay or a turn common to all IMUs is
nobody's: where one IMU stands out, the others are what it is held against.
"""

import math
from typing import NamedTuple

import numpy as np

from imuarray.model.catalogue import FULL_SCALE_FORCE, FULL_SCALE_RATE, OFF_COLUMNS, OFF_ROWS
from imuarray.model.effects import known_effect

DEGREE = math.degrees(1.0)
NARROW = "\u00a0"  # a space at which no line is broken
STANDARD_GRAVITY = 9.80665  # m/s^2
# A parameter's unit as files have it -> (factor, unit) pairs to be shown, the first that makes the
# value at least 0.1, then what is said beside it.
SHOWN = {
    "m s-2": (((1.0, "m/s²"), (1e3, "mm/s²")), None),
    "rad s-1": (((1.0, "rad/s"), (1e3, "mrad/s"), (1e6, "µrad/s")), (DEGREE, "deg/s")),
    "rad s m-1": (
        ((1.0, "rad/s per m/s²"), (1e3, "mrad/s per m/s²"), (1e6, "µrad/s per m/s²")),
        (DEGREE * STANDARD_GRAVITY, "deg/s per g"),
    ),
    "s2 m-1": (((1e6, "ppm per m/s²"),), (100 * FULL_SCALE_FORCE, "% at 16 g")),
    "s rad-1": (((1e6, "ppm per rad/s"),), (100 * FULL_SCALE_RATE, "% at 2000 deg/s")),
    "m": (((1e3, "mm"), (1e6, "µm")), None),
    "s": (((1.0, "s"), (1e3, "ms"), (1e6, "µs")), None),
    "Hz": (((1.0, "Hz"),), None),
    "Hz/s": (((1e3, "mHz/s"), (1e6, "µHz/s")), None),
    "m s-3": (((1.0, "m/s³"),), None),
    "s-1": (((1.0, "1/s"), (1e3, "1/(1000 s)")), None),
    "rad": (((1e3, "mrad"), (1e6, "µrad")), (DEGREE, "deg")),
    "%": (((100.0, "%"), (1e6, "ppm")), None),
    "1": (((1.0, ""),), None),
}
OUT = 5.0  # sds, and times the usual distance from the median, from which one stands out
SURE = 3.0  # sds of a single turn that is spoken of
SEEN = 2.0  # sds of a lag
FEW = 4  # IMUs that are spoken of one by one


def unit_shown(effect: str, name: str, unit: str) -> str:
    """The unit that a parameter is shown in: what "1" means depends on whose it is."""
    if unit != "1":
        return unit
    return "%" if name.startswith("share") else known_effect(effect).shown or unit


def number(value: float, digits: int = 3) -> str:
    """Some significant digits, no exponent between 10^-4 and 10^6, a true minus sign."""
    if not math.isfinite(value):
        return "not known"
    if value != 0 and not 1e-4 <= abs(value) < 1e6:
        power = math.floor(math.log10(abs(value)))
        digit = number(value / 10.0**power, digits)
        return f"{digit}{NARROW}·{NARROW}{power_of_ten(power)}"
    text = f"{float(f'{value:.{digits}g}'):.12g}"
    return text.replace("-", "−")


def power_of_ten(power: int) -> str:
    """'10⁻⁷⁷'."""
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def plus_minus(value: float, error: float | None) -> str:
    """A value with its error, both to the error's second digit; without one, three digits."""
    if error is None or not math.isfinite(error) or error <= 0 or not math.isfinite(value):
        return number(value)
    if max(abs(value), error) >= 1e6:
        power = math.floor(math.log10(max(abs(value), error)))
        inner = plus_minus(value / 10.0**power, error / 10.0**power)
        return f"({inner}){NARROW}·{NARROW}{power_of_ten(power)}"
    places = 1 - math.floor(math.log10(error))
    shown = [round(value, places), round(error, places)]
    texts = [f"{v:.{max(places, 0)}f}".replace("-", "−") for v in shown]
    return f"{texts[0]}{NARROW}±{NARROW}{texts[1]}"


def shown_in(unit: str, size: float) -> list[tuple[float, str]]:
    """(factor, unit) that a value of some size is shown in, and what is said beside it.

    ``unit``: a key of `SHOWN`, others are shown as they are.
    """
    choices, beside = SHOWN.get(unit, (((1.0, unit),), None))
    large = [choice for choice in choices if choice[0] * size >= 0.0999]
    return [large[0] if large else choices[-1], *([beside] if beside else [])]


def with_units(texts, parts) -> str:
    """'10.0 mrad/s (0.573 deg/s)': numbers as text with the units of `shown_in`."""
    both = [f"{t}{NARROW}{name}" if name else t for t, (_, name) in zip(texts, parts, strict=True)]
    return both[0] if len(both) == 1 else f"{both[0]} ({both[1]})"


def quantity(value: float, error: float | None, unit: str, size: float | None = None) -> str:
    """A value in SI with its error as a page shows it, degrees beside radians.

    ``size``: what chooses the prefix, the value itself if None.
    """
    parts = shown_in(unit, abs(value) if size is None else size)
    texts = [plus_minus(f * value, None if error is None else f * abs(error)) for f, _ in parts]
    return with_units(texts, parts)


def span(low: float, high: float, unit: str) -> str:
    """'1.02 to 1.07 mrad/s (0.0586 to 0.0612 deg/s)'; one value where both read alike."""
    parts = shown_in(unit, max(abs(low), abs(high)))
    ends = [[number(factor * end) for end in (low, high)] for factor, _ in parts]
    return with_units([" to ".join(dict.fromkeys(both)) for both in ends], parts)


def ratio(value: float) -> str:
    """Two decimals where it is near one, so that 1.00 is seen to be no round number."""
    return f"{value:.2f}" if 0.1 <= value < 10 else number(value)


def symbols(text: str) -> str:
    """Greek letters and true minus signs for what files spell out."""
    for plain, symbol in (
        ("omega double dot", "d²ω/dt²"), ("omega dot", "dω/dt"), ("omega_dot", "dω/dt"),
        ("omega", "ω"), ("tau", "τ"), ("phi", "φ"), (" -", " −"),
    ):  # fmt: skip
        text = text.replace(plain, symbol)
    return text


def probability(log10_p: float) -> str:
    """'0.012', a power of ten, or '< 10⁻⁶': no law of chance is known farther out."""
    if log10_p > -4:
        return number(10.0**log10_p, 2)
    return power_of_ten(math.ceil(log10_p)) if log10_p > -6 else f"<{NARROW}{power_of_ten(-6)}"


def joined(items) -> str:
    """'a', 'a and b', 'a, b and c'."""
    items = [str(item) for item in items]
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)


def first_up(text: str) -> str:
    """With a capital."""
    return text[:1].upper() + text[1:]


def fixed(value: float, decimals: int) -> str:
    """A number whose column lines up; zero has no sign."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}".replace("-", "−")


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
    """`plain`, with an effect's own meaning where there are no plainer words."""
    return plain(effect, sizes) or [f"{known_effect(effect).meaning or effect.replace('_', ' ')}"]


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


def _read(labels, ages, sds) -> list[str]:
    """Words on IMUs that are read late, by their ages (K,) s at the stamps."""
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
