"""Joint Gauss-Newton in collapsed form, and its recursive use, against the general estimators."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from imuarray.errors import IdentifiabilityError, InputError
from imuarray.estimation import calibrate_gauss_newton
from imuarray.estimation.blocks import normal_equations
from imuarray.estimation.blocks import problem as problem_of
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.gauss_newton import calibrate_blocks
from imuarray.estimation.newton import _one_thread, descend
from imuarray.estimation.online import Online
from imuarray.model import EFFECTS, ArrayModel, Noise
from tests import oracles
from tests.cases import measure, noises, simulate, small_array
from tests.test_bcd import problem, solution


def test_is_the_optimum_of_bcd():
    """`test_bcd` has it from a general optimiser over positions and motion together."""
    model, _, force, rate = problem()
    found = calibrate_gauss_newton(model, force, rate, tolerance=1e-7)
    assert found.converged
    assert len(found.cost) <= 10 < len(solution().cost)
    np.testing.assert_allclose(found.positions, solution().positions, rtol=0, atol=1e-7)
    apart = np.sum((rate - rate.mean(axis=1, keepdims=True)) ** 2) / 0.02**2
    assert found.cost[-1] == pytest.approx(solution().cost[-1] + apart, rel=1e-6)
    assert np.all(np.diff(found.cost) <= 1e-9 * found.cost[0])


@pytest.mark.parametrize("form", ["isotropic", "per_triad"])
@pytest.mark.parametrize("prior", [False, True])
def test_is_what_automatic_differentiation_finds(form, prior):
    """Positions, covariance and motion; gyroscopes so bad that their motion matters."""
    rng = np.random.default_rng(2)
    array = small_array(6, 2)
    noise = Noise.of(6, 2, noises(rng, 6, 2)[form].accelerometer, 0.1)
    model = ArrayModel(array, noise)
    _, force, rate = simulate(rng, model, 12)
    saturated = rng.random(rate.shape) < 0.1
    saturated[:, 0] = False
    given = (array.parameters + 1e-4, 2e-4) if prior else None
    fast = calibrate_gauss_newton(
        model, force, rate, saturated=saturated, position_prior=given, tolerance=1e-7
    )
    slow = calibrate_blocks(model, force, rate, array.relative, saturated, given, tolerance=1e-7)
    assert fast.converged and slow.converged
    if not prior:
        assert fast.cost[-1] == pytest.approx(slow.cost[-1], rel=1e-6)
    sd = np.sqrt(np.diag(slow.covariance))
    np.testing.assert_allclose((fast.positions - slow.positions)[1:].ravel() / sd, 0.0, atol=1e-5)
    np.testing.assert_allclose(
        fast.covariance, slow.covariance, rtol=1e-6, atol=1e-6 * sd.min() ** 2
    )
    for mine, other in zip(fast.motion.motion[:3], slow.motion.motion[:3], strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-5, atol=1e-5)


def test_covariance_is_the_bound_of_the_direct_jacobian():
    """All derivatives written out, motion and positions together, at the truth."""
    rng = np.random.default_rng(3)
    array = small_array(5, 2)
    model = ArrayModel.isotropic(array, 0.04, 0.02)
    motion, force, rate = simulate(rng, model, 7, noise=False)
    data = Collapsed.of(model, force, rate)
    found = descend(data, array.relative)
    jacobian = oracles.joint_jacobian(np.hstack(motion[:3]), array.relative, 2, 0.04, 0.02)
    bound = np.linalg.inv(oracles.position_information(jacobian, 12))
    np.testing.assert_allclose(found.covariance, bound, rtol=1e-6, atol=1e-9 * bound.max())


def test_one_axis_of_rotation_is_refused():
    rng = np.random.default_rng(4)
    model = ArrayModel.isotropic(small_array(5, 2), 0.04, 0.02)
    motion, *_ = simulate(rng, model, 30)
    axis = np.array([0.0, 0.0, 1.0])
    along = motion._replace(
        angular_rate=motion.angular_rate[:, 2:] * axis,
        angular_acceleration=motion.angular_acceleration[:, 2:] * axis,
    )
    with pytest.raises(IdentifiabilityError):
        calibrate_gauss_newton(model, *measure(rng, model, along))


def test_one_direction_serves_all_triads():
    """The Jacobian, a triad's own parameters at a time, against one direction a parameter."""
    rng = np.random.default_rng(12)
    effects = tuple(EFFECTS)
    model = ArrayModel.isotropic(small_array(5, 4), 0.04, 0.02, effects)
    _, force, rate = simulate(rng, ArrayModel(model.array, model.noise), 70)
    given = problem_of(model, force, rate, time=np.linspace(0.0, 3.0, 70))
    assert given.apart
    x = rng.standard_normal((70, model.motion_size)) * np.repeat([5, 100, 10, 1e3, 1e2], 3)
    p = np.concatenate([model.array.parameters, 0.5 * model.effect_prior_sd])
    p[-model.effect_size :] *= rng.standard_normal(model.effect_size)
    fast, slow = normal_equations(given, x, p), normal_equations(given._replace(apart=False), x, p)
    for one, other in zip(fast, slow, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def test_shared_noise_is_no_triads_own():
    rng = np.random.default_rng(13)
    noise = noises(rng, 4, 4)["crosstalk"]
    model = ArrayModel(small_array(4, 4), noise, ("gyroscope_scale",))
    _, force, rate = simulate(rng, ArrayModel(model.array, noise), 5)
    assert not problem_of(model, force, rate).apart


@pytest.fixture(scope="module")
def stream():
    """(model, force, rate) of 2000 samples; nominal positions 1 mm off."""
    rng = np.random.default_rng(5)
    array = small_array(6, 6)
    true = ArrayModel.isotropic(array, 0.04, 0.02)
    _, force, rate = simulate(rng, true, 2000)
    off = array.relative + 1e-3 * rng.standard_normal((6, 3))
    off[0] = 0.0
    nominal = type(array)(off, array.labels, array.gyroscopes, "off")
    return ArrayModel(nominal, true.noise), force, rate


@pytest.mark.parametrize("block", [40, 200])
def test_online_ends_where_the_batch_does(stream, block):
    """Within 1 % of the batch answer's sds, and of their size, from chunks of any length."""
    model, force, rate = stream
    prior = model.array.parameters, 3e-3
    batch = calibrate_gauss_newton(model, force, rate, position_prior=prior)
    online = Online(model, 3e-3, block)
    cuts = np.cumsum(np.random.default_rng(6).integers(1, 90, 60))
    learned = [
        online.add(f, w)
        for f, w in zip(np.split(force, cuts), np.split(rate, cuts), strict=True)
        if len(f)
    ]
    assert sum(learned) == 2000 // block
    online.finish()
    assert online.samples == 2000
    sd = np.sqrt(np.diag(batch.covariance))
    apart = (online.positions - batch.positions)[1:].ravel() / sd
    assert np.abs(apart).max() < 0.01
    np.testing.assert_allclose(np.sqrt(np.diag(online.covariance)), sd, rtol=0.01)


def test_online_memory_is_bounded(stream):
    """Nothing of a block stays but 3 (A - 1) squared numbers."""
    model, force, rate = stream
    online = Online(model, 3e-3, 100)
    for part in range(0, 2000, 70):
        online.add(force[part : part + 70], rate[part : part + 70])
        assert sum(len(waiting[0]) for waiting in online._waiting) < 100


def test_online_widths_shrink(stream):
    model, force, rate = stream
    online, widths = Online(model, 3e-3, 100), []
    for part in range(0, 2000, 100):
        online.add(force[part : part + 100], rate[part : part + 100])
        widths.append(np.sqrt(np.diag(online.covariance)).max())
    assert np.all(np.diff(widths) < 0)
    assert widths[-1] / widths[3] == pytest.approx(np.sqrt(4 / 20), rel=0.15)


def test_descents_that_overlap_leave_the_threads_of_blas_as_they_were():
    def blas():
        found = [item for item in threadpool_info() if item["user_api"] == "blas"]
        return {item["num_threads"] for item in found}

    with threadpool_limits(2, user_api="blas"):
        one, other = _one_thread(), _one_thread()
        one.__enter__()
        other.__enter__()
        assert blas() == {1}
        one.__exit__(None, None, None)
        assert blas() == {1}  # the other one still runs
        other.__exit__(None, None, None)
        assert blas() == {2}


def test_online_keeps_nothing_of_wrong_samples():
    model, _, force, rate = problem()
    online = Online(model, 3e-3, len(force))
    bad = force.copy()
    bad[0, 0, 0] = np.nan
    for wrong in ((force[:, :2], rate), (force, rate[1:]), (force[0], rate[0]), (bad, rate)):
        with pytest.raises(InputError, match="online: expected"):
            online.add(*wrong)
    assert online.add(force, rate) == 1 and online.samples == len(force)
