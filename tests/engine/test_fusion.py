"""The array as one sensor: motion with covariances that hold."""

from dataclasses import replace

import numpy as np
import pytest

from imuarray.engine.fusion import fuse
from imuarray.errors import IdentifiabilityError
from imuarray.motion import hand_twisting, normal_motion
from imuarray.simulation.recordings import measure
from tests import oracles
from tests.cases import model

SDS = 20.0, 300.0, 10.0  # rad/s, rad/s^2, m/s^2


def errors(rail=np.inf, wrong=0.0, samples=400, seed=1):
    """(errors (T, 9), what was fused): positions off by ``wrong`` m, as their covariance says."""
    rng, own = np.random.default_rng(seed), model()
    motion = normal_motion(rng, (samples,), *SDS)
    force, rate, saturated = measure(own, motion, own.array.relative, rng, gyroscope_range=rail)
    positions = own.array.relative.copy()
    positions[1:] += wrong * rng.standard_normal((4, 3))
    spread = wrong**2 * np.eye(12) if wrong else None
    found = fuse(own, force, rate, positions[1:].ravel(), spread, saturated)
    truth = np.hstack([np.asarray(field) for field in motion[:3]])
    estimate = np.hstack([np.asarray(field) for field in found.estimate.motion[:3]])
    return estimate - truth, found


@pytest.mark.parametrize("rail", [np.inf, 20.0])
def test_errors_are_as_large_as_their_covariance_says(rail):
    """e' P^-1 e is chi-square with nine degrees of freedom: mean 9, five standard errors."""
    error, found = errors(rail)
    assert np.all(found.estimate.converged) and not np.any(found.from_calibration)
    square = np.einsum(
        "ti,ti->t", error, np.linalg.solve(found.covariance, error[..., None])[..., 0]
    )
    assert abs(square.mean() - 9) < 5 * np.sqrt(18 / len(square))


def test_covariance_is_that_of_the_direct_jacobian():
    rng, own = np.random.default_rng(2), model()
    motion = normal_motion(rng, (5,), *SDS)
    force, rate = own.predict_many(motion, own.array.relative)
    found = fuse(own, force, rate)
    jacobian = oracles.joint_jacobian(
        np.hstack(motion[:3]), own.array.relative, 5, 0.04, 0.02
    )[:, 12:]  # fmt: skip
    whole = np.linalg.inv(jacobian.T @ jacobian).reshape(5, 9, 5, 9)
    direct = np.stack([whole[t, :, t] for t in range(5)])
    np.testing.assert_allclose(found.covariance, direct, rtol=1e-6, atol=1e-12)


def test_wrong_positions_are_in_the_covariance():
    """Positions 1 mm off, drawn anew each time: 100 fusions of 5 samples."""
    squares = []
    for seed in range(100):
        error, found = errors(wrong=1e-3, samples=5, seed=seed)
        assert np.all(np.trace(found.from_calibration, axis1=1, axis2=2) > 0)
        last = np.linalg.solve(found.covariance[-1], error[-1])
        squares.append(error[-1] @ last)
    assert abs(np.mean(squares) - 9) < 5 * np.sqrt(18 / 100)


def test_collinear_triads_are_refused():
    own = model()
    line = own.array.relative * [1.0, 0.0, 0.0]
    with pytest.raises(IdentifiabilityError):
        fuse(own, np.zeros((2, 5, 3)), np.zeros((2, 5, 3)), line[1:].ravel())


def test_an_effect_of_no_size_changes_nothing():
    """Two ways to one motion: collapsed, and searched under an effect; rails and positions."""
    own, rng = model(), np.random.default_rng(4)
    motion = normal_motion(rng, (30,), 15.0, 300.0, 10.0)
    force, rate, saturated = measure(own, motion, own.array.relative, rng, gyroscope_range=25.0)
    p = own.array.parameters
    spread = np.diag(np.full(p.size, 1e-8))
    one = fuse(own, force, rate, None, spread, saturated)
    whole, wide = np.append(p, np.zeros(15)), np.zeros((p.size + 15,) * 2)
    wide[: p.size, : p.size] = spread
    biased = replace(own, effects=("gyroscope_bias",))
    other = fuse(biased, force, rate, whole, wide, saturated)
    assert saturated.any() and other.estimate.converged.all()
    for a, b in zip(one.estimate.motion[:3], other.estimate.motion[:3], strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-4, atol=1e-10)
    np.testing.assert_allclose(one.from_calibration, other.from_calibration, rtol=1e-4, atol=1e-10)


@pytest.mark.parametrize("name", ["gyroscope_scale", "sensor_delay", "gyroscope_bias"])
def test_errors_under_a_known_effect_are_as_large_as_their_covariance_says(name):
    """Nine of them, whether the motion has its higher derivatives or not."""
    own, samples = replace(model(), effects=(name,)), 200
    rng = np.random.default_rng(6)
    moved = hand_twisting(rng, 15.0, 10.0).at(np.arange(samples) / 100.0)
    sizes = [float(np.sqrt(np.mean(np.square(field)))) for field in moved[3:]]
    own = replace(own, derivative_sd=tuple(sizes))
    parameters = 0.3 * own.effect_prior_sd * rng.standard_normal(own.effect_size)
    force, rate, saturated = measure(
        own, moved, own.array.relative, rng, parameters, gyroscope_range=20.0
    )
    whole = np.concatenate([own.array.parameters, parameters])
    found = fuse(own, force, rate, whole, None, saturated)
    assert saturated.any() and found.estimate.converged.all()
    pairs = zip(found.estimate.motion[:3], moved[:3], strict=True)
    error = np.hstack([np.asarray(one) - other for one, other in pairs])
    square = np.einsum(
        "ti,ti->t", error, np.linalg.solve(found.covariance, error[..., None])[..., 0]
    )
    assert abs(square.mean() - 9) < 5 * np.sqrt(18 / samples)


@pytest.mark.parametrize("name", ["sensor_delay", "gyroscope_delay"])
def test_delays_count_beyond_the_first_order(name):
    """Readings of other instants, 4 ms later, not of an expansion about the same one."""
    own, late, time = model(), 0.004, np.arange(600) / 100.0
    hand, rng = hand_twisting(np.random.default_rng(6), 12.0, 5.0, 4.0), np.random.default_rng(7)
    moved = hand.at(time)
    force, rate, _ = measure(own, moved, own.array.relative, rng)
    other, turning, _ = measure(own, hand.at(time + late), own.array.relative, rng)
    if name == "sensor_delay":
        force[:, 2], rate[:, 2] = other[:, 2], turning[:, 2]
        delays = late * (np.arange(5) == 2)
    else:
        rate, delays = turning, np.full(5, late)
    parameters = np.concatenate([own.array.parameters, delays])
    found = fuse(replace(own, effects=(name,)), force, rate, parameters, time=time, span=6.0)
    pairs = zip(found.estimate.motion[:3], moved[:3], strict=True)
    error = np.hstack([np.asarray(one) - truth for one, truth in pairs])[20:-20]
    sds = np.sqrt(np.einsum("tii->ti", found.covariance))[20:-20]
    z = np.sqrt(np.mean((error / sds) ** 2, axis=0))
    assert z.max() < 1.35, z
