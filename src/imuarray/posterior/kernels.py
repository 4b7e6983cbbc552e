"""Compiled likelihood estimate (26a) and pseudo-marginal Metropolis-Hastings transitions."""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from imuarray.estimation import kernels
from imuarray.posterior import draws


class Data(NamedTuple):
    """A recording as the compiled likelihood wants it; time is the last axis."""

    weighted: np.ndarray  # (A, 3, T) Lambda y
    energy: np.ndarray  # (T,) y' Lambda y
    base: np.ndarray  # (3, T) sum_k (Lambda y)_k
    mean: np.ndarray  # (3, T) mean of the density omega_t is drawn from, p(omega_t | y_g)
    factor: np.ndarray  # (6, T) its covariance's Cholesky factor: xx, yx, yy, zx, zy, zz
    tilt: np.ndarray  # (10, T) log p - log of that density: 1, x, y, z, and the six products
    weights: np.ndarray  # (A,) 1 / sigma_k^2, empty for a general covariance
    precision: np.ndarray  # (3A, 3A) Lambda, empty for isotropic triads
    tensor: np.ndarray  # (4, 3, 12)
    rows: np.ndarray
    values: np.ndarray
    pairs: np.ndarray
    products: np.ndarray
    ridge: np.ndarray  # (3,) prior precision of omega_dot (s^4/rad^2), zero where flat


class Workspace(NamedTuple):
    """Scratch memory of one chain."""

    moments: np.ndarray
    full: np.ndarray
    b: np.ndarray
    phi: np.ndarray
    const: np.ndarray
    K: np.ndarray
    C: np.ndarray
    X: np.ndarray
    inverse: np.ndarray
    tile: draws.Tile


@nb.njit(cache=True, nogil=True)
def workspace(samples, count):
    """Allocate a `Workspace` for T samples and N = ``count`` draws."""
    return Workspace(
        np.zeros((4, 3, samples)),
        np.empty((12, samples)),
        np.empty((6, samples)),
        np.empty((6, samples)),
        np.empty(samples),
        np.empty((12, 12)),
        np.empty((6, 6)),
        np.empty((6, 6)),
        np.empty((6, 6)),
        draws.tile(count),
    )


@nb.njit(cache=True, nogil=True)
def _collapse(positions, data, work):
    """Everything that depends on theta but not on omega; returns log |H' Lambda H|."""
    if data.weights.size:
        kernels.information(positions, data.weights, data.pairs, data.products, work.K)
    else:
        kernels.information_general(positions, data.precision, data.tensor, work.K)
    for i in range(3):
        work.K[6 + i, 6 + i] += data.ridge[i]
    logdet = kernels.eliminate(work.K, work.C, work.X, work.inverse)
    work.moments[0] = data.base
    kernels.weighted_moments(positions, data.weighted, work.moments)
    kernels.project(work.moments, data.rows, data.values, work.full)
    kernels.reduce_linear(
        work.full, work.X, work.inverse, work.b, work.phi, work.const, data.energy
    )
    return logdet


@nb.njit(cache=True, nogil=True, inline="always")
def _log_mean_exp(exponent):
    """log of the mean of exp(exponent), safe from over- and underflow (Appendix A)."""
    top = exponent[0]
    for n in range(1, exponent.size):
        top = max(top, exponent[n])
    if exponent.size == 1 or not top > -math.inf:
        return top
    total = 0.0
    for n in range(exponent.size):
        total += math.exp(exponent[n] - top)
    return top + math.log(total / exponent.size)


@nb.njit(cache=True, nogil=True)
def _assemble(total, const, logdet, determinant_power):
    return total - 0.5 * const.sum() - determinant_power * const.size * logdet


@nb.njit(cache=True, nogil=True)
def fixed_draws(positions, data, rates, work, power):
    """log p-hat (26a) on given draws ``rates`` (T, N, 3) rad/s."""
    logdet = _collapse(positions, data, work)
    total, tilted = 0.0, data.tilt.shape[1] > 0
    exponent = np.empty(rates.shape[1])
    for t in range(rates.shape[0]):
        b = work.b[:, t]
        for n in range(rates.shape[1]):
            x, y, z = rates[t, n]
            exponent[n] = -0.5 * kernels.quadratic(
                x, y, z, work.C, b[0], b[1], b[2], b[3], b[4], b[5]
            )
            if tilted:
                exponent[n] += draws.tilted(data.tilt, t, x, y, z)
        total += _log_mean_exp(exponent)
    return _assemble(total, work.const, logdet, power)


