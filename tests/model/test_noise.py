"""Noise: its forms, its draws, and what gyroscopes say of omega."""

import numpy as np
import pytest

from imuarray.errors import InputError
from imuarray.model import Noise
from tests.cases import random_covariance


def test_forms_of_a_covariance():
    rng = np.random.default_rng(1)
    blocks = np.stack([random_covariance(rng, 3, 0.1) for _ in range(2)])
    full = random_covariance(rng, 6, 0.1)
    zero = np.zeros((3, 3))
    cases = [
        (0.1, 0.01 * np.eye(6)),
        ([0.1, 0.2], np.diag([0.01] * 3 + [0.04] * 3)),
        (blocks, np.block([[blocks[0], zero], [zero, blocks[1]]])),
        (full, full),
    ]
    for given, expected in cases:
        noise = Noise.of(2, 2, given, given)
        np.testing.assert_allclose(noise.accelerometer, expected, rtol=1e-14)
        np.testing.assert_allclose(noise.gyroscope, expected, rtol=1e-14)
        np.testing.assert_allclose(noise.accelerometer_precision @ expected, np.eye(6), atol=1e-9)


def test_triad_weights_only_for_isotropic_triads():
    np.testing.assert_allclose(Noise.of(2, 1, [0.1, 0.2], 1.0).triad_weights, [100.0, 25.0])
    uneven = np.stack([np.eye(3), np.diag([1.0, 1.0, 2.0])])
    assert Noise.of(2, 1, uneven, 1.0).triad_weights is None
    crosstalk = np.eye(6)
    crosstalk[0, 3] = crosstalk[3, 0] = 0.1
    assert Noise.of(2, 1, crosstalk, 1.0).triad_weights is None


@pytest.mark.parametrize(
    "given",
    [
        [0.1, 0.1, 0.1],
        np.ones((2, 2)),
        0.0,
        [0.1, 0.0],
        np.stack([np.eye(3), -np.eye(3)]),
        np.stack([np.eye(3), np.triu(np.ones((3, 3)))]),
        np.ones((6, 6)),
        float("nan"),
        [0.1, float("nan")],
    ],
)
@pytest.mark.parametrize("kind", ["accelerometer", "gyroscope"])
def test_noise_errors(given, kind):
    values = {"accelerometer": 0.1, "gyroscope": 0.1, kind: given}
    with pytest.raises(InputError, match=f"{kind} noise"):
        Noise.of(2, 2, values["accelerometer"], values["gyroscope"])


def test_draws_have_the_covariance():
    """Seed 2; 40 000 draws: whitened, no entry of the sample covariance is off by six of its
    standard errors (false alarm below 2e-7 for all 90)."""
    rng = np.random.default_rng(2)
    noise = Noise.of(2, 3, random_covariance(rng, 6, 0.3), np.array([0.1, 0.2, 0.4]))
    force, rate = noise.draw(rng, (200, 200))
    assert (force.shape, rate.shape) == ((200, 200, 2, 3), (200, 200, 3, 3))
    for draws, covariance in ((force, noise.accelerometer), (rate, noise.gyroscope)):
        flat = draws.reshape(40000, -1)
        white = np.linalg.solve(np.linalg.cholesky(covariance), flat.T)
        error = white @ white.T / 40000 - np.eye(len(white))
        assert np.abs(error).max() < 6 * np.sqrt(2 / 40000)
        assert np.abs(white.mean(axis=1)).max() < 6 / np.sqrt(40000)


def direct(angular_rate, covariance, keep):
    """Weighted least squares of one sample's kept axes; information where it has rank 3."""
    stack = np.tile(np.eye(3), (len(angular_rate), 1))[keep]
    factor = np.linalg.cholesky(covariance[np.ix_(keep, keep)])
    white = np.linalg.solve(factor, stack)
    values = np.linalg.solve(factor, angular_rate.ravel()[keep])
    return np.linalg.lstsq(white, values, rcond=None)[0], white.T @ white


@pytest.mark.parametrize("correlated", [False, True])
@pytest.mark.parametrize("masked", [False, True])
def test_rate_given_gyroscopes(correlated, masked):
    rng = np.random.default_rng(3)
    covariance = random_covariance(rng, 12, 0.2) if correlated else [0.1, 0.2, 0.3, 0.4]
    noise = Noise.of(3, 4, 1.0, covariance)
    rate = 5 * rng.standard_normal((40, 4, 3))
    saturated = rng.random((40, 4, 3)) < 0.4
    saturated[:, 0] = False  # each axis is seen once at least
    mean, information = noise.angular_rate_given_gyroscopes(rate, saturated if masked else None)
    for t in range(40):
        keep = ~saturated[t].ravel() if masked else np.ones(12, bool)
        expected, precision = direct(rate[t], noise.gyroscope, keep)
        np.testing.assert_allclose(mean[t], expected, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(information[t], precision, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("correlated", [False, True])
def test_axes_that_no_gyroscope_sees(correlated):
    """No information about them; the mean is the plain average of what was read."""
    rng = np.random.default_rng(4)
    noise = Noise.of(3, 2, 1.0, random_covariance(rng, 6, 0.2) if correlated else 0.1)
    rate = rng.standard_normal((2, 2, 3))
    saturated = np.zeros((2, 2, 3), bool)
    saturated[0, :, 1] = True
    saturated[1] = True
    mean, information = noise.angular_rate_given_gyroscopes(rate, saturated)
    np.testing.assert_array_equal(information[0][1], 0)
    np.testing.assert_array_equal(information[1], 0)
    assert mean[0, 1] == pytest.approx(rate[0, :, 1].mean())
    np.testing.assert_allclose(mean[1], rate[1].mean(axis=0))
    keep = ~saturated[0].ravel()
    expected, _ = direct(rate[0], noise.gyroscope, keep)
    np.testing.assert_allclose(mean[0, [0, 2]], expected[[0, 2]], rtol=1e-9)
