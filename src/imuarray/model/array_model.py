"""The array's measurement model: geometry, noise and a list of effects; its derivatives by them."""

from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Self

import numpy as np

from imuarray.errors import require
from imuarray.geometry import Array
from imuarray.model import kinematics
from imuarray.model.effects import EFFECTS, Effect, Instant, Prediction, find_effects, known_effect
from imuarray.model.jax64 import jax, jnp
from imuarray.model.noise import Noise
from imuarray.model.probe import probe
from imuarray.motion.state import Motion

AXES = "xyz"
OFF_DIAGONAL = ("xy", "xz", "yx", "yz", "zx", "zy")


@cache  # once each
def probed(item: Effect) -> bool:
    """`probe`, which the package's own effects have passed in its tests."""
    return item.apply.__module__.startswith("imuarray.") or probe(item)


@dataclass(frozen=True)
class ArrayModel:
    """y = predict(motion, positions, effect parameters) + noise (paper 2021, eq. 4 and 5).

    Attributes
    ----------
    array : Array
    noise : Noise
    effects : tuple of str
        Ids from `imuarray.model.EFFECTS`; empty is the papers' model. They are applied in this
        order, but first those that say when and where a triad samples.
    derivative_sd : (float, float)
        Prior sd of omega double dot (rad/s^3) and s dot (m/s^3), used only where an effect
        needs them; the defaults are the papers' motion at 5 Hz.
    motion_sd : (float, float, float)
        Prior sd of omega (rad/s), omega_dot (rad/s^2) and s (m/s^2), infinite as in paper 2021.
        With effects that have a gauge the flat prior is no posterior at all: each sample of the
        likelihood carries a power of the array's size and of a common gyroscope scale, which the
        data do not push back; a prior of the motion's own size does (docs/findings.md).
    clock : (float, float) or None
        Where time begins (s) and its span (s), which drifts, shifts and clocks look at; by
        default those of the times given, which a part of a recording does not share with it.
    """

    array: Array
    noise: Noise
    effects: tuple[str, ...] = ()
    derivative_sd: tuple[float, float] = (2e4, 600.0)
    motion_sd: tuple[float, float, float] = (np.inf, np.inf, np.inf)
    clock: tuple[float, float] | None = None

    @classmethod
    def isotropic(cls, array, accelerometer_sd, gyroscope_sd, effects=()) -> Self:
        """The papers' noise: one sd (m/s^2, rad/s) for all triads of a kind."""
        noise = Noise.of(array.accelerometers, array.gyroscopes, accelerometer_sd, gyroscope_sd)
        return cls(array, noise, tuple(effects))

    @cached_property
    def chain(self) -> tuple[Effect, ...]:
        """The effects themselves; InputError for an unknown id, or one that is not as declared."""
        found = find_effects(self.effects)
        for item in found:
            probed(item)
        return tuple(sorted(found, key=lambda item: not item.sampling))

    @cached_property
    def apart(self) -> bool:
        """True where a triad's parameters, its position too, change its own readings alone."""
        fewer = self.array.gyroscopes <= self.array.accelerometers  # each beside one of its own
        return fewer and all(probed(item) for item in self.chain)

    @cached_property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """Shape of each effect's parameters on this array."""
        counts = self.array.accelerometers, self.array.gyroscopes
        return tuple(item.shape(*counts) for item in self.chain)

    @property
    def effect_size(self) -> int:
        """Number of effect parameters in all."""
        return int(sum(np.prod(shape) for shape in self.shapes))

    @cached_property
    def effect_prior_sd(self) -> np.ndarray:
        """Prior sd of every effect parameter, (P,), in the effects' units."""
        return self.join({item.id: item.prior_sd for item in self.chain})

    @property
    def needs_derivatives(self) -> bool:
        """True where an effect looks at omega double dot and s dot."""
        return any(item.derivatives for item in self.chain)

    def split(self, parameters) -> dict[str, object]:
        """The flat effect parameters (P,) as a dict id -> array of the effect's shape."""
        out, start = {}, 0
        for item, shape in zip(self.chain, self.shapes, strict=True):
            size = int(np.prod(shape))
            out[item.id] = parameters[start : start + size].reshape(shape)
            start += size
        return out

    def join(self, values: dict) -> np.ndarray:
        """Flat effect parameters from a dict; absent ones are zero, scalars are spread."""
        unknown = set(values) - set(self.effects)
        require(not unknown, "effects", f"values for {self.effects}", sorted(unknown))
        parts = [
            np.broadcast_to(np.asarray(values.get(item.id, 0.0), float), shape).ravel()
            for item, shape in zip(self.chain, self.shapes, strict=True)
        ]
        return np.concatenate([np.empty(0), *parts])

    def predict(self, motion: Motion, positions, parameters=(), **when) -> Prediction:
        """Noise-free measurement at one instant (traceable by JAX).

        ``motion`` fields (3,), ``positions`` (A, 3) metres relative to the reference
        triad, ``parameters`` (P,) flat effect parameters; ``when`` is what else an `Instant`
        holds: time (s), span (s), second and third derivatives.
        """
        values = self.split(jnp.asarray(parameters)) if self.effects else {}
        return self.applied(values, Instant(motion, positions, **when))

    def applied(self, values: dict, instant: Instant) -> Prediction:
        """The prediction of an instant, effects by their ``values`` as `split` has them."""
        instant = instant._replace(axes=self.array.turns)
        predicted = self.ideal(instant)
        for item in self.chain:
            predicted = item.apply(values[item.id], instant, predicted)
        return predicted

    def ideal(self, instant: Instant) -> Prediction:
        """The prediction without effects: what they are applied to."""
        seen = instant.gyroscopes or instant.motion
        rate = jnp.broadcast_to(seen[0], (self.array.gyroscopes, 3))
        return Prediction(kinematics.specific_force(instant.motion, instant.positions), rate)

    def predict_many(self, motion: Motion, positions, parameters=(), time=None) -> Prediction:
        """`predict` over leading sample axes, compiled; returns numpy arrays (..., n, 3).

        ``positions`` is (A, 3), or (realisations, A, 3) with motion (realisations, T, 3);
        ``time`` (T,) s matters to drifts, shifts and clocks only, zero if not given.
        """
        fields = Motion(*(jnp.asarray(field) for field in motion))
        positions = jnp.asarray(positions)
        parameters = jnp.asarray(np.asarray(parameters, float))
        since, span = self.since(fields.angular_rate.shape[-2], time)
        out = _predict_many(self, fields, positions, parameters, since, span)
        return Prediction(*(np.asarray(part) for part in out))

    def since(self, samples: int, time=None) -> tuple[np.ndarray, float]:
        """Seconds since the beginning (T,) and the span (s); zeros where no ``time`` is given."""
        if time is None:
            return np.zeros(samples), 1.0 if self.clock is None else self.clock[1]
        if self.clock is None:
            return clock(time)
        return np.asarray(time, float) - self.clock[0], self.clock[1]

    def turned(self, axes) -> Self:
        """With other axes of its sensors; its effects stay, whatever is registered since."""
        found = replace(self, array=replace(self.array, axes=axes))
        found.__dict__["chain"] = self.chain
        return found

    @cached_property
    def unturned(self) -> Self:
        """The model with its sensors' axes along the array's."""
        return self.turned(None)

    @cached_property
    def plain(self) -> Self:
        """The model without effects."""
        return replace(self, effects=())

    @property
    def _function(self) -> tuple:
        """All that `predict` and the compiled residuals depend on, noise excepted."""
        counts, axes = (self.array.accelerometers, self.array.gyroscopes), self.array.turns
        return (*counts, axes.tobytes(), self.chain, self.derivative_sd, self.motion_sd)

    def __hash__(self):
        return hash(self._function)

    def __eq__(self, other):
        """Equal where `predict` is the same function; to compilers axes are data."""
        return isinstance(other, ArrayModel) and self._function == other._function