@nb.njit(cache=True, nogil=True)
def fresh_draws(positions, data, rng, work, power, first, last):
    """log p-hat (26a) of samples first..last-1 with omega drawn anew from p(omega | y_g)."""
    logdet = _collapse(positions, data, work)
    total, tile = 0.0, work.tile
    for start in range(first, last, draws.TILE):
        size = min(draws.TILE, last - start)
        mean, factor = data.mean, data.factor
        draws.normals(rng, size, tile.numbers)
        draws.exponents(start, size, mean, factor, work.C, work.b, tile.numbers, tile.exponent)
        if data.tilt.shape[1] > 0:
            draws.tilt(start, size, data.tilt, mean, factor, tile.numbers, tile.exponent)
        total += draws.log_means(size, tile)
    return _assemble(total, work.const[first:last], logdet, power)


@nb.njit(cache=True, nogil=True)
def repeated(positions, data, rng, count, power, out):
    """Independent realisations of log p-hat at one theta, filling ``out``."""
    work = workspace(data.energy.size, count)
    for i in range(out.size):
        out[i] = fresh_draws(positions, data, rng, work, power, 0, data.energy.size)


@nb.njit(cache=True, nogil=True)
def transitions(theta, log_target, prior, step, draws, power, data, rng, count):
    """``count`` transitions of Algorithm 1 (2021) from ``theta`` (3 (A - 1),), in place.

    ``prior`` (2, 3 (A - 1)) holds means and precisions, ``step`` the walk's sd. The
    accepted noisy estimate is kept, never redrawn. Returns (accepted, log_target).
    """
    work = workspace(data.energy.size, draws)
    size = theta.size
    positions = np.zeros((size // 3 + 1, 3))
    flat = positions.ravel()[3:]
    accepted = 0
    for _ in range(count):
        proposed = 0.0
        for i in range(size):
            flat[i] = theta[i] + step * rng.standard_normal()
            proposed -= 0.5 * prior[1, i] * (flat[i] - prior[0, i]) ** 2
        proposed += fresh_draws(positions, data, rng, work, power, 0, data.energy.size)
        if math.log(rng.random()) < proposed - log_target:
            theta[:] = flat
            log_target = proposed
            accepted += 1
    return accepted, log_target


@nb.njit(cache=True, nogil=True)
def autoregressive(theta, log_target, prior, centre, factor, step, draws, power, data, rng, count):
    """``count`` transitions from ``theta`` in place, proposals reversible for a normal density.

    That density has mean ``centre`` (3 (A - 1),) and covariance factor factor', ``factor`` lower:
    in its own coordinates a proposal is sqrt(1 - step^2) z + step n. Only what the target departs
    from it can be refused. Returns (accepted, log_target).
    """
    work = workspace(data.energy.size, draws)
    size = theta.size
    positions = np.zeros((size // 3 + 1, 3))
    flat = positions.ravel()[3:]
    z, new = np.empty(size), np.empty(size)
    square = 0.0
    for i in range(size):
        value = theta[i] - centre[i]
        for j in range(i):
            value -= factor[i, j] * z[j]
        z[i] = value / factor[i, i]
        square += z[i] ** 2
    keep, accepted = math.sqrt(1.0 - step**2), 0
    for _ in range(count):
        proposed, moved = 0.0, 0.0
        for i in range(size):
            new[i] = keep * z[i] + step * rng.standard_normal()
            moved += new[i] ** 2
        for i in range(size):
            value = centre[i]
            for j in range(i + 1):
                value += factor[i, j] * new[j]
            flat[i] = value
            proposed -= 0.5 * prior[1, i] * (value - prior[0, i]) ** 2
        proposed += fresh_draws(positions, data, rng, work, power, 0, data.energy.size)
        ratio = proposed - log_target + 0.5 * (moved - square)
        if math.log(rng.random()) < ratio:
            theta[:] = flat
            z[:] = new
            log_target, square = proposed, moved
            accepted += 1
    return accepted, log_target
