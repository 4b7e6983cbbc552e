"""Compiled likelihood estimate (26a) and pseudo-marginal Metropolis-Hastings transitions."""

import math
from typing import NamedTuple

import numpy as np

from imuarray_papers.compiled import njit
from imuarray_papers.estimation import kernels
from imuarray_papers.estimation.collapsed import Collapsed
from imuarray_papers.posterior import draws


class LikelihoodData(NamedTuple):
    """A recording as the compiled likelihood wants it; time is the last axis."""

    collapsed: Collapsed
    weighted: np.ndarray  # (A, 3, T) Lambda y
    mean: np.ndarray  # (3, T) mean of the density omega_t is drawn from, p(omega_t | y_g)
    factor: np.ndarray  # (6, T) its covariance's Cholesky factor: xx, yx, yy, zx, zy, zz
    log_weight: np.ndarray  # (10, T) log p - log of that density: 1, x, y, z, the six products
    ridge: np.ndarray  # (3,) prior precision of omega_dot (s^4/rad^2), zero where flat


@njit
def collapse(positions, data, out):
    """Everything that depends on theta but not on omega; returns log |H' Lambda H|."""
    kernels.information(positions, data.collapsed, out.K)
    for i in range(3):
        out.K[6 + i, 6 + i] += data.ridge[i]
    return kernels.reduce(positions, data.weighted, data.collapsed, out)


@njit(inline="always")
def _log_mean_exp(exponent):
    """log of the mean of exp(exponent), safe from over- and underflow (Appendix A)."""
    top = exponent.max()
    if exponent.size == 1 or not top > -math.inf:
        return top
    return top + math.log(np.exp(exponent - top).mean())


@njit
def fixed_draws(positions, data, rates, power):
    """log p-hat (26a) on given draws ``rates`` (T, N, 3) rad/s."""
    found = kernels.reduced(rates.shape[0])
    logdet = collapse(positions, data, found)
    total, weighted = 0.0, data.log_weight.shape[1] > 0
    exponent = np.empty(rates.shape[1])
    for t in range(rates.shape[0]):
        b = found.b[:, t]
        for n in range(rates.shape[1]):
            x, y, z = rates[t, n]
            exponent[n] = -0.5 * kernels.quadratic(
                x, y, z, found.C, b[0], b[1], b[2], b[3], b[4], b[5]
            )
            if weighted:
                exponent[n] += draws.log_weight(data.log_weight, t, x, y, z)
        total += _log_mean_exp(exponent)
    return total - 0.5 * found.const.sum() - power * found.const.size * logdet


@njit
def fresh_draws(positions, data, found, tile, power):
    """log p-hat (26a) with omega drawn anew from p(omega | y_g).

    ``found`` and ``tile`` are a chain's memory: a `Reduced` of the samples, and a `Tile`.
    """
    logdet, total = collapse(positions, data, found), 0.0
    draws.folded(found.C, tile.quartic)
    for start in range(0, data.mean.shape[1], draws.TILE):
        size = min(draws.TILE, data.mean.shape[1] - start)
        numbers = draws.drawn(size, tile)
        draws.exponents(start, size, data, tile.quartic, found.b, numbers, tile.exponent)
        total += draws.log_means(size, tile)
    return total - 0.5 * found.const.sum() - power * found.const.size * logdet


@njit
def repeated(positions, data, rng, count, power, out):
    """Independent realisations of log p-hat at one theta, filling ``out``."""
    for i in range(out.size):
        found, tile = kernels.reduced(data.mean.shape[1]), draws.tile(count, rng)
        out[i] = fresh_draws(positions, data, found, tile, power)


@njit
def transitions(theta, log_target, prior, step, number, power, data, rng, count):
    """``count`` transitions of Algorithm 1 (2021) from ``theta`` (3 (A - 1),), in place.

    ``prior`` (2, 3 (A - 1)) holds means and precisions. The accepted noisy estimate is kept, never
    redrawn, of ``number`` draws of omega. Proposals are the walk (27) of sd ``step``. Returns
    (accepted, log_target).
    """
    found, tile = kernels.reduced(data.mean.shape[1]), draws.tile(number, rng)
    positions = np.zeros((theta.size // 3 + 1, 3))
    flat = positions.ravel()[3:]
    accepted = 0
    for _ in range(count):
        proposed = 0.0
        for i in range(theta.size):
            flat[i] = theta[i] + step * rng.standard_normal()
            proposed -= 0.5 * prior[1, i] * (flat[i] - prior[0, i]) ** 2
        proposed += fresh_draws(positions, data, found, tile, power)
        if math.log(rng.random()) < proposed - log_target:
            theta[:] = flat
            log_target = proposed
            accepted += 1
    return accepted, log_target
