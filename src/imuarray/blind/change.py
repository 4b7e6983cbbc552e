"""What an effect does to the readings, and how several effects compose.

The order is that of the hardware: the instants at which the sensors sample, the errors of the
sensors (computed from the true quantities, and added up), the axes' labels, the noise, the rails,
and last what happens to the finished readings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from imuarray.blind.scene import Field, Pair, Scene

NOTHING = Pair(None, None)
UNIT_FORCE, UNIT_RATE = "m s-2", "rad s-1"


class Parameter(NamedTuple):
    """A drawn number, or array with a row for each affected sensor, and its unit."""

    value: Any
    unit: str


@dataclass(frozen=True)
class Change:
    """One effect with its parameters drawn.

    Attributes
    ----------
    effect : str
    sensors : tuple of int
        Affected IMUs, n of them.
    size : float
        The scalar amplitude, in the effect's own unit.
    parameters : dict of str to Parameter
    ages : Pair of (T, A) and (T, G) seconds, or None
        Added to the host's instants.
    force_error, rate_error : callable or None
        From a `Field` to what is added to the true readings of the affected sensors; broadcasts to
        (T, n, 3).
    relabel : callable or None
        From the erroneous noiseless readings, a Pair, to those under other axes.
    gain : Pair of arrays that broadcast to (T, A) and (T, G), or None
        Factors of the noise.
    correlation : Pair of (A,) and (G,), or None
        AR(1) coefficients of the noise.
    after : callable or None
        From noisy, clipped readings, a Pair, to the recorded ones.
    """

    effect: str
    sensors: tuple[int, ...]
    size: float
    parameters: dict[str, Parameter] = field(default_factory=dict)
    ages: Pair = NOTHING
    force_error: Callable[[Field], np.ndarray] | None = None
    rate_error: Callable[[Field], np.ndarray] | None = None
    relabel: Callable[[Pair], Pair] | None = None
    gain: Pair = NOTHING
    correlation: Pair = NOTHING
    after: Callable[[Pair], Pair] | None = None


@dataclass(frozen=True)
class Effect:
    """An entry of the registry.

    Attributes
    ----------
    draw : callable (scene, rng, sensors, size) -> Change
    unit : str
        Of the amplitude ``size``.
    low, high : float
        Realistic amplitudes; drawn log-uniformly between them.
    limit : float
        The amplitude stays below.
    scalable : bool
        Whether the amplitude can be set to reach a wanted size in sigma.
    """

    draw: Callable[..., Change]
    unit: str
    low: float
    high: float
    limit: float
    scalable: bool

    def realistic(self, rng) -> float:
        """An amplitude of the catalogue's column, in `unit`."""
        return float(self.low * (self.high / self.low) ** rng.random())


EFFECTS: dict[str, Effect] = {}


def effect(unit: str, low: float, high: float, limit: float = np.inf, scalable: bool = True):
    """Register a function under its own name; it returns the keyword arguments of a Change."""

    def register(function):
        def draw(scene, rng, sensors: Sequence[int], size: float) -> Change:
            known = range(scene.accelerometers)
            chosen = tuple(int(k) for k in sensors)
            if not chosen or any(k not in known for k in chosen) or len({*chosen}) < len(chosen):
                raise ValueError(
                    f"sensors: expected different indices below {len(known)}, found {sensors}"
                )
            parts = function(scene, rng, chosen, float(size))
            chosen = parts.pop("sensors", chosen)
            return Change(function.__name__, chosen, float(size), **parts)

        draw.__doc__, draw.__name__ = function.__doc__, function.__name__
        EFFECTS[function.__name__] = Effect(draw, unit, low, high, limit, scalable)
        return draw

    return register


def spread(scene: Scene, sensors, values: np.ndarray, rest: float = 0.0) -> np.ndarray:
    """Put (T, n) or (n,) values of some sensors among ``rest`` for the others, (T, A)."""
    whole = np.full((len(scene.time), scene.accelerometers), rest)
    whole[:, list(sensors)] = values
    return whole