def clock(time) -> tuple[np.ndarray, float]:
    """Seconds since the first sample (T,), and the length in seconds (1 where there is none)."""
    since = np.asarray(time, float) - np.min(time)
    return since, float(np.max(since)) or 1.0


# An argument of what is compiled: its sensors' axes, which each recording's first order estimates,
# are data there; all else is part of the function.
jax.tree_util.register_pytree_node(
    ArrayModel, lambda model: ((model.array.turns,), model.unturned),
    lambda model, axes: model.turned(axes[0]),
)  # fmt: skip


@jax.jit
def _predict_many(model, motion, positions, parameters, time, span):
    def at(motion, time, positions, parameters):
        return model.predict(motion, positions, parameters, time=time, span=span)

    several = jax.vmap(at, in_axes=(0, 0, None, None))
    if positions.ndim == 3:
        several = jax.vmap(several, in_axes=(0, None, 0, None))
    return several(motion, time, positions, parameters)


def stacked(count: int, predicted: Prediction):
    """(N, 6) of both kinds of sensors, zero where an IMU has no such triad."""
    parts = [
        jnp.zeros((count, 3)).at[: len(part)].set(part)
        for part in (predicted.specific_force, predicted.angular_rate)
    ]
    return jnp.concatenate(parts, axis=1)


