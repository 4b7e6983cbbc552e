"""The model's prediction and its derivatives over a recording, by automatic differentiation."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_coeffs

from imuarray.criticism.columns import Columns, tangents
from imuarray.criticism.readings import Readings
from imuarray.model.effects import Prediction
from imuarray.model.jax64 import jax, jnp
from imuarray.motion.state import Motion

CHUNK = 256  # samples per compiled call: one compiled shape, bounded memory


class State(NamedTuple):
    """Where the model is linearised."""

    motion: np.ndarray  # (T, 9): omega, omega_dot, s
    positions: np.ndarray  # (A, 3) m, relative to the reference
    parameters: np.ndarray  # (P,) of the model with all effects
    derivatives: tuple  # omega double dot, s dot (T, 3); second, third of (force, rate)


class Linear(NamedTuple):
    """A linearised recording."""

    predicted: np.ndarray  # (T, N, 6)
    motion: np.ndarray  # (T, N, 6, 9)
    shared: np.ndarray  # (T, N, 6, m), each IMU's readings by its own parameters


def _reading(model, count, x, positions, parameters, extra, time, span):
    """(N, 6) predicted readings of one sample."""
    jerk, force_rate, second, third = extra
    motion = Motion(x[:3], x[3:6], x[6:9], jerk, force_rate)
    out = model.predict(
        motion, positions, parameters, time=time, span=span, second=second, third=third
    )
    force = jnp.zeros((count, 3)).at[: len(out.specific_force)].set(out.specific_force)
    rate = jnp.zeros((count, 3)).at[: len(out.angular_rate)].set(out.angular_rate)
    return jnp.concatenate([force, rate], axis=1)


@partial(jax.jit, static_argnums=(0, 1))
def _chunk(model, count, x, extra, time, span, positions, parameters, directions):
    split = positions.size

    def one(x, extra, time):
        def flat(x, shared):
            return _reading(
                model, count, x, shared[:split].reshape(-1, 3), shared[split:], extra, time, span
            )

        shared = jnp.concatenate([positions.ravel(), parameters])
        along = jax.vmap(lambda d: jax.jvp(lambda p: flat(x, p), (shared,), (d,))[1], out_axes=-1)(
            directions
        )
        return flat(x, shared), jax.jacfwd(flat)(x, shared), along

    return jax.vmap(one)(x, extra, time)


BUCKETS = (4, 16, 48)  # numbers of columns a compiled derivative is made for


def linearise(readings: Readings, columns: Columns, state: State, wanted=None) -> Linear:
    """Prediction (T, N, 6) and derivatives at a state, in SI units.

    ``wanted`` : indices of the columns to differentiate by, all if None.
    """
    samples, count = readings.values.shape[:2]
    directions = tangents(columns.model)
    number = len(directions)
    if wanted is not None:
        number = len(wanted)
        room = min([size for size in BUCKETS if size >= number], default=len(directions))
        directions = np.vstack([directions[wanted], np.zeros((room - number, directions.shape[1]))])
    parts = []
    for start in range(0, samples, CHUNK):
        index = np.minimum(np.arange(start, start + CHUNK), samples - 1)
        extra = jax.tree.map(lambda field, index=index: field[index], state.derivatives)
        out = _chunk(
            columns.model, count, state.motion[index], extra, readings.time[index],
            readings.span, state.positions, state.parameters, directions,
        )  # fmt: skip
        parts.append([np.asarray(part)[: samples - start] for part in out])
    predicted, motion, shared = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Linear(predicted, motion, shared[..., :number])


def derivatives(readings: Readings, motion, positions) -> tuple:
    """omega double dot, s dot and the readings' second and third derivatives, by polynomials.

    Quartics over a short window of the fitted motion, whose noise is independent of the
    residual's; the ideal readings are those of the papers' model.
    """
    rate, turn, force = motion[:, :3], motion[:, 3:6], motion[:, 6:9]
    ideal = (
        np.cross(rate[:, None], np.cross(rate[:, None], positions))
        + np.cross(turn[:, None], positions)
        + force[:, None]
    )

    def along(values, order):
        return polynomial_derivative(readings.time, readings.run, values, readings.window, order)

    second = Prediction(along(ideal, 2), along(rate, 2)[:, None])
    third = Prediction(along(ideal, 3), along(rate, 3)[:, None])
    return along(rate, 2), along(force, 1), second, third


def polynomial_derivative(time, run, values, window, order) -> np.ndarray:
    """The order-th derivative by local quartics, within runs; the ends use the end's polynomial."""
    step = np.median(np.diff(time))
    taps = [
        savgol_coeffs(window, 4, deriv=order, delta=step, pos=pos, use="dot")
        for pos in range(window)
    ]
    out = np.zeros_like(values)
    half = window // 2
    edges = np.flatnonzero(np.concatenate([[True], np.diff(run) > 0, [True]]))
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        if last - first < window:
            continue
        middle = last - window + 1
        out[first + half : last - half] = sum(
            tap * values[first + i : middle + i] for i, tap in enumerate(taps[half])
        )
        for pos in range(half):
            out[first + pos] = np.tensordot(taps[pos], values[first : first + window], 1)
            out[last - half + pos] = np.tensordot(
                taps[half + 1 + pos], values[last - window : last], 1
            )
    return out


def no_derivatives(samples, accelerometers) -> tuple:
    """All zero: a motion of which no derivative is known."""
    nothing = np.zeros((samples, 3))
    flat = Prediction(np.zeros((samples, accelerometers, 3)), np.zeros((samples, 1, 3)))
    return nothing, nothing, flat, flat
