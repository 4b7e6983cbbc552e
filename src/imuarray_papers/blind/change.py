"""Changes that an effect makes in the readings, and how several effects compose.

The order is that of the hardware: the instants at which the sensors sample, the errors of the
sensors (computed from the true quantities, and added up), the axes' labels, the noise, the rails,
and last what happens to the finished readings.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from imuarray_papers.blind.scene import Field, Pair, Scene

NOTHING = Pair(None, None)
UNITS = UNIT_FORCE, UNIT_RATE = "m s-2", "rad s-1"


class Parameter(NamedTuple):
    """A drawn number, or array with a row for each affected sensor, and its unit."""

    value: Any
    unit: str = "1"


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
    stale : bool
        Whether ``after`` moves readings in time: it comes after all others, and moves flags too.
    divergence : callable or None
        From a number of samples to the KL divergence in nats, for an effect on the noise.
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
    stale: bool = False
    divergence: Callable[[int], float] | None = None

    def described(self) -> dict:
        """Id, amplitude and parameters in plain numbers, texts and lists, with their units."""
        drawn = {"amplitude": Parameter(self.size, EFFECTS[self.effect].unit), **self.parameters}
        plain = {
            name: {"value": np.asarray(value).tolist(), "unit": unit}
            for name, (value, unit) in drawn.items()
        }
        return {"effect": self.effect, "amplitude": plain.pop("amplitude"), "parameters": plain}


@dataclass(frozen=True)
class Effect:
    """An entry of the registry.

    Attributes
    ----------
    name : str
    parts : callable (scene, rng, sensors, size) -> dict
        Keyword arguments of a `Change`; ``sensors`` among them where fewer than were asked for are
        affected.
    unit : str
        Of the amplitude ``size``.
    low, high : float
        Realistic amplitudes; drawn log-uniformly between them.
    limit : float
        The amplitude stays below.
    scalable : bool
        Whether the amplitude can be set to reach a wanted size in sigma.
    from_readings : bool
        Whether readings suffice to inject it, without the true motion (or, of coloured noise,
        without the noise apart from what it is added to).
    everywhere : bool
        Whether it is on all IMUs, whatever sensors are asked for.
    """

    name: str
    parts: Callable[..., dict]
    unit: str
    low: float
    high: float
    limit: float = np.inf
    scalable: bool = True
    from_readings: bool = True
    everywhere: bool = False

    def draw(self, scene, rng, sensors: Sequence[int], size: float) -> Change:
        """Draw the effect on some IMUs at one amplitude.

        Raises ValueError for sensors that are not different indices.
        """
        known = range(scene.accelerometers)
        chosen = tuple(int(k) for k in sensors)
        if not chosen or any(k not in known for k in chosen) or len({*chosen}) < len(chosen):
            raise ValueError(
                f"sensors: expected different indices below {len(known)}, found {sensors}"
            )
        chosen = tuple(known) if self.everywhere else chosen
        parts = self.parts(scene, rng, chosen, float(size))
        return Change(self.name, **{"sensors": chosen, "size": float(size)} | parts)

    def realistic(self, rng) -> float:
        """An amplitude of the catalogue's column, in `unit`."""
        return float(self.low * (self.high / self.low) ** rng.random())


EFFECTS: dict[str, Effect] = {}


def effect(unit: str, low: float, high: float, **entry):
    """Register a function, the ``parts`` of an `Effect`, under its own name."""

    def register(parts):
        EFFECTS[parts.__name__] = Effect(parts.__name__, parts, unit, low, high, **entry)
        return parts

    return register


def entries(rng, sensors, size) -> np.ndarray:
    """Normal entries of sd ``size``, (n, 3)."""
    return size * rng.standard_normal((len(sensors), 3))


