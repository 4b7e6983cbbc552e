"""Derivatives of a prediction by all effects' parameters, the chain rule taken effect by effect."""

import math

import numpy as np

from imuarray.model.array_model import ArrayModel
from imuarray.model.effects import Instant, Prediction
from imuarray.model.jax64 import jax, jnp


def stacked(count: int, predicted: Prediction):
    """(N, 6) of both kinds of sensors, zero where an IMU has no such triad."""
    parts = [
        jnp.zeros((count, 3)).at[: len(part)].set(part)
        for part in (predicted.specific_force, predicted.angular_rate)
    ]
    return jnp.concatenate(parts, axis=1)


def by_effects(model: ArrayModel, count: int, instant: Instant, parameters):
    """(N, 6, m) derivative of each IMU's readings by its own effect parameters (traceable by JAX).

    Each effect is differentiated by itself, by its parameters and by the readings that go in, and
    what comes after it is a 6 x 6 matrix of each IMU: directions through the whole chain, one for
    each parameter, took several times as long.
    """
    instant = instant._replace(axes=model.array.turns)
    predicted = model.ideal(instant)
    values, slopes = model.split(parameters), []
    before = Prediction(*(_each(part.shape, 3 * kind, 6) for kind, part in enumerate(predicted)))
    for item in model.chain:
        own, given = values[item.id], predicted

        def by_own(direction, item=item, own=own, given=given):
            return jax.jvp(lambda p: item.apply(p, instant, given), (own,), (direction,))

        def by_given(direction, item=item, own=own, given=given):
            return jax.jvp(lambda y: item.apply(own, instant, y), (given,), (direction,))

        size = math.prod(own.shape[1:])
        slopes.append(
            [
                jax.vmap(lambda d, by=by: stacked(count, by(d)[1]), out_axes=-1)(directions)
                for by, directions in ((by_own, _each(own.shape, 0, size)), (by_given, before))
            ]
        )
        predicted = item.apply(own, instant, given)
    after, found = None, []
    for by_own, by_given in reversed(slopes):
        found.append(by_own if after is None else after @ by_own)
        after = by_given if after is None else after @ by_given
    return jnp.concatenate(found[::-1], axis=-1)


def _each(shape, first: int, number: int) -> np.ndarray:
    """(number, *shape) directions: a row's entries one by one from ``first`` on, of all rows."""
    size = math.prod(shape[1:])
    out = np.zeros((number, shape[0], size))
    out[first + np.arange(size), :, np.arange(size)] = 1.0
    return out.reshape(number, *shape)
