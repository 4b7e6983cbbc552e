"""Elementary functions of our own against the C library's."""

import numpy as np
import pytest

from imuarray_papers.posterior import draws
from imuarray_papers.posterior import normals as elementary


def test_exponential():
    """To two units in the last place over the range in use; no number stays none."""
    values = np.concatenate([-np.logspace(-300, np.log10(-draws.LEAST), 4000), [0.0]])
    found = [elementary.exp(value) for value in values]
    np.testing.assert_allclose(found, np.exp(values), rtol=5e-16)
    assert np.isnan(elementary.exp(np.nan))


def test_logarithm():
    """The same, close to 1 as well, where the logarithm itself is small."""
    near = 1.0 - np.logspace(-15.9, -1, 2000)
    values = np.concatenate([np.logspace(-300, 300, 4000), near, 1.0 / near, [1.0]])
    found = [elementary.log(value) for value in values]
    np.testing.assert_allclose(found, np.log(values), rtol=5e-16)


def test_sine_and_cosine():
    angles = np.concatenate([np.linspace(-np.pi / 4, np.pi / 4, 4001), np.logspace(-300, -1, 500)])
    sines, cosines = np.array([elementary.sin_cos(angle) for angle in angles]).T
    np.testing.assert_allclose(sines, np.sin(angles), rtol=5e-16)
    np.testing.assert_allclose(cosines, np.cos(angles), rtol=5e-16)


@pytest.mark.parametrize("x", [-700.0, 700.0])
def test_exponential_at_its_ends(x):
    assert elementary.exp(x) == pytest.approx(np.exp(x), rel=5e-16)
