"""Least squares for any model: per-sample blocks of the normal equations, by autodiff.

Unknowns are a sample's motion x (9, or 15 where effects need derivatives) and the shared
p = (r_2 ... r_A, effect parameters). Residuals are in units of their sd.
"""

from __future__ import annotations

from functools import cache, partial
from typing import NamedTuple

import numpy as np

from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.model.jax64 import jax, jnp
from imuarray.motion.state import Motion

ONE_SIDED = -1.0  # `Problem.keep` of a reading that counts only where the rate falls short of it
CHUNK = 64  # samples per compiled call: bounds memory and keeps one compiled shape


class Problem(NamedTuple):
    """A recording with its whitening, for one model."""

    model: ArrayModel
    specific_force: np.ndarray  # (T, A, 3)
    angular_rate: np.ndarray  # (T, G, 3)
    keep: np.ndarray  # (T, 3G) 1.0 where the gyroscope axis is used, 0.0 where not, or ONE_SIDED
    whiten_force: np.ndarray  # (3A, 3A), upper Cholesky factor of the precision
    whiten_rate: np.ndarray  # (1 or T, 3G, 3G)
    prior_mean: np.ndarray  # (P,)
    prior_sd: np.ndarray  # (P,), infinite where flat
    time: np.ndarray  # (T,) s since the recording began
    span: float  # s
    apart: bool  # a triad's parameters change its own readings alone, and so does its noise


class Blocks(NamedTuple):
    """Normal equations: x (T, n, n), cross (T, n, P), gradients, shared (P, P), cost."""

    motion: np.ndarray
    cross: np.ndarray
    motion_gradient: np.ndarray
    shared: np.ndarray
    shared_gradient: np.ndarray
    cost: float


def problem(
    model: ArrayModel,
    specific_force,
    angular_rate,
    saturated=None,
    position_prior=None,
    rate_covariance=None,
    time=None,
) -> Problem:
    """Arrange measurements (T, A, 3) m/s^2, (T, G, 3) rad/s for the general estimators.

    ``position_prior``: None for a flat one, or (mean (3 (A - 1),), sd) in metres. Effect
    parameters always have theirs. ``rate_covariance`` (T, 3G, 3G) (rad/s)^2 replaces the
    declared gyroscope noise by one for each sample, say that of (30b). ``time`` (T,) s is what
    drifts and clocks look at. InputError where
    saturated axes meet correlated gyroscopes, which only the papers' model supports.
    """
    keep = np.ones((len(angular_rate), 3 * model.array.gyroscopes))
    if saturated is not None and np.any(saturated):
        if not model.noise.uncorrelated_gyroscopes:
            raise InputError("saturated gyroscopes: expected uncorrelated gyroscope noise")
        keep -= np.asarray(saturated, float).reshape(keep.shape)
    size = 3 * (model.array.accelerometers - 1)
    mean, sd = (np.zeros(size), np.inf) if position_prior is None else position_prior
    spread = np.broadcast_to(sd, size)
    covariance = model.noise.gyroscope[None] if rate_covariance is None else rate_covariance
    times = model.since(len(angular_rate), time)
    return Problem(
        model, np.asarray(specific_force), np.asarray(angular_rate), keep,
        np.linalg.cholesky(model.noise.accelerometer_precision).T,
        np.linalg.cholesky(np.linalg.inv(covariance)).transpose(0, 2, 1),
        np.concatenate([mean, model.effect_prior_mean]),
        np.concatenate([spread, model.effect_prior_sd]),
        *times, model.apart and _apart(model.noise.accelerometer) and all(map(_apart, covariance)),
    )  # fmt: skip


def _apart(covariance) -> bool:
    """Whether a covariance (3n, 3n) is block diagonal by triad."""
    triad = np.arange(len(covariance)) // 3
    return not np.any(np.asarray(covariance)[triad[:, None] != triad])


