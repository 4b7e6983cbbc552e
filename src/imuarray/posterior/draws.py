"""What draws of omega make of the likelihood's exponents, a tile of samples at a time.

The inner loops run over a tile's samples and have no branch, so compilers turn them into vector
instructions; an exponential of our own keeps calls of the C library out of them.
"""

import math
from typing import NamedTuple

import numpy as np

from imuarray.compiled import njit
from imuarray.estimation.kernels import quadratic

TILE = 32  # samples
LOG2E, HIGH, LOW = 1.4426950408889634, 6.93147180369123816490e-01, 1.90821492927058770002e-10
INTEGER = 6755399441055744.0  # 1.5 2^52: added to a small integer, its bits are the last ones
LEAST = -700.0  # nothing below is more than 0 beside exp(0)


class Tile(NamedTuple):
    """Scratch memory for N draws of a tile's samples."""

    numbers: np.ndarray  # (N, 3, TILE), normal
    exponent: np.ndarray  # (N, TILE)
    top: np.ndarray  # (TILE,) the largest exponent
    total: np.ndarray  # (TILE,) sum of the exponentials of all less it
    power: np.ndarray  # (TILE,) of 2
    bits: np.ndarray  # (TILE,) the same memory as integers


@njit
def tile(draws):
    """Allocate a `Tile` for N draws."""
    power = np.zeros(TILE)
    return Tile(
        np.zeros((draws, 3, TILE)), np.zeros((draws, TILE)), np.zeros(TILE), np.zeros(TILE),
        power, power.view(np.int64),
    )  # fmt: skip


@njit
def normals(rng, size, out):
    """Three normal numbers a draw for ``size`` samples, sample by sample: the stream's order."""
    for i in range(size):
        for n in range(out.shape[0]):
            out[n, 0, i] = rng.standard_normal()
            out[n, 1, i] = rng.standard_normal()
            out[n, 2, i] = rng.standard_normal()


@njit(inline="always")
def _rate(t, mean, factor, u, v, w):
    """mean + factor (u, v, w) of sample t."""
    return (
        mean[0, t] + factor[0, t] * u,
        mean[1, t] + factor[1, t] * u + factor[2, t] * v,
        mean[2, t] + factor[3, t] * u + factor[4, t] * v + factor[5, t] * w,
    )


@njit(error_model="numpy")
def exponents(first, size, mean, factor, C, b, numbers, out):
    """-(w' C w - 2 b . w) / 2 at mean + factor n, n of ``numbers`` (N, 3, TILE)."""
    for n in range(out.shape[0]):
        for i in range(size):
            t = first + i
            x, y, z = _rate(t, mean, factor, numbers[n, 0, i], numbers[n, 1, i], numbers[n, 2, i])
            out[n, i] = -0.5 * quadratic(
                x, y, z, C, b[0, t], b[1, t], b[2, t], b[3, t], b[4, t], b[5, t]
            )


@njit(inline="always")
def tilted(k, t, x, y, z):
    """log p(omega | y_g) less the log of the density it is drawn from."""
    return (
        k[0, t] + k[1, t] * x + k[2, t] * y + k[3, t] * z
        + k[4, t] * x * x + k[5, t] * y * y + k[6, t] * z * z
        + k[7, t] * x * y + k[8, t] * x * z + k[9, t] * y * z
    )  # fmt: skip


@njit
def tilt(first, size, k, mean, factor, numbers, out):
    """Add `tilted` to `exponents`."""
    for n in range(out.shape[0]):
        for i in range(size):
            t = first + i
            x, y, z = _rate(t, mean, factor, numbers[n, 0, i], numbers[n, 1, i], numbers[n, 2, i])
            out[n, i] += tilted(k, t, x, y, z)


@njit(inline="always")
def _exp_parts(x):
    """(p, k) with exp(x) = p 2^k to an ulp or two, for x in [LEAST, 0]; p by Taylor's series."""
    k = np.floor(x * LOG2E + 0.5)
    r = (x - k * HIGH) - k * LOW
    p = 1.0 / 479001600.0
    p = p * r + 1.0 / 39916800.0
    p = p * r + 1.0 / 3628800.0
    p = p * r + 1.0 / 362880.0
    p = p * r + 1.0 / 40320.0
    p = p * r + 1.0 / 5040.0
    p = p * r + 1.0 / 720.0
    p = p * r + 1.0 / 120.0
    p = p * r + 1.0 / 24.0
    p = p * r + 1.0 / 6.0
    p = p * r + 0.5
    p = p * r + 1.0
    return p * r + 1.0, k


@njit(error_model="numpy")
def _exponentials(size, work):
    """top = the largest exponent of N, total = the sum of exp(exponent - top), by sample."""
    exponent, top, total, power, bits = (
        work.exponent, work.top, work.total, work.power, work.bits
    )  # fmt: skip
    for i in range(size):
        top[i] = exponent[0, i]
        total[i] = 0.0
    for n in range(1, exponent.shape[0]):
        for i in range(size):
            top[i] = max(top[i], exponent[n, i])
    for n in range(exponent.shape[0]):
        for i in range(size):
            p, k = _exp_parts(max(exponent[n, i] - top[i], LEAST))
            exponent[n, i] = p
            power[i] = k + INTEGER
        for i in range(size):
            bits[i] = (bits[i] << 52) + (1023 << 52)
        for i in range(size):
            total[i] += exponent[n, i] * power[i]


@njit
def log_means(size, work):
    """Sum over a tile's samples of the log of the mean exponential, safe from over- and underflow.

    Appendix A of paper 2021. The exponents are used up.
    """
    found, draws = 0.0, work.exponent.shape[0]
    if draws == 1:
        for i in range(size):
            found += work.exponent[0, i]
        return found
    _exponentials(size, work)
    for i in range(size):
        found += work.top[i]
        if work.top[i] > -math.inf:
            found += math.log(work.total[i] / draws)
    return found
