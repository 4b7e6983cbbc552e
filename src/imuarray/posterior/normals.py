"""Normal numbers, many at a time: Box and Muller's pairs, of lanes of SFC64.

The loops, over lanes and over pairs, have no branch and no type but one of 64 bits, so compilers
turn them into vector instructions; numpy's ziggurat, a call for each number, was most of what a
draw of omega cost.
"""

import math
from typing import NamedTuple

import numpy as np

from imuarray.compiled import as_number, fma, njit
from imuarray.posterior.elementary import ONE, log, sin_cos

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
