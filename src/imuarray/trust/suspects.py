"""Sensors whose readings do not go with those of the others, and what would make them go.

All triads of a rigid array see the same motion: the gyroscopes the same rate, each accelerometer
what the others say of its place. A triad that is far off is turned, delayed or scaled to fit; what
takes most of its error away is named.
"""

from itertools import product

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from imuarray.recording import Recording
from imuarray.recording.record import KINDS, few
from imuarray.recording.units import GRAVITY
from imuarray.trust.drawing import DEGREE, angle_words
from imuarray.trust.rigid import runs, slope, turning
from imuarray.trust.settings import SETTINGS

LAGS = range(-3, 4)  # samples


def suspects(recording: Recording) -> list[str]:
    """The triads that are off, in words; none where all agree, or where half of them do not.

    A whole IMU where both its triads do the same. ``recording`` without still poses and readings
    at a rail.
    """
    words: dict[tuple[str, str], list[str]] = {}
    for kind in KINDS:
        for found in _search(recording, kind):
            words.setdefault(found, []).append(kind)
    return [
        f"{'IMU' if len(kinds) == 2 else kinds[0]} {label} {said or 'does not fit the others'}"
        for (label, said), kinds in words.items()
    ]


def _search(recording: Recording, kind: str) -> list[tuple[str, str]]:
    """Labels, and what would make the triads agree with the others (empty if nothing known does).

    One after the other: the worst is named and left out, until the rest agree.
    """
    readings, places = getattr(recording, KINDS[kind]), recording.relative_positions()
    force, rate = recording.specific_force, np.median(recording.angular_rate, axis=1)
    labels, sd = getattr(recording, f"{kind}_labels"), getattr(recording, f"{kind}_noise_sd")
    turns = kind == "gyroscope"
    rise = turning(force, rate, places).acceleration if turns else None
    chain, count = runs(recording.time), readings.shape[1]

    def others(left):
        """Readings of each triad by the others that are left (T, K, 3)."""
        parts = [np.setdiff1d(left, [k]) for k in range(count)]
        return np.stack([
            np.median(readings[:, part], axis=1) if turns
            else turning(force[:, part], rate, places[part]).at(places[k : k + 1])[:, 0]
            for k, part in enumerate(parts)
        ], axis=1)  # fmt: skip

    left = np.arange(count)
    found: list[tuple[str, str]] = []
    while len(left) > max(2, count / 2):
        expected = others(left)
        error = np.sqrt(np.mean((readings - expected) ** 2, axis=(0, 2)))
        worst = left[np.argmax(error[left])]
        rest = np.setdiff1d(left, [worst])
        without = np.sqrt(np.mean((readings - others(rest)) ** 2, axis=(0, 2)))[rest]
        if error[worst] < SETTINGS.far_triad * max(np.median(without), sd):
            return found
        words = explain(readings[:, worst], expected[:, worst], chain, rise)
        found.append((labels[worst], words))
        left = rest
    return [] if len(found) == count - 2 else found


def explain(readings, expected, chain, rise=None) -> str:
    """A change that makes ``readings`` (T, 3) of ``expected`` ones, in words; empty if none does.

    ``chain``: first indices of four samples in a row; ``rise`` (T, 3): the expected ones' change
    per second, where it is known without neighbours.
    """
    before = np.sqrt(np.mean((readings - expected) ** 2))
    rotation, _ = Rotation.align_vectors(readings, expected)
    factor = np.sum(readings * expected) / np.sum(expected**2)
    offset = (readings - expected).mean(axis=0)
    # one axis of the wrong sign is no rotation; a rotation by 90 degrees is both
    turned = 0.999 * _rms(readings - rotation.apply(expected))
    tries = [
        _axes(readings, expected), (turned, f"is turned by {angle_words(rotation)}"),
        (_rms(readings - factor * expected), f"reads {factor:.4g} times what it should"),
        (_rms(readings - expected - offset), f"is off by a constant {_rms(offset):.3g}"),
    ]  # fmt: skip
    # four samples on either side
    middle = chain[np.isin(chain - 4, chain) & np.isin(chain + 1, chain)]
    if len(middle) > SETTINGS.fewest_pairs:
        tries.append(_late(readings, expected, middle))
    if rise is not None:
        seconds = -np.sum((readings - expected) * rise) / max(np.sum(rise**2), 1e-300)
        said = f"is {1e3 * abs(seconds):.2g} ms {'late' if seconds > 0 else 'early'}"
        tries.append((_rms(readings - expected + seconds * rise), said))
    left, words = min(tries)
    return words if left < SETTINGS.suspect_left * before else ""


