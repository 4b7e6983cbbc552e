"""Noise by restricted likelihood, against the truth, as few degrees of freedom allow."""

import numpy as np
import pytest

import imuarray
from imuarray.analysis.density import posterior_of
from imuarray.geometry import sub_array


def recording(samples, seed=1, triads=8, **options):
    array = sub_array(imuarray.mimu4444(), triads)
    made, _ = imuarray.simulate(
        array, duration=samples / 50.0, sampling_rate=50.0, seed=seed, **options
    )
    return made


def ratios(made, louder=None):
    """Noise found, over the declared one, (A, 3) and (G, 3)."""
    if louder is not None:
        rng = np.random.default_rng(2)
        shape = made.specific_force.shape[0], 3
        made.specific_force[:, louder] += 0.12 * rng.standard_normal(shape)
    noise = posterior_of(made).model.noise
    return (np.sqrt(np.diag(noise.accelerometer)).reshape(-1, 3) / made.accelerometer_noise_sd,
            np.sqrt(np.diag(noise.gyroscope)).reshape(-1, 3) / made.gyroscope_noise_sd)  # fmt: skip


def test_each_triad_has_its_own():
    """One of eight accelerometers is sqrt(10) times as loud; T = 200."""
    found, rates = ratios(recording(200), louder=3)
    assert found[3, 0] == pytest.approx(10**0.5, rel=0.12)
    others = np.delete(found[:, 0], 3)
    np.testing.assert_allclose(others, 1.0, atol=0.12)
    np.testing.assert_allclose(rates, 1.0, atol=0.12)


def test_few_samples_share_one_factor_without_bias():
    """T = 5, four triads: chi-square over its freedom, less the motion's and the positions'."""
    squares = []
    for seed in range(12):
        found, rates = ratios(recording(5, seed, 4))
        assert np.ptp(found) < 1e-12 and np.ptp(rates) < 1e-12
        squares.append([found[0, 0] ** 2, rates[0, 0] ** 2])
    # some 25 and 45 degrees of freedom each
    np.testing.assert_allclose(np.mean(squares, axis=0), 1.0, atol=0.25)


def test_what_is_known_is_kept():
    made = recording(100, triads=4)
    found = posterior_of(made, known=True)
    np.testing.assert_array_equal(found.model.noise.accelerometer, 0.04**2 * np.eye(12))
    assert found.scales == ("gyroscope_noise", "angular_rate", "angular_acceleration")


def test_the_motions_size_is_that_of_the_motion_not_of_its_noise():
    """Four triads nearly on a line, 1 m/s^2: about it omega_dot's estimate is noise, 5 times as
    large as the motion."""
    quiet, loud = (
        posterior_of(made).model.motion_sd
        for made in (recording(300, triads=4, accelerometer_noise=noise) for noise in (0.04, 1.0))
    )
    assert np.isinf(quiet[2]) and np.isinf(loud[2])
    np.testing.assert_allclose(np.divide(loud[:2], quiet[:2]), 1.0, atol=0.15)