def which_kinds(rng) -> tuple[bool, bool]:
    """Whether accelerometers, gyroscopes or both are affected, a third of the time each."""
    return [(True, False), (False, True), (True, True)][rng.integers(3)]


def kind_names(kinds: tuple[bool, bool]) -> Parameter:
    """The affected kinds of sensors by name."""
    known = zip(("accelerometer", "gyroscope"), kinds, strict=True)
    return Parameter([name for name, chosen in known if chosen], "1")


def entries(rng, sensors, size, *shape) -> np.ndarray:
    """Normal entries, (n, *shape), three to a sensor if nothing is said, of sd ``size``."""
    return size * rng.standard_normal((len(sensors), *(shape or (3,))))


def applied(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) times vectors (T, n, 3)."""
    return np.einsum("kij,tkj->tki", matrices, vectors)


def mean_readings(scene: Scene, changes: Sequence[Change]) -> Pair:
    """Readings with the effects but without noise and rails, (T, A, 3) and (T, G, 3)."""
    known = scene.field(_total_ages(changes))
    force, rate = np.array(known.force), np.array(known.rate)
    for change in changes:
        chosen = list(change.sensors)
        if change.force_error is not None:
            force[:, chosen] += change.force_error(known)
        if change.rate_error is not None:
            rate[:, chosen] += change.rate_error(known)
    readings = Pair(force, rate)
    for change in changes:
        if change.relabel is not None:
            readings = change.relabel(readings)
    return readings


def _total_ages(changes: Sequence[Change]) -> Pair:
    """Ages of all effects together; the same object twice if both sensors share them."""
    if all(change.ages.force is change.ages.rate for change in changes):
        total = _added([change.ages.force for change in changes])
        return Pair(total, total)
    return Pair(*(_added(ages) for ages in zip(*(c.ages for c in changes), strict=True)))


def _added(parts):
    known = [part for part in parts if part is not None]
    return sum(known) if known else None


def draw_noise(scene: Scene, changes: Sequence[Change], rng) -> Pair:
    """Noise of the declared size, changed by the effects, (T, A, 3) and (T, G, 3).

    The underlying draws do not depend on the effects: the same rng gives the same clean noise.
    """
    shape = (len(scene.time), scene.accelerometers, 3)
    found = []
    for kind, sd in enumerate(scene.noise):
        noise = sd * rng.standard_normal(shape)
        for change in changes:
            if change.correlation[kind] is not None:
                noise = _coloured(noise, change.correlation[kind])
            if change.gain[kind] is not None:
                noise = noise * np.asarray(change.gain[kind])[..., None]
        found.append(noise)
    return Pair(*found)


def _coloured(noise: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """AR(1) noise of the same sd from white noise (T, K, 3), coefficients (K,)."""
    from scipy.signal import lfilter  # slow to import, and every run of Snakemake imports this

    noise = noise.copy()
    for k in np.flatnonzero(coefficients):
        rho = coefficients[k]
        scaled = noise[:, k] * np.sqrt(1 - rho**2)
        # stationary from the first sample on
        scaled[0] = noise[0, k]
        noise[:, k] = lfilter([1.0], [1.0, -rho], scaled, axis=0)
    return noise


def finish(scene: Scene, changes: Sequence[Change], readings: Pair) -> Pair:
    """Clip at the declared ranges, then saturate, quantise and, last, repeat former readings."""
    readings = Pair(*(np.clip(x, -m, m) for x, m in zip(readings, scene.limits, strict=True)))
    for change in sorted(changes, key=lambda change: change.effect == "stale_samples"):
        if change.after is not None:
            readings = change.after(readings)
    return readings


def noisy_readings(scene: Scene, changes: Sequence[Change], rng) -> Pair:
    """What the host records, (T, A, 3) m/s^2 and (T, G, 3) rad/s."""
    mean, noise = mean_readings(scene, changes), draw_noise(scene, changes, rng)
    return finish(scene, changes, Pair(mean.force + noise.force, mean.rate + noise.rate))


def noiseless_readings(scene: Scene, changes: Sequence[Change]) -> Pair:
    """What would be recorded without noise; its difference to no changes is the mean effect."""
    return finish(scene, changes, mean_readings(scene, changes))
