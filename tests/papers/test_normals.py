"""The vectorised normal numbers against numpy's SFC64, the C library and the normal law."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from numba.core.errors import TypingError
from scipy import stats

from imuarray_papers import compiled
from imuarray_papers.posterior import normals


def filled(count, seed=1):
    rng = np.random.default_rng(seed)
    source = normals.source(rng, count)
    out = np.full(normals.room(count), np.nan)
    start = source.state.copy()
    normals.fill(source, count, out)
    return out, start, source


def lane(state, i, count):
    """Words of lane ``i`` by numpy's own SFC64."""
    generator = np.random.SFC64()
    words = state[:, i].copy()
    words[3] = state[3, 0]
    generator.state = {**generator.state, "state": {"state": words}}
    return generator.random_raw(count)


@pytest.mark.parametrize("count", [1, 5, normals.BLOCK, normals.BLOCK + 1, 1000])
def test_words_are_those_of_numpy(count):
    """Every lane, over several calls: the counter goes on."""
    _, start, source = filled(count)
    rows = normals.room(count) // normals.LANES
    found = [source.words.copy()]
    normals.fill(source, count, np.empty(normals.room(count)))
    found.append(source.words)
    found = np.concatenate(found).reshape(2 * rows, normals.LANES)
    for i in range(normals.LANES):
        np.testing.assert_array_equal(found[:, i], lane(start, i, 2 * rows))
    assert np.unique(found).size == found.size


def test_numbers_are_box_and_mullers():
    """Of those words: a radius from one, an angle and its half of the circle from another."""
    out, _, source = filled(20000)
    radius, angle = source.words.reshape(2, -1)
    u = ((radius >> np.uint64(12)).astype(float) + 0.5) * 2.0**-52
    v = ((angle >> np.uint64(12)).astype(float) + 0.5) * 2.0**-52
    length, turn = np.sqrt(-2.0 * np.log(u)), math.pi * (v - 0.5)
    sign = np.where(angle & np.uint64(1), -1.0, 1.0)
    np.testing.assert_allclose(out[: length.size], sign * length * np.cos(turn), atol=4e-15)
    np.testing.assert_allclose(out[length.size :], length * np.sin(turn), atol=4e-15)


def test_seeds_are_whole():
    """Every bit of the 48 words is drawn, and no two words are alike."""
    words = np.concatenate([filled(1, seed)[1][:3].ravel() for seed in range(4)])
    assert np.unique(words).size == 4 * 48
    bits = words[:, None] >> np.arange(64, dtype=np.uint64) & np.uint64(1)
    means = bits.mean(axis=0)
    assert means.min() > 0.25 and means.max() < 0.75  # seven sds: 1e-11


def test_room_is_checked():
    """Compiled code would write behind an array without a word."""
    source = normals.source(np.random.default_rng(1), 40)
    for count, size in ((5, 5), (33, 32), (65, 96)):
        with pytest.raises(ValueError, match="room"):
            normals.fill(source, count, np.zeros(size))


def test_other_processors_give_the_same_numbers(tmp_path):
    """To the last bits, one without vectors of 32 bytes and fused multiplications among them."""
    code = (
        "import numpy as np; from imuarray_papers.posterior import normals;"
        "source = normals.source(np.random.default_rng(1), 6400); out = np.zeros(6400);"
        f"normals.fill(source, 6400, out); np.save({str(tmp_path / 'out.npy')!r}, out)"
    )
    given = os.environ | {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    subprocess.run([sys.executable, "-c", code], env=given, check=True)
    np.testing.assert_allclose(np.load(tmp_path / "out.npy"), filled(6400)[0], atol=4e-15)


def test_bits_of_other_types_do_not_compile():
    for function, value in ((compiled.as_number, 1.0), (compiled.as_bits, 1)):
        with pytest.raises(TypingError):
            compiled.njit(lambda x, function=function: function(x))(value)


@pytest.mark.parametrize(
    ("word", "u"), [(0, 2.0**-53), (2**64 - 1, 1.0 - 2.0**-53), (2**63, 0.5 + 2.0**-53)]
)
def test_radius_of_the_extremes(word, u):
    assert normals._radius(np.uint64(word)) == pytest.approx(math.sqrt(-2 * math.log(u)), rel=1e-14)


def test_direction_of_the_extremes():
    low, high = (normals._direction(np.uint64(word)) for word in (0, 2**64 - 1))
    assert low == (-high[0], high[1]) == pytest.approx((-math.sqrt(0.5), math.sqrt(0.5)), rel=1e-15)


def test_law():
    """Two million numbers, seed 1: distribution, and no two alike or correlated.

    False alarms: 1e-4 for the distribution, some 1e-6 for each of the 9 others.
    """
    out, _, _ = filled(2**21)
    assert stats.kstest(out, "norm").pvalue > 1e-4
    first, second = out.reshape(2, -1)
    rows = out.reshape(-1, normals.LANES)
    pairs = {
        "of one radius and angle": (first, second),
        "neighbours": (out[:-1], out[1:]),
        "of one lane": (rows[:-1], rows[1:]),
    }
    for one, other in pairs.values():
        for power in (1, 2, 3):
            x, y = one.ravel() ** power, other.ravel() ** power
            x, y = (x - x.mean()) / x.std(), (y - y.mean()) / y.std()
            products = x * y
            assert abs(products.mean()) < 5 * products.std() / math.sqrt(products.size)
    assert np.unique(out).size > 0.9999 * out.size


def test_tails():
    """Sixteen million numbers, seed 2; false alarms 1e-6 each, on either side."""
    out, _, _ = filled(2**24, 2)
    for limit in (3.0, 4.0, 4.5):
        law = stats.poisson(stats.norm.sf(limit) * out.size)
        assert law.cdf(0) < 1e-6  # an empty tail is seen
        for beyond in (np.sum(out > limit), np.sum(out < -limit)):
            assert min(law.cdf(beyond), law.sf(beyond - 1)) > 1e-6
    assert np.abs(out).max() > 4.9


def test_streams_differ():
    one, two = filled(1000, 1)[0], filled(1000, 2)[0]
    assert np.intersect1d(one, two).size == 0
    np.testing.assert_array_equal(one, filled(1000, 1)[0])
