"""Elementary functions for loops that are to become vector instructions: no branch and no call.

Numbers are taken apart into 2^k m, and series do the rest, to an ulp or two. Each operation is
rounded as written, so other machines give the same bits (`imuarray.compiled.fma` says where more
slowly).
"""

import numpy as np

from imuarray.compiled import as_bits, as_number, fma, njit

ONE = np.uint64(0x3FF0000000000000)  # the bits of 1.0
ROOT_HALF = np.uint64(0x3FE6A09E667F3BCD)  # the bits of sqrt(1/2)
BIAS, PLACES = np.uint64(1023), np.uint64(52)  # of the power of 2 among a number's bits
INTEGER = 1.5 * 2.0**52  # added to a small integer, its bits are the last ones
INTEGER_BITS = np.uint64(0x4338000000000000)  # of INTEGER
LOG2E = 1.4426950408889634
LOG2_HIGH, LOG2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10  # their sum: log 2


@njit(inline="always")
def exp(x):
    """The exponential for x in [-700, 700], a power of 2 times Taylor's series."""
    shifted = fma(x, LOG2E, INTEGER)
    k = shifted - INTEGER
    r = fma(-k, LOG2_LOW, fma(-k, LOG2_HIGH, x))
    p = fma(1.0 / 479001600.0, r, 1.0 / 39916800.0)
    p = fma(p, r, 1.0 / 3628800.0)
    p = fma(p, r, 1.0 / 362880.0)
    p = fma(p, r, 1.0 / 40320.0)
    p = fma(p, r, 1.0 / 5040.0)
    p = fma(p, r, 1.0 / 720.0)
    p = fma(p, r, 1.0 / 120.0)
    p = fma(p, r, 1.0 / 24.0)
    p = fma(p, r, 1.0 / 6.0)
    p = fma(p, r, 0.5)
    p = fma(p, r, 1.0)
    return fma(p, r, 1.0) * as_number((as_bits(shifted) + BIAS) << PLACES)


@njit(inline="always")
def log(u):
    """The logarithm of a positive, normal number: k log 2, and the series of artanh."""
    bits = as_bits(u)
    exponent = (bits + (ONE - ROOT_HALF)) >> PLACES
    m = as_number(bits - ((exponent - BIAS) << PLACES))  # within [sqrt(1/2), sqrt 2)
    k = as_number(INTEGER_BITS + (exponent - BIAS)) - INTEGER
    q = (m - 1.0) / (m + 1.0)
    r = q * q
    p = fma(2.0 / 19.0, r, 2.0 / 17.0)
    p = fma(p, r, 2.0 / 15.0)
    p = fma(p, r, 2.0 / 13.0)
    p = fma(p, r, 2.0 / 11.0)
    p = fma(p, r, 2.0 / 9.0)
    p = fma(p, r, 2.0 / 7.0)
    p = fma(p, r, 2.0 / 5.0)
    p = fma(p, r, 2.0 / 3.0)
    return fma(k, LOG2_HIGH, fma(2.0, q, fma(k, LOG2_LOW, (p * r) * q)))


@njit(inline="always")
def sin_cos(x):
    """(sin x, cos x) within pi / 4 of zero, by Taylor's series."""
    r = x * x
    s = fma(-1.0 / 1307674368000.0, r, 1.0 / 6227020800.0)
    s = fma(s, r, -1.0 / 39916800.0)
    s = fma(s, r, 1.0 / 362880.0)
    s = fma(s, r, -1.0 / 5040.0)
    s = fma(s, r, 1.0 / 120.0)
    s = fma(s, r, -1.0 / 6.0)
    c = fma(1.0 / 20922789888000.0, r, -1.0 / 87178291200.0)
    c = fma(c, r, 1.0 / 479001600.0)
    c = fma(c, r, -1.0 / 3628800.0)
    c = fma(c, r, 1.0 / 40320.0)
    c = fma(c, r, -1.0 / 720.0)
    c = fma(c, r, 1.0 / 24.0)
    c = fma(c, r, -0.5)
    return fma(s * r, x, x), fma(c, r, 1.0)
