"""The noise and the motion's size that a recording itself shows, by restricted likelihood."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from imuarray.analysis.model import Say, silent
from imuarray.estimation import blocks
from imuarray.estimation.bcd import Calibration
from imuarray.model import ArrayModel, Noise
from imuarray.model.jax64 import jax, jnp
from imuarray.model.small_linear import cholesky, solve_lower
from imuarray.recording import Recording

ROUNDS, ENOUGH = 6, 0.02  # of fit and noise by turns; change of all sds that ends them
FREEDOM = 200.0  # degrees that a triad's own noise takes, 5 % of its sd; with fewer they share one
APART = (4, 3)  # accelerometers, gyroscopes: fewer cannot be told apart, either


class Fitted(NamedTuple):
    """A fit at the noise that it shows."""

    model: ArrayModel  # with that noise
    calibration: Calibration
    motion_sd: np.ndarray  # (3,) of omega, omega_dot, s: what is not noise of their estimates
    freedom: np.ndarray  # (2,) degrees that the two kinds of noise rest on


@partial(jax.jit, static_argnums=0)
def _leverage(model, x, p, covariance, readings, span, whiten):
    """(squares (T, R), leverages (T, R), covariances of omega, omega_dot, s (T, 3, 3, 3))."""

    def one(x, readings):
        def flat(x, p):
            return blocks.residual(model, x, p, *readings, span, *whiten)

        moved, shared = jax.jacfwd(flat, (0, 1))(x, p)
        factor = cholesky(moved.T @ moved)
        basis = solve_lower(factor, moved.T)
        left = shared - basis.T @ (basis @ shared)
        own = jnp.sum(basis**2, axis=0) + jnp.sum((left @ covariance) * left, axis=1)
        roots = solve_lower(factor, jnp.eye(x.size))[:, :9].reshape(-1, 3, 3)
        return flat(x, p) ** 2, own, jnp.einsum("nki,nkj->kij", roots, roots)

    return jax.vmap(one)(x, readings)


def _looked_at(recording: Recording, model: ArrayModel, found):
    """Chi-square and degrees of freedom of each triad (A + G,), size of the motion (3,)."""
    given = blocks.problem(
        model, recording.specific_force, recording.angular_rate,
        recording.saturated_gyroscopes(), time=recording.time,
    )  # fmt: skip
    x = blocks.pack_motion(model, found.motion.motion)
    extra = np.empty(0) if found.effect_parameters is None else found.effect_parameters
    p = np.concatenate([found.positions[1:].ravel(), extra])
    readings = given.specific_force, given.angular_rate, given.keep, given.time
    whiten = given.whiten_force, given.whiten_rate[0]
    parts = []
    for start in range(0, len(x), blocks.CHUNK):
        use = np.minimum(np.arange(start, start + blocks.CHUNK), len(x) - 1)
        made = _leverage(
            model, x[use], p, found.covariance, tuple(part[use] for part in readings), given.span,
            whiten,
        )  # fmt: skip
        parts.append([np.asarray(part)[: len(x) - start] for part in made])
    squares, leverage, spread = (np.concatenate(part) for part in zip(*parts, strict=True))
    count = 3 * model.array.accelerometers
    rows = count + given.keep.shape[1]
    there = np.hstack([np.ones((len(x), count)), given.keep != 0])
    triads = [part[:, :rows].sum(axis=0).reshape(-1, 3).sum(axis=1)
              for part in (squares, there - leverage[:, :rows])]  # fmt: skip
    sizes = [_size(x[:, 3 * k : 3 * k + 3], spread[:, k]) for k in range(3)]
    return *triads, np.array(sizes)


def _size(estimates, covariances) -> float:
    """The sd whose normal values have estimates (T, 3) with errors of covariances (T, 3, 3)."""
    values, vectors = np.linalg.eigh(covariances)
    squares = np.einsum("tik,ti->tk", vectors, estimates) ** 2
    least, found = np.mean(squares) / 100, np.mean(squares)
    for _ in range(50):
        weights = (found + values) ** -2.0
        found = max(np.sum(weights * (squares - values)) / np.sum(weights), least)
    return float(np.sqrt(found))


def _factors(squares, freedom, apart: int) -> np.ndarray:
    """By what the triads' sds of one kind are wrong, (n,): each its own, or one for all."""
    if len(squares) < apart or freedom.min() < FREEDOM:
        squares, freedom = np.full(len(squares), squares.sum()), freedom.sum()
        if np.all(freedom < 1):
            return np.ones(len(squares))
    return np.sqrt(np.maximum(squares / freedom, 1e-12))


def _louder(noise: Noise, factors, count: int) -> Noise:
    """With the sds of each triad so many times as large, (A + G,)."""
    rows = np.repeat(factors, 3)
    force, rate = rows[: 3 * count], rows[3 * count :]
    return Noise(
        force[:, None] * noise.accelerometer * force, rate[:, None] * noise.gyroscope * rate
    )


def estimated_noise(
    recording: Recording, model: ArrayModel, fit, known=(False, False), say: Say = silent
) -> Fitted:
    """The fit of a recording, and the noise of each triad that goes with it.

    Restricted maximum likelihood: each triad's squared residuals against the degrees of freedom
    that motion and positions leave it, fit and noise by turns. Where those are few, or triads too
    few to be told apart, all triads of a kind share one factor.

    Parameters
    ----------
    fit : callable, model -> `Calibration` of ``recording`` with its covariance
    known : (bool, bool)
        Whether the accelerometers' noise, the gyroscopes', is the model's own.
    """
    count, found = model.array.accelerometers, fit(model)
    for _ in range(ROUNDS):
        squares, freedom, motion_sd = _looked_at(recording, model, found)
        kinds = slice(None, count), slice(count, None)
        factors = np.concatenate(
            [np.ones(len(squares[kind])) if fixed else
             _factors(squares[kind], freedom[kind], apart)
             for kind, fixed, apart in zip(kinds, known, APART, strict=True)]
        )  # fmt: skip
        if np.abs(np.log(factors)).max() < ENOUGH:
            break
        model = replace(model, noise=_louder(model.noise, factors, count))
        found = fit(model)
    else:
        say("the estimates of noise and positions did not settle; the last ones are taken")
    return Fitted(model, found, motion_sd, np.array([freedom[kind].sum() for kind in kinds]))