def error_of(
    name: str, kind: str, parameter: str, unit: str, low: float, high: float, error: Callable,
    draw: Callable = entries, **entry,
) -> None:  # fmt: skip
    """Register an error of the readings that one parameter gives.

    ``error`` gives what is added, (T, n, 3) after broadcasting, from the parameter's value and the
    `Field` at the affected sensors; ``kind`` is "force" or "rate"; ``draw`` (rng, sensors, size)
    draws the value. The unit is the parameter's and the amplitude's.
    """

    def parts(scene, rng, sensors, size):
        value = draw(rng, sensors, size)
        return {
            "parameters": {parameter: Parameter(value, unit)},
            f"{kind}_error": lambda field: error(value, field.of(sensors)),
        }

    EFFECTS[name] = Effect(name, parts, unit, low, high, **entry)


def spread(scene: Scene, sensors, values: np.ndarray, rest: float = 0.0) -> np.ndarray:
    """Put (T, n) or (n,) values of some sensors among ``rest`` for the others, (T, A)."""
    whole = np.full((len(scene.time), scene.accelerometers), rest)
    whole[:, list(sensors)] = values
    return whole


def which_kinds(rng) -> tuple[bool, bool]:
    """(accelerometers, gyroscopes) affected: one or both, a third of the time each."""
    return [(True, False), (False, True), (True, True)][rng.integers(3)]


def kind_names(kinds: tuple[bool, bool]) -> Parameter:
    """The affected kinds of sensors by name."""
    known = zip(("accelerometer", "gyroscope"), kinds, strict=True)
    return Parameter([name for name, chosen in known if chosen])


def of_kinds(kinds: tuple[bool, bool], value) -> Pair:
    """The value for the affected kinds of sensors, None for the other."""
    return Pair(*(value if chosen else None for chosen in kinds))


def altered(sensors, rules: Pair) -> Callable[[Pair], Pair]:
    """A change of finished readings: each rule is from some sensors' (T, n, 3) to others.

    A rule of None leaves its kind of sensors as it is.
    """
    chosen = list(sensors)

    def change(readings: Pair) -> Pair:
        found = [values.copy() for values in readings]
        for values, rule in zip(found, rules, strict=True):
            if rule is not None:
                values[:, chosen] = rule(values[:, chosen])
        return Pair(*found)

    return change


def mean_readings(scene: Scene, changes: Sequence[Change]) -> Pair:
    """Readings with the effects but without noise and rails, (T, A, 3) and (T, G, 3)."""
    readings = with_errors(scene.field(_total_ages(changes)), changes)
    for change in changes:
        if change.relabel is not None:
            readings = change.relabel(readings)
    return readings


def with_errors(field: Field, changes: Sequence[Change]) -> Pair:
    """The true readings of a field with the sensors' errors added up, (T, A, 3) and (T, G, 3)."""
    readings = Pair(np.array(field.force), np.array(field.rate))
    for change in changes:
        for values, error in zip(readings, (change.force_error, change.rate_error), strict=True):
            if error is not None:
                values[:, list(change.sensors)] += error(field)
    return readings


def _total_ages(changes: Sequence[Change]) -> Pair:
    """Ages of all effects together."""
    kinds = zip(NOTHING, *(change.ages for change in changes), strict=True)
    known = ([ages for ages in parts if ages is not None] for parts in kinds)
    return Pair(*(sum(parts) if parts else None for parts in known))


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
    for change in sorted(changes, key=lambda change: change.stale):
        if change.after is not None:
            readings = change.after(readings)
    return readings


def noisy_readings(scene: Scene, changes: Sequence[Change], rng) -> Pair:
    """Readings as the host records them, (T, A, 3) m/s^2 and (T, G, 3) rad/s."""
    mean, noise = mean_readings(scene, changes), draw_noise(scene, changes, rng)
    return finish(scene, changes, Pair(mean.force + noise.force, mean.rate + noise.rate))


def noiseless_readings(scene: Scene, changes: Sequence[Change]) -> Pair:
    """Readings without noise; their difference to no changes is the mean effect."""
    return finish(scene, changes, mean_readings(scene, changes))