def _rms(values) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _axes(readings, expected) -> tuple[float, str]:
    """Axes with the wrong sign or name."""
    cross = readings.T @ expected
    cross /= np.linalg.norm(readings, axis=0)[:, None] * np.linalg.norm(expected, axis=0) + 1e-300
    order = linear_sum_assignment(-np.abs(cross))[1]
    signs = np.sign(cross[range(3), order])
    left = _rms(readings - expected[:, order] * signs)
    if (order == range(3)).all():
        wrong = [name for name, sign in zip("xyz", signs, strict=True) if sign < 0]
        return (left, f"has {_axes_named(wrong)} of the wrong sign") if wrong else (np.inf, "")
    names = [f"{'-' if s < 0 else ''}{'xyz'[k]}" for k, s in zip(order, signs, strict=True)]
    return left, f"reads {', '.join(names)} in place of x, y, z"


def _late(readings, expected, middle) -> tuple[float, str]:
    """A delay of whole samples, refined by the slope between neighbours."""
    best = (np.inf, "")
    for lag in LAGS:
        then = middle - lag
        rise = (expected[then + 1] - expected[then - 1]) / 2
        off = readings[middle] - expected[then]
        part = -np.sum(off * rise) / max(np.sum(rise**2), 1e-300)
        samples = lag + part
        if abs(part) > 0.6 or abs(samples) < SETTINGS.least_lag:
            continue
        size, word = round(abs(samples), 1), "late" if samples > 0 else "early"
        said = f"is {size:g} sample{'' if size == 1 else 's'} {word}"
        best = min(best, (_rms(off + part * rise), said))
    return best


MIRRORED = (
    "the gyroscopes turn the other way round than the accelerometers: left-handed axes (one axis of"
    " both kinds flipped), or all rates of the wrong sign"
)
WRONG_SIGN = (
    "specific force of the wrong sign (gravity's instead of minus gravity's), or a flat board's"
    " axes turned by 180 degrees"
)
FACTORS = (  # of time, force, rates, positions, to undo a mistake
    ((1, 1, DEGREE, 1), "all rates are 57.3 times too small: in rad/s declared deg/s"),
    ((1, 1, 1 / DEGREE, 1), "all rates are 57.3 times too large: in deg/s declared rad/s"),
    ((1, GRAVITY, 1, 1), "specific force is 9.81 times too small: in g declared m/s^2"),
    ((1, 1, 1, 1e-3), "nominal positions are 1000 times too large: in mm declared m"),
    ((1, 1, 1, 1e3), "nominal positions are 1000 times too small: in m declared mm"),
    ((1, -1, 1, 1), WRONG_SIGN),
    ((1e-3, 1, 1, 1), "time is 1000 times too long: in ms declared s"),
)
SIGNS = [np.array(signs) for signs in product((1, -1), repeat=3)][1:]


def common(recording: Recording) -> str:
    """A mistake in all sensors alike, or "": both kinds turn alike only once it is undone."""
    rate = np.median(recording.angular_rate, axis=1)

    def misfit(time, force, rates, places) -> float:
        motion = turning(
            force * recording.specific_force, rate * rates, places * recording.relative_positions()
        )
        found = slope(time * recording.time, motion)
        if found is None or found.correlation < SETTINGS.coherent:
            return np.inf
        return max(abs(found.low - 1), abs(found.high - 1)) - found.coarse

    if misfit(1, 1, 1, 1) < SETTINGS.slope_within:
        return ""
    tried = [(misfit(*factors), words) for factors, words in FACTORS]
    tried += [(misfit(1, 1, signs, 1), _wrong_signs(signs)) for signs in SIGNS]
    least, words = min(tried)
    return f"{words}?" if least < SETTINGS.slope_within else ""


