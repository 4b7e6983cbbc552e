"""The simulator against rigid-body motion that is integrated and differentiated numerically."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp

from imuarray.model import ArrayModel, kinematics, structure_tensor
from imuarray.model.structure import design, products
from imuarray.motion import Motion, hand_twisting, normal_motion, sphere_motion
from imuarray_papers import reference
from tests.cases import small_array

STEP = 1e-3  # s; error of the stencils below: about (100 rad/s x 1 ms)^8
FIRST = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840.0
SECOND = np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / 5040.0
GRAVITY = np.array([0.0, 0.0, -9.81])


def twisting(seed=1):
    return hand_twisting(np.random.default_rng(seed), 12.0, 20.0)


def integrate(motion, times):
    """Orientation (T, 3, 3), body to world, and the reference triad's place (T, 3)."""

    def slope(t, state):
        now = motion.at(np.array([t]))
        R = state[:9].reshape(3, 3)
        turning = R @ reference.skew(now.angular_rate[0])
        return np.concatenate([turning.ravel(), state[12:], R @ now.specific_force[0] + GRAVITY])

    start = np.concatenate([np.eye(3).ravel(), np.zeros(6)])
    out = solve_ivp(
        slope, (0, times[-1]), start, "DOP853", t_eval=times, rtol=1e-13, atol=1e-13, max_step=2e-3
    )
    return out.y[:9].T.reshape(-1, 3, 3), out.y[9:12].T


@pytest.fixture(scope="module")
def path():
    times = np.arange(0, 201) * STEP
    motion = twisting()
    return motion, times, *integrate(motion, times)


def stencil(values, weights, order):
    """Derivative of (T, ...) samples at every time four or more from the ends."""
    windows = np.lib.stride_tricks.sliding_window_view(values, 9, axis=0)
    return windows @ weights / STEP**order


def test_specific_force_is_what_moving_triads_feel(path):
    """u_k = R' (x_k'' - g), with x_k = p + R r_k differentiated twice."""
    motion, times, R, p = path
    array = small_array()
    x = p[:, None] + np.einsum("tij,kj->tki", R, array.relative)
    felt = np.einsum("tji,tkj->tki", R[4:-4], stencil(x, SECOND, 2) - GRAVITY)
    model = ArrayModel.isotropic(array, 0.04, 0.001)
    predicted = model.predict_many(motion.at(times[4:-4]), array.relative)
    assert np.std(predicted.specific_force) > 5.0
    np.testing.assert_allclose(predicted.specific_force, felt, atol=1e-5)


def test_angular_rate_is_that_of_the_orientation(path):
    motion, times, R, _ = path
    array = small_array()
    turning = np.einsum("tji,tjk->tik", R[4:-4], stencil(R, FIRST, 1))
    rate = np.stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1)
    predicted = ArrayModel.isotropic(array, 0.04, 0.001).predict_many(
        motion.at(times[4:-4]), array.relative
    )
    for gyroscope in range(array.gyroscopes):
        np.testing.assert_allclose(predicted.angular_rate[:, gyroscope], rate, atol=1e-7)


def test_predict_many_takes_a_geometry_per_realisation():
    rng = np.random.default_rng(2)
    array = small_array()
    model = ArrayModel.isotropic(array, 0.04, 0.001)
    motion = normal_motion(rng, (3, 4), 10.0, 300.0, 20.0)
    positions = array.relative + 1e-3 * rng.standard_normal((3, 5, 3))
    together = model.predict_many(motion, positions)
    for i in range(3):
        alone = model.predict_many(motion.select(i), positions[i])
        np.testing.assert_allclose(together.specific_force[i], alone.specific_force, rtol=1e-13)


def test_smooth_motion_gives_its_own_derivatives():
    motion, times = twisting(3), np.arange(0, 400) * STEP
    at, inner = motion.at(times), motion.at(times[4:-4])
    pairs = [
        (at.angular_rate, FIRST, 1, inner.angular_acceleration),
        (at.angular_rate, SECOND, 2, inner.angular_jerk),
        (at.specific_force, FIRST, 1, inner.force_rate),
    ]
    for values, weights, order, exact in pairs:
        np.testing.assert_allclose(
            stencil(values, weights, order), exact, atol=1e-7 * np.abs(exact).max()
        )


def test_smooth_motion_has_the_sds_asked_for():
    """Seed 4; time averages over 60 s of 200 waves vary by some 5 %: 25 % is five sigma."""
    motion = hand_twisting(np.random.default_rng(4), 12.0, 20.0, waves=200)
    at = motion.at(np.linspace(0, 60, 20001))
    np.testing.assert_allclose(at.angular_rate.std(axis=0), 12.0, rtol=0.25)
    np.testing.assert_allclose(at.specific_force.std(axis=0), 20.0, rtol=0.25)


def test_force_rate_is_the_time_derivative_at_each_triad():
    motion, times, r = twisting(5), np.arange(0, 50) * STEP, small_array().relative
    at = motion.at(times)
    force = np.stack([np.asarray(kinematics.specific_force(at.select(t), r)) for t in range(50)])
    exact = np.stack([np.asarray(kinematics.force_rate(at.select(t), r)) for t in range(4, 46)])
    np.testing.assert_allclose(stencil(force, FIRST, 1), exact, atol=1e-7 * np.abs(exact).max())


def test_random_motions_have_their_magnitudes():
    """Seed 6; sds of 30 000 normals are within 2.5 % (six sigma: false alarm 1e-8)."""
    rng = np.random.default_rng(6)
    sizes = (3.0, 40.0, 9.0)
    for field, size in zip(sphere_motion(rng, (2, 50), *sizes)[:3], sizes, strict=True):
        assert field.shape == (2, 50, 3)
        np.testing.assert_allclose(np.linalg.norm(field, axis=-1), size, rtol=1e-13)
    five = (*sizes, 5.0, 7.0)
    for field, size in zip(normal_motion(rng, (10000,), *five), five, strict=True):
        assert np.std(field) == pytest.approx(size, rel=0.025)


vectors = arrays(float, 3, elements=st.floats(-50, 50))
SETTINGS = settings(max_examples=50, deadline=None)


@SETTINGS
@given(vectors, vectors, vectors, arrays(float, (4, 3), elements=st.floats(-0.1, 0.1)))
def test_specific_force_is_h_plus_H_phi(rate, acceleration, force, positions):
    """The forward function against (5a) in its direct form."""
    motion = Motion.of(rate, acceleration, force)
    direct = reference.nonlinear_part(rate, positions)
    direct = direct + reference.linear_part(positions) @ np.concatenate([acceleration, force])
    found = np.asarray(kinematics.specific_force(motion, positions)).ravel()
    np.testing.assert_allclose(found, direct, atol=1e-9)


@SETTINGS
@given(vectors, arrays(float, (4, 3), elements=st.floats(-0.1, 0.1)))
def test_design_is_B_and_H(rate, positions):
    both = design(positions)
    np.testing.assert_allclose(both[:, 6:], reference.linear_part(positions), atol=1e-14)
    np.testing.assert_allclose(
        both[:, :6] @ products(rate), reference.nonlinear_part(rate, positions), atol=1e-9
    )


def test_structure_tensor_cannot_be_written_to():
    with pytest.raises(ValueError):
        structure_tensor()[0, 0, 0] = 1.0
