"""An effect added to a measured recording, from its readings alone, and is it found?"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from imuarray.recording import Recording
from imuarray.streams import stream
from imuarray_papers.blind.change import Change, with_errors
from imuarray_papers.blind.inject import EFFECTS
from imuarray_papers.blind.scene import Field, Pair
from imuarray_papers.blind.study import classes

NOT_FROM_READINGS = tuple(name for name, entry in EFFECTS.items() if not entry.from_readings)
# Of which `diagnosis.json` has sizes that are the drawn parameters' own; a drift's are others.
SHOWN = [n for n in EFFECTS if n not in (*NOT_FROM_READINGS, "bias_drift") and EFFECTS[n].scalable]


class MeasuredScene:
    """A recording in the place of a `Scene`: its readings stand for the true quantities.

    Attributes
    ----------
    readings : Pair of (T, A, 3) m/s^2 and (T, G, 3) rad/s
    time : ndarray (T,), seconds
    noise, limits : tuple of two floats
        Declared noise and ranges of accelerometers (m/s^2) and gyroscopes (rad/s).
    duration : float, seconds from the first sample to the last
    sampling_rate : float, Hz, of the usual step
    accelerometers : int, number of IMUs
    """

    measured = True  # noise can be added, not taken away

    def __init__(self, recording: Recording):
        self.readings = Pair(recording.specific_force, recording.angular_rate)
        self.time = recording.time
        self.noise = recording.accelerometer_noise_sd, recording.gyroscope_noise_sd
        self.limits = recording.accelerometer_range, recording.gyroscope_range
        self.duration = float(self.time[-1] - self.time[0])
        self.sampling_rate = float(1 / np.median(np.diff(self.time)))
        self.accelerometers = self.readings.force.shape[1]

    def ideal(self) -> Pair:
        """The readings as they are."""
        return self.readings

    def field(self, ages: Pair) -> Field:
        """Readings ``ages`` (T, A) and (T, G) s later, or None, by a cubic spline.

        A spline carries noise along: what it gives between samples is a little less noisy.
        """
        force, rate = self.readings
        wanted = (force, ages.force), (rate, ages.rate), (force, ages.rate)
        return Field(*(self._at(*each) for each in wanted), states=None)

    def _at(self, values: np.ndarray, ages: np.ndarray | None) -> np.ndarray:
        if ages is None:
            return values
        moved, time = np.array(values), self.time
        for k in np.flatnonzero(ages.any(axis=0)):
            # beyond the ends a cubic runs away
            instants = np.clip(time + ages[:, k], time[0], time[-1])
            moved[:, k] = CubicSpline(time, values[:, k])(instants)
        return moved


def measured_change(
    recording: Recording, effect: str, sensors, amplitude: float, seed: int
) -> Change:
    """The change that `inject_measured` applies, with the parameters it draws.

    Raises ValueError for an effect that can not be made from readings alone, for unlike numbers
    of accelerometers and gyroscopes, or for sensors that are not different indices.
    """
    if effect not in EFFECTS or effect in NOT_FROM_READINGS:
        known = ", ".join(name for name in EFFECTS if name not in NOT_FROM_READINGS)
        raise ValueError(f"effect: expected one that readings suffice for ({known}): {effect!r}")
    if recording.specific_force.shape != recording.angular_rate.shape:
        raise ValueError(
            "recording: expected a gyroscope for each accelerometer, found "
            f"{recording.angular_rate.shape[1]} and {recording.specific_force.shape[1]}"
        )
    rng = stream(seed, "blind", "measured", effect)
    return EFFECTS[effect].draw(MeasuredScene(recording), rng, sensors, amplitude)


def inject_measured(
    recording: Recording, effect: str, sensors, amplitude: float, seed: int
) -> Recording:
    """The recording with an effect on some IMUs (indices), of an amplitude in the effect's unit.

    Readings take the place of the true quantities, delays come from a cubic spline through them,
    noise is added to what there is. A reading at a rail stays there. Errors as in
    `measured_change`.
    """
    change = measured_change(recording, effect, sensors, amplitude, seed)
    scene = MeasuredScene(recording)
    readings = _with_noise(scene, change, with_errors(scene.field(change.ages), [change]), seed)
    flags = Pair(recording.saturated_accelerometers(), recording.saturated_gyroscopes())
    found = [
        _within_rails(*parts)
        for parts in zip(readings, scene.ideal(), flags, scene.limits, strict=True)
    ]
    readings, flags = (Pair(*parts) for parts in zip(*found, strict=True))
    for step in (change.relabel, change.after):
        readings = step(readings) if step else readings
    # where readings move, so do their flags
    moving = change.after if change.stale else change.relabel
    if moving:
        flags = Pair(*(np.abs(x) > 0.5 for x in moving(Pair(*(f.astype(float) for f in flags)))))
    names = ("specific_force_saturated", "angular_rate_saturated")
    # flags only where there were some
    kept = {name: flag for name, flag in zip(names, flags, strict=True)
            if getattr(recording, name) is not None}  # fmt: skip
    return replace(recording, specific_force=readings.force, angular_rate=readings.rate, **kept)


def _with_noise(scene: MeasuredScene, change: Change, readings: Pair, seed: int) -> Pair:
    """Add what is missing to noise of ``gain`` times the declared sd."""
    rng = stream(seed, "blind", "measured", change.effect, "noise")
    found = []
    for values, gain, sd in zip(readings, change.gain, scene.noise, strict=True):
        if gain is not None:
            missing = sd * np.sqrt(np.maximum(gain**2 - 1, 0.0))
            values = values + missing[..., None] * rng.standard_normal(values.shape)
        found.append(values)
    return Pair(*found)


def _within_rails(new, old, at_rail, limit) -> tuple[np.ndarray, np.ndarray]:
    """Readings that stay at the rail where they were or where they would pass it; and where."""
    moved = ~at_rail & (new != old)
    passing = moved & (np.abs(new) >= limit)
    return np.where(moved, np.clip(new, -limit, limit), old), at_rail | passing


def hide(
    recording: Recording, document: dict, seed: int, times: float = 2.0, effects=EFFECTS
) -> tuple[Recording, dict]:
    """The recording with an effect on one IMU, drawn from ``seed``, and the truth as plain JSON.

    ``document``: the recording's own `diagnosis.json`. Any of ``effects`` that readings suffice
    for, that it does not have already and that it would show; ``times`` as large as it must be.
    """
    there = set().union(*classes(document["causes"]).values())
    known = {
        name: entry for name, entry in document["detectable"].items()
        if name in effects and name in SHOWN and name not in there
    }  # fmt: skip
    rng = stream(seed, "blind", "hidden", "measured")
    effect = str(rng.choice(sorted(known)))
    label = str(rng.choice(sorted(k for k, own in known[effect]["sizes"].items() if own)))
    given = recording, effect, (recording.accelerometer_labels.index(label),)
    drawn = next(iter(measured_change(*given, 1.0, seed).parameters.values()))
    size = times / in_least(drawn.value, known[effect]["sizes"][label])
    change = measured_change(*given, size, seed)
    truth = {"effect": effect, "sensors": [label], "times": times, **change.described()}
    return inject_measured(*given, size, seed), {"effects": [truth]}


def in_least(drawn, sizes: dict[str, float]) -> float:
    """Root sum of squares of an IMU's ``drawn`` (1, ...) parameters in the least that show.

    Those without a size show in nothing.
    """
    [values] = np.asarray(drawn, float)
    if not values.ndim:
        return abs(float(values)) / next(iter(sizes.values()))
    names = ["".join("xyz"[axis] for axis in place) for place in np.ndindex(values.shape)]
    shown = [x / sizes[name] for name, x in zip(names, values.ravel(), strict=True)
             if name in sizes]  # fmt: skip
    return float(np.linalg.norm(shown))
