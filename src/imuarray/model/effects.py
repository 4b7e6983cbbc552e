"""Effects: what real triads add to the papers' model, each a small forward function.

An effect names its parameters' shape, unit and prior scale, and turns a predicted
measurement into another one. Nothing else is needed: simulation, both estimators and
the likelihood call `ArrayModel.predict`, and derivatives come from autodiff. The package's
are in `imuarray.model.catalogue` and `imuarray.model.timing`; `docs/effects.md` adds one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from imuarray.errors import InputError
from imuarray.motion.state import Motion


class Prediction(NamedTuple):
    """Noise-free measurement of the whole array at one instant."""

    specific_force: object  # (A, 3) m/s^2
    angular_rate: object  # (G, 3) rad/s


class Instant(NamedTuple):
    """The truth an effect may look at: the motion, where the triads are and what time it is.

    ``second`` and ``third`` are the ideal measurement's time derivatives of those orders, zero
    where they are not known (only a recording's smooth motion tells them). Where it is rough, what
    the gyroscopes' filters let pass may turn otherwise than what the accelerometers' do.
    """

    motion: Motion
    positions: object  # (A, 3) m
    time: object = 0.0  # s since the recording began
    span: object = 1.0  # s, the recording's length
    second: Prediction = Prediction(0.0, 0.0)
    third: Prediction = Prediction(0.0, 0.0)
    gyroscope_turn: object = None  # omega dot as the gyroscopes see it, where that is free


@dataclass(frozen=True)
class Effect:
    """A named extension of the measurement model.

    Attributes
    ----------
    shape : callable (A, G) -> tuple
        Shape of its parameters for A accelerometer and G gyroscope triads.
        The first axis counts the triads, each of which its own row alone concerns.
    prior_sd : float, or nested tuples that broadcast to ``shape``
        Prior standard deviation of each parameter around zero, in ``unit``.
    derivatives : bool
        Whether it needs omega double dot and s dot (12-column H instead of 6).
    sensors : str
        Whose reading it changes: accelerometer, gyroscope or imu (both).
    sampling : bool
        Whether it says when or where a triad samples: that comes before the triad's own errors.
    """

    id: str
    unit: str
    prior_sd: float | tuple
    shape: Callable[[int, int], tuple[int, ...]]
    derivatives: bool
    sensors: str
    apply: Callable[[object, Instant, Prediction], Prediction]
    sampling: bool = False


EFFECTS: dict[str, Effect] = {}
KINDS = ("accelerometer", "gyroscope")


def effect(id, *, unit, prior_sd, shape, derivatives=False, sensors=None, sampling=False):
    """Register the decorated function as the effect ``id`` of the catalogue."""

    def register(function):
        if "," in id or " " in id:
            raise ValueError(f"effect {id!r}: expected an id without commas and spaces")
        if id in EFFECTS and not _again(EFFECTS[id].apply, function):
            raise ValueError(f"effect {id}: expected a new id, found it registered already")
        prior = tuple(prior_sd) if isinstance(prior_sd, list) else prior_sd
        whose = sensors or (id.split("_")[0] if id.split("_")[0] in KINDS else "imu")
        EFFECTS[id] = Effect(id, unit, prior, shape, derivatives, whose, function, sampling)
        return function

    return register


def _again(old, new) -> bool:
    """Whether a notebook's cell is run once more: its new effect replaces the old one."""
    return old.__module__ == new.__module__ == "__main__"


def find_effects(ids) -> tuple[Effect, ...]:
    """Effects by id; InputError names the unknown one and what is known."""
    for name in ids:
        if name not in EFFECTS:
            raise InputError(f"effects: expected any of {', '.join(sorted(EFFECTS))}, found {name}")
    return tuple(EFFECTS[name] for name in ids)


@effect("gyroscope_scale", unit="1", prior_sd=0.02, shape=lambda a, g: (g, 3))
def gyroscope_scale(scale, instant, predicted):
    """(1 + c_i) omega_i at each gyroscope axis."""
    return predicted._replace(angular_rate=(1.0 + scale) * predicted.angular_rate)
