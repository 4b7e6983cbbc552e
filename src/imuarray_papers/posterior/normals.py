"""Normal numbers, many at a time: Box and Muller's pairs, of lanes of SFC64.

The loops, over lanes and over pairs, have no branch and no type but one of 64 bits, so compilers
turn them into vector instructions; numpy's ziggurat, a call for each number, was most of what a
draw of omega cost.

The elementary functions that this needs have no branch and no call: numbers are taken apart into
2^k m, and series do the rest, to an ulp or two. Processors with a fused multiply-add
(`imuarray_papers.compiled.fma`) give the same bits, others differ in the last one.
"""

import math
from typing import NamedTuple

import numpy as np

from imuarray_papers.compiled import as_bits, as_number, fma, njit

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


LANES = 16
BLOCK = 2 * LANES  # numbers that a step of all lanes gives
BELOW_ONE = 1.0 - 2.0**-53
S1, S3, S11, S12, S24, S40, S63 = (np.uint64(n) for n in (1, 3, 11, 12, 24, 40, 63))


class Source(NamedTuple):
    """The lanes, and scratch memory for so many numbers."""

    state: np.ndarray  # (4, LANES) uint64; of the last row the first number counts
    words: np.ndarray  # (numbers,) uint64


@njit
def room(count):
    """Size of an array that `fill` can put ``count`` numbers into."""
    return (count + BLOCK - 1) // BLOCK * BLOCK


@njit
def source(rng, count):
    """A `Source` whose lanes start at 192 bits each from ``rng`` (numpy.random.Generator).

    All of a lane's bits are random, so SFC64 needs none of the rounds that spread a short seed.
    """
    state = np.ones((4, LANES), np.uint64)
    for k in range(3):
        for i in range(LANES):
            state[k, i] = np.uint64(rng.random() * 2.0**53) << S11
            state[k, i] ^= np.uint64(rng.random() * 2.0**53)
    return Source(state, np.empty(room(count), np.uint64))


@njit(inline="always")
def _step(a, b, c, counter):
    """A word and the next state of SFC64, as numpy.random.SFC64 has it."""
    word = a + b + counter
    return word, b ^ (b >> S11), c + (c << S3), ((c << S24) | (c >> S40)) + word


@njit
def _words(a, b, c, counter, out):
    """One word of each lane in turn into the rows of ``out`` (an even number, LANES)."""
    for k in range(0, out.shape[0], 2):
        for i in range(a.size):
            out[k, i], x, y, z = _step(a[i], b[i], c[i], counter)
            out[k + 1, i], a[i], b[i], c[i] = _step(x, y, z, counter + S1)
        counter += np.uint64(2)
    return counter


@njit(inline="always")
def _radius(word):
    """sqrt(-2 log u), u the word's first 52 bits and a half more, times 2^-52."""
    u = as_number((word >> S12) | ONE) - BELOW_ONE  # exact; (0, 1)
    return math.sqrt(-2.0 * log(u))


@njit(inline="always")
def _direction(word):
    """(sin, cos) of an angle within pi / 4 of zero: the word's first 52 bits and a half more."""
    return sin_cos((as_number((word >> S12) | ONE) - 1.5 + 2.0**-53) * (0.5 * math.pi))


@njit(error_model="numpy")
def _pairs(radii, angles, first, second):
    """Box and Muller's, of two words each: a radius and twice an angle, on half a circle or other.

    Indices count from zero: the compiler must see that none is negative, for those would be looked
    up number by number. Two short loops keep a processor busier than a long one.
    """
    for i in range(first.size):
        first[i] = _radius(radii[i])
    for i in range(first.size):
        s, c = _direction(angles[i])
        radius = first[i]
        twice = (radius + radius) * s
        sign = as_number((angles[i] << S63) | ONE)
        first[i] = sign * fma(-twice, s, radius)
        second[i] = twice * c


@njit
def fill(source, count, out):
    """Normal numbers into ``out``, at least its first ``count``; its size `room` of that or more.

    ValueError where it is less, or more than the source was made for.
    """
    rows = 2 * ((count + BLOCK - 1) // BLOCK)
    if out.size < rows * LANES or source.words.size < rows * LANES:
        raise ValueError("fill: more numbers asked for than there is room for")
    words, state = source.words[: rows * LANES], source.state
    a, b, c, counter = state[0], state[1], state[2], state[3]
    counter[0] = _words(a, b, c, counter[0], words.reshape((rows, LANES)))
    half = words.size // 2
    _pairs(words[:half], words[half:], out[:half], out[half : 2 * half])