def by_effects(model: ArrayModel, count: int, instant: Instant, parameters):
    """(N, 6, m) derivative of each IMU's readings by its own effect parameters (traceable by JAX).

    Backwards from one reading of all IMUs at a time, as none depends on another's parameters: six
    times through the chain, instead of once for each parameter.
    """

    def readings(values):
        return stacked(count, model.applied(values, instant))

    def whole(slope):  # (6, N, m), zero where an IMU has no such triad
        flat = slope.reshape(*slope.shape[:2], -1)
        return jnp.pad(flat, ((0, 0), (0, count - flat.shape[1]), (0, 0)))

    _, back = jax.vjp(readings, model.split(parameters))
    (slopes,) = jax.vmap(lambda one: back(jnp.broadcast_to(one, (count, 6))))(jnp.eye(6))
    found = [whole(slopes[item.id]) for item in model.chain]
    return jnp.moveaxis(jnp.concatenate(found, axis=-1), 0, 1)


def component(effect: str, place: tuple[int, ...]) -> str:
    """The name of a parameter within its IMU's: ``place`` are its indices but the IMU's."""
    item = known_effect(effect)
    if item.components:
        parts = zip(item.components, place or (0,), strict=True)
        return "_".join(names[index] for names, index in parts)
    if not place:
        return "value"
    sizes = item.shape(2, 2)[1:] if item.shape else (3,) * len(place)
    if set(sizes) == {3}:
        return "".join(AXES[index] for index in place)
    if sizes == (len(OFF_DIAGONAL),):
        return OFF_DIAGONAL[place[0]]
    return "value" + "_".join(str(index + 1) for index in place)


def unit_of(effect: str, place: tuple[int, ...]) -> str:
    """The parameter's unit: commas count along the last axis, bars along the second."""
    unit = EFFECTS[effect].unit
    if "|" in unit:
        return unit.split("|")[place[0]].strip()
    return unit.split(",")[place[-1]].strip() if "," in unit else unit


def parameter_names(model: ArrayModel, labels=None) -> list[str]:
    """'effect component_IMU unit' of each flat effect parameter, (P,).

    ``labels``: of the accelerometers and of the gyroscopes; by default the array's, or numbers.
    """
    counts = (str(k + 1) for k in range(model.array.gyroscopes))
    whole = max(labels or (model.array.labels, tuple(counts)), key=len)
    return [
        f"{item.id} {component(item.id, i[1:])}_{whole[i[0]]} {unit_of(item.id, i[1:])}"
        for item, shape in zip(model.chain, model.shapes, strict=True)
        for i in np.ndindex(*shape)
    ]