def unpack_motion(x) -> Motion:
    """A `Motion` from x (..., 9 or 15)."""
    parts = [x[..., 3 * i : 3 * i + 3] for i in range(x.shape[-1] // 3)]
    nothing = jnp.zeros_like(parts[0])
    return Motion(*(parts + [nothing] * (5 - len(parts))))


def pack_motion(model: ArrayModel, motion: Motion) -> np.ndarray:
    """x (T, 9 or 15) from a `Motion` with fields (T, 3)."""
    return np.concatenate([np.asarray(f) for f in motion[: model.motion_size // 3]], axis=-1)


def residual(model, x, p, force, rate, keep, time, span, whiten_force, whiten_rate):
    """Whitened residuals of one sample, (3A + 3G [+ priors],), the motion's priors included."""
    shared = 3 * (model.array.accelerometers - 1)
    positions = jnp.concatenate([jnp.zeros((1, 3)), p[:shared].reshape(-1, 3)])
    predicted = model.predict(unpack_motion(x), positions, p[shared:], time=time, span=span)
    turn = whiten_rate @ (rate - predicted.angular_rate).ravel()
    short = jnp.maximum(jnp.sign(rate.ravel()) * turn, 0.0)
    parts = [
        whiten_force @ (force - predicted.specific_force).ravel(),
        jnp.where(keep == ONE_SIDED, short, keep * turn),
    ]
    for place, sd in enumerate(model.motion_sd):
        if np.isfinite(sd):
            parts.append(x[3 * place : 3 * place + 3] / sd)
    if model.needs_derivatives:
        parts.append(x[9:12] / model.derivative_sd[0])
        parts.append(x[12:15] / model.derivative_sd[1])
    return jnp.concatenate(parts)


@cache
def _columns(model) -> tuple[np.ndarray, np.ndarray]:
    """Of each shared parameter (P,): its triad, and its place among the triad's own."""
    triads, places, first = [np.repeat(np.arange(1, model.array.accelerometers), 3)], [], 3
    places.append(np.tile(np.arange(3), model.array.accelerometers - 1))
    for shape in model.shapes:
        own = int(np.prod(shape[1:]))
        triads.append(np.repeat(np.arange(shape[0]), own))
        places.append(first + np.tile(np.arange(own), shape[0]))
        first += own
    return np.concatenate(triads), np.concatenate(places)


def _jacobian(model, flat, both, motion):
    """Of the residuals by the motion's unknowns and the shared parameters, (R, n + P).

    Where a triad's parameters change its own readings alone (`Problem.apart`) one direction
    serves the parameters of the same name in all triads.
    """
    triads, places = _columns(model)
    directions = np.zeros((motion + 1 + max(places), both.size))
    directions[np.arange(motion), np.arange(motion)] = 1.0
    directions[motion + places, motion + np.arange(len(places))] = 1.0
    along = jax.vmap(lambda d: jax.jvp(flat, (both,), (d,))[1], out_axes=-1)(directions)
    counts = model.array.accelerometers, model.array.gyroscopes
    readings = np.concatenate([np.repeat(np.arange(count), 3) for count in counts])
    rows = np.full(along.shape[0], -1)
    rows[: len(readings)] = readings
    own = jnp.where(rows[:, None] == triads, along[:, motion + places], 0.0)
    return jnp.concatenate([along[:, :motion], own], axis=1)


@partial(jax.jit, static_argnums=(0, 1))
def _chunk(model, apart, x, p, force, rate, keep, time, span, use, whiten_force, whiten_rate):
    motion = x.shape[1]

    def one(x, force, rate, keep, time, whiten_rate):
        def flat(both):
            return residual(
                model, both[:motion], both[motion:], force, rate, keep, time, span,
                whiten_force, whiten_rate,
            )  # fmt: skip

        both = jnp.concatenate([x, p])
        jac = _jacobian(model, flat, both, motion) if apart else jax.jacfwd(flat)(both)
        return flat(both), jac[:, :motion], jac[:, motion:]

    value, left, right = jax.vmap(one)(x, force, rate, keep, time, whiten_rate)
    turned = left.swapaxes(1, 2)
    used = (use[:, None, None] * right).reshape(-1, p.size).T
    flat = value.reshape(-1)
    return (
        turned @ left, turned @ right, (turned @ value[..., None])[..., 0],
        used @ right.reshape(-1, p.size), used @ flat, jnp.sum(use[:, None] * value**2),
    )  # fmt: skip


def normal_equations(given: Problem, x, p) -> Blocks:
    """Blocks at motion x (T, n) and shared parameters p (P,), priors included."""
    samples, last = len(x), len(given.whiten_rate) - 1
    motion, cross, gradient = [], [], []
    weight = 1.0 / given.prior_sd**2
    offset = p - given.prior_mean
    shared, shared_gradient = np.diag(weight), weight * offset
    cost = float(np.sum(weight * offset**2))
    for start in range(0, samples, CHUNK):
        index = np.arange(start, start + CHUNK)
        use = (index < samples).astype(float)
        index = np.minimum(index, samples - 1)
        out = _chunk(
            given.model, given.apart, x[index], p, given.specific_force[index],
            given.angular_rate[index], given.keep[index], given.time[index], given.span, use,
            given.whiten_force, given.whiten_rate[np.minimum(index, last)],
        )  # fmt: skip
        used = int(use.sum())
        motion.append(np.asarray(out[0])[:used])
        cross.append(np.asarray(out[1])[:used])
        gradient.append(np.asarray(out[2])[:used])
        shared = shared + np.asarray(out[3])
        shared_gradient = shared_gradient + np.asarray(out[4])
        cost += float(out[5])
    joined = [np.concatenate(part) for part in (motion, cross, gradient)]
    return Blocks(*joined, shared, shared_gradient, cost)


@partial(jax.jit, static_argnums=0)
def _motion_chunk(model, x, p, force, rate, keep, time, span, whiten_force, whiten_rate):
    def one(x, force, rate, keep, time, whiten_rate):
        def flat(x):
            return residual(
                model, x, p, force, rate, keep, time, span, whiten_force, whiten_rate
            )  # fmt: skip

        value, jac = flat(x), jax.jacfwd(flat)(x)
        return jac.T @ jac, jac.T @ value, value @ value

    return jax.vmap(one)(x, force, rate, keep, time, whiten_rate)


def motion_equations(given: Problem, x, p) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The motion's own part of `normal_equations`, far cheaper: (T, n, n), (T, n), cost (T,)."""
    last, found = len(given.whiten_rate) - 1, []
    for start in range(0, len(x), CHUNK):
        index = np.minimum(np.arange(start, start + CHUNK), len(x) - 1)
        found.append(
            _motion_chunk(
                given.model, x[index], p, given.specific_force[index], given.angular_rate[index],
                given.keep[index], given.time[index], given.span, given.whiten_force,
                given.whiten_rate[np.minimum(index, last)],
            )
        )  # fmt: skip
    A, g, cost = (
        np.concatenate([np.asarray(part) for part in parts])[: len(x)]
        for parts in zip(*found, strict=True)
    )
    return A, g, cost