def _wrong_signs(signs) -> str:
    """Words on all gyroscopes' axes against the accelerometers'."""
    wrong, right = (
        [name for name, s in zip("xyz", signs, strict=True) if s == which] for which in (-1, 1)
    )
    if not right:
        return MIRRORED
    said = f"all gyroscopes have {_axes_named(wrong)} of the wrong sign"
    if len(wrong) == 2:  # a turn by half apart, the same as
        said += f", or all accelerometers {_axes_named(right)}"
    return said


def _axes_named(names) -> str:
    return f"{'axis' if len(names) == 1 else 'axes'} {' and '.join(names)}"


def gravity(recording: Recording) -> list[str]:
    """Still poses that do not show gravity: a unit."""
    still = recording.still()
    if not still.any():
        return []
    force = recording.specific_force[few(np.flatnonzero(still))]
    size = float(np.median(np.linalg.norm(force, axis=2)))
    if abs(size / GRAVITY - 1) < SETTINGS.gravity_within:
        return []
    unit = ": in g declared m/s^2?" if abs(size - 1) < SETTINGS.gravity_within else ""
    return [f"specific force in the still poses is {size:.4g} m/s^2, gravity {GRAVITY:.4g}{unit}"]


def clipped(recording: Recording) -> list[str]:
    """A sentence for each channel that ends abruptly within its declared range."""
    found = []
    for kind in KINDS:
        values = _as_read(recording, kind)
        for k, axis in np.ndindex(values.shape[1:]):
            rails = ends(values[:, k, axis])
            if rails:
                label = getattr(recording, f"{kind}_labels")[k]
                found.append(f"{kind} {label}, axis {'xyz'[axis]}, is clipped at"
                             f" {' and '.join(f'{end:.4g}' for end in rails)}, within its declared"
                             " range")  # fmt: skip
    return found


def wrapped(recording: Recording) -> list[str]:
    """A sentence if gyroscopes' axes jump from one end of their readings to the other."""
    step, rates = np.diff(recording.time), _as_read(recording, "gyroscope")
    near = step < 1.5 * np.median(step) if len(step) else step > 0
    jump, end = np.abs(np.diff(rates, axis=0)), np.abs(rates).max(axis=0)
    around = np.pad(jump, ((1, 1), (0, 0), (0, 0)))
    alone = np.maximum(around[:-2], around[2:]) < (2 - SETTINGS.wrap_jump) * end
    wrap = near[:, None, None] & (jump > SETTINGS.wrap_jump * end) & alone
    wraps = np.sum(wrap, axis=0) >= SETTINGS.least_wraps
    if not wraps.any():
        return []
    labels = zip(recording.gyroscope_labels, wraps, strict=True)
    named = [f"{label} ({'xyz'[axis]})" for label, own in labels for axis in np.flatnonzero(own)]
    return [
        f"gyroscopes jump from one end of their readings to the other: {', '.join(named)}; they"
        f" wrap at {np.degrees(end[wraps].max()):.4g} deg/s, beyond their range"
    ]


def _as_read(recording: Recording, kind: str) -> np.ndarray:
    """Readings (T, K, 3) before first order corrected them: a rail is one value there only."""
    values = getattr(recording, KINDS[kind])
    if recording.correction is None:
        return values
    inverse, offset = (recording.correction[f"{kind}_{name}"] for name in ("inverse", "offset"))
    raw = np.einsum("kij,tkj->tki", np.linalg.inv(inverse), values) + offset.to_numpy()
    return np.round(raw, SETTINGS.decimals)


def ends(channel) -> list[float]:
    """Extreme values at which far more readings are than at the values next to them."""
    values, counts = np.unique(channel, return_counts=True)
    if len(values) < 4 * SETTINGS.end_ratio:
        return []
    looked_at = SETTINGS.end_ratio + 1
    sides = (values[0], counts[:looked_at]), (values[-1], counts[::-1][:looked_at])
    least = SETTINGS.end_readings
    return [
        float(end)
        for end, near in sides if near[0] >= max(least, SETTINGS.end_ratio * near[1:].max())
    ]  # fmt: skip
