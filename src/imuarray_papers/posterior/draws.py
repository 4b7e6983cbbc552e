"""Exponents of the likelihood by draws of omega, a tile of samples at a time.

The inner loops run over a tile's samples and have no branch, so compilers turn them into vector
instructions; an exponential of our own keeps calls of the C library out of them.
"""

import math
from typing import NamedTuple

import numpy as np

from imuarray_papers.compiled import fma, njit
from imuarray_papers.posterior import normals
from imuarray_papers.posterior.normals import exp

TILE = 32  # samples
LEAST = -700.0  # nothing below is more than 0 beside exp(0)


class Tile(NamedTuple):
    """Where N draws of a tile's samples come from, and scratch memory."""

    source: normals.Source
    numbers: np.ndarray  # (room for 3 N TILE,) normal
    quartic: np.ndarray  # (15,) of `folded`
    exponent: np.ndarray  # (N, TILE)
    top: np.ndarray  # (TILE,) the largest exponent
    total: np.ndarray  # (TILE,) sum of the exponentials of all less it


@njit
def tile(draws, rng):
    """Allocate a `Tile` for N draws, their numbers seeded by ``rng``."""
    count = 3 * draws * TILE
    return Tile(
        normals.source(rng, count), np.zeros(normals.room(count)), np.zeros(15),
        np.zeros((draws, TILE)), np.zeros(TILE), np.zeros(TILE),
    )  # fmt: skip


@njit
def drawn(size, work):
    """Normal numbers (N, 3, ``size``) for a tile of ``size`` samples, in ``work``'s memory."""
    draws = work.exponent.shape[0]
    count = 3 * draws * size
    normals.fill(work.source, count, work.numbers)
    return work.numbers[:count].reshape((draws, 3, size))


@njit
def folded(C, out):
    """The 15 monomials' coefficients of -w' C w / 2 as `_exponent` wants them, into ``out``.

    Three of the 21 products of two of w's come twice: (x y) (x y) is x^2 y^2, and so on.
    """
    out[0], out[2], out[5] = -0.5 * C[0, 0], -0.5 * C[1, 1], -0.5 * C[2, 2]
    out[1], out[3], out[4] = (
        -(C[1, 0] + 0.5 * C[3, 3]), -(C[2, 0] + 0.5 * C[4, 4]), -(C[2, 1] + 0.5 * C[5, 5])
    )  # fmt: skip
    out[6], out[7], out[8] = -C[3, 0], -C[3, 1], -(C[3, 2] + C[5, 4])
    out[9], out[10], out[11] = -C[4, 0], -(C[4, 1] + C[5, 3]), -C[4, 2]
    out[12], out[13], out[14] = -(C[5, 0] + C[4, 3]), -C[5, 1], -C[5, 2]


@njit(inline="always")
def _exponent(x, y, z, c, b, t):
    """-w' C w / 2 + b . w of sample t at omega = (x, y, z), ``c`` of `folded`."""
    xx, yy, zz = x * x, y * y, z * z
    found = xx * fma(c[0], xx, b[0, t])
    found = fma(yy, fma(c[1], xx, fma(c[2], yy, b[1, t])), found)
    found = fma(zz, fma(c[3], xx, fma(c[4], yy, fma(c[5], zz, b[2, t]))), found)
    found = fma(x * y, fma(c[6], xx, fma(c[7], yy, fma(c[8], zz, b[3, t]))), found)
    found = fma(x * z, fma(c[9], xx, fma(c[10], yy, fma(c[11], zz, b[4, t]))), found)
    return fma(y * z, fma(c[12], xx, fma(c[13], yy, fma(c[14], zz, b[5, t]))), found)


@njit(inline="always")
def _rate(t, mean, factor, u, v, w):
    """mean + factor (u, v, w) of sample t."""
    return (
        fma(factor[0, t], u, mean[0, t]),
        fma(factor[2, t], v, fma(factor[1, t], u, mean[1, t])),
        fma(factor[5, t], w, fma(factor[4, t], v, fma(factor[3, t], u, mean[2, t]))),
    )


@njit(inline="always")
def log_weight(k, t, x, y, z):
    """log p(omega | y_g) less the log of the density it is drawn from."""
    along_x = fma(k[4, t], x, fma(k[7, t], y, fma(k[8, t], z, k[1, t])))
    along_y = fma(k[5, t], y, fma(k[9, t], z, k[2, t]))
    along_z = fma(k[6, t], z, k[3, t])
    return fma(x, along_x, fma(y, along_y, fma(z, along_z, k[0, t])))


@njit
def exponents(first, size, data, quartic, b, numbers, out):
    """-(w' C w - 2 b . w) / 2 and `log_weight` at mean + factor n, n of ``numbers`` (N, 3, size).

    The sample's index is unsigned: one that might count from the end would be looked up number by
    number. Weights have a loop of their own: without them, a branch in the first one would become
    masked loads from beyond their empty table, which cost several times all the rest where that
    memory has no page.
    """
    mean, factor, k = data.mean, data.factor, data.log_weight
    for n in range(out.shape[0]):
        for i in range(size):
            t = np.uint64(first + i)
            x, y, z = _rate(t, mean, factor, numbers[n, 0, i], numbers[n, 1, i], numbers[n, 2, i])
            out[n, i] = _exponent(x, y, z, quartic, b, t)
    if k.shape[1] == 0:
        return
    for n in range(out.shape[0]):
        for i in range(size):
            t = np.uint64(first + i)
            x, y, z = _rate(t, mean, factor, numbers[n, 0, i], numbers[n, 1, i], numbers[n, 2, i])
            out[n, i] += log_weight(k, t, x, y, z)


@njit
def log_means(size, work):
    """Sum over a tile's samples of the log of the mean exponential, safe from over- and underflow.

    Appendix A of paper 2021.
    """
    exponent, top, total = work.exponent, work.top, work.total
    found, draws = 0.0, exponent.shape[0]
    if draws == 1:
        for i in range(size):
            found += exponent[0, i]
        return found
    for i in range(size):
        top[i] = exponent[0, i]
        total[i] = 0.0
    for n in range(1, draws):
        for i in range(size):
            top[i] = max(top[i], exponent[n, i])
    for n in range(draws):
        for i in range(size):
            # NaN passes max as its first argument, not as its second
            total[i] += exp(max(exponent[n, i] - top[i], LEAST))
    for i in range(size):
        found += top[i]
        if top[i] > -math.inf:
            found += math.log(total[i] / draws)
    return found
