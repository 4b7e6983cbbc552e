"""Elementary functions for loops that are to become vector instructions: no branch and no call.

Numbers are taken apart into 2^k m, and series do the rest, to an ulp or two. Processors with a
fused multiply-add (`imuarray.compiled.fma`) give the same bits, others differ in the last one.
"""

import math

import numpy as np

from imuarray.compiled import as_bits, as_number, fma, njit

ONE = np.uint64(0x3FF0000000000000)  # the bits of 1.0
ROOT_HALF = np.uint64(0x3FE6A09E667F3BCD)  # the bits of sqrt(1/2)
BIAS, PLACES = np.uint64(1023), np.uint64(52)  # of the power of 2 among a number's bits
INTEGER = 1.5 * 2.0**52  # added to a small integer, its bits are the last ones
INTEGER_BITS = np.uint64(0x4338000000000000)  # of INTEGER
LOG2E = 1.4426950408889634
LOG2_HIGH, LOG2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10  # their sum: log 2


EXP = tuple(1.0 / math.factorial(k) for k in range(12, -1, -1))
ARTANH = tuple(2.0 / k for k in range(19, 2, -2))
SIN = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(7, 0, -1))
COS = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(8, -1, -1))


@njit(inline="always")
def _horner(x, coefficients):
    """A polynomial, the coefficient of the highest power first."""
    p = coefficients[0]
    for c in coefficients[1:]:
        p = fma(p, x, c)
    return p


@njit(inline="always")
def exp(x):
    """The exponential for x in [-700, 700], a power of 2 times Taylor's series."""
    shifted = fma(x, LOG2E, INTEGER)
    k = shifted - INTEGER
    r = fma(-k, LOG2_LOW, fma(-k, LOG2_HIGH, x))
    return _horner(r, EXP) * as_number((as_bits(shifted) + BIAS) << PLACES)


@njit(inline="always")
def log(u):
    """The logarithm of a positive, normal number: k log 2, and the series of artanh."""
    bits = as_bits(u)
    exponent = (bits + (ONE - ROOT_HALF)) >> PLACES
    m = as_number(bits - ((exponent - BIAS) << PLACES))  # within [sqrt(1/2), sqrt 2)
    k = as_number(INTEGER_BITS + (exponent - BIAS)) - INTEGER
    q = (m - 1.0) / (m + 1.0)
    r = q * q
    p = _horner(r, ARTANH)
    return fma(k, LOG2_HIGH, fma(2.0, q, fma(k, LOG2_LOW, (p * r) * q)))


@njit(inline="always")
def sin_cos(x):
    """(sin x, cos x) within pi / 4 of zero, by Taylor's series."""
    r = x * x
    return fma(_horner(r, SIN) * r, x, x), _horner(r, COS)
