"""Joint Gauss-Newton in collapsed form against the general estimators."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from imuarray.errors import IdentifiabilityError, InputError
from imuarray.model import ArrayModel, Noise
from imuarray.model.structure import products
from imuarray.threads import one_thread
from imuarray_papers.estimation import newton
from imuarray_papers.estimation.collapsed import Collapsed
from imuarray_papers.estimation.information import arms, fisher, information_at
from imuarray_papers.estimation.newton import calibrate_gauss_newton, fisher_scoring
from tests import oracles
from tests.cases import measure, noises, simulate, small_array
from tests.papers.test_bcd import problem, solution


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
    slow = oracles.joint_map(model, force, rate, saturated, given)
    assert fast.converged and slow.converged
    if not prior:
        assert fast.cost[-1] == pytest.approx(slow.cost, rel=1e-6)
    sd = np.sqrt(np.diag(slow.covariance))
    np.testing.assert_allclose((fast.positions - slow.positions)[1:].ravel() / sd, 0.0, atol=1e-5)
    np.testing.assert_allclose(
        fast.covariance, slow.covariance, rtol=1e-6, atol=1e-6 * sd.min() ** 2
    )
    for mine, other in zip(fast.motion.motion[:3], np.split(slow.motion, 3, axis=1), strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-5, atol=1e-5)


def test_covariance_is_the_bound_of_the_direct_jacobian():
    """All derivatives written out, motion and positions together, at the truth."""
    rng = np.random.default_rng(3)
    array = small_array(5, 2)
    model = ArrayModel.isotropic(array, 0.04, 0.02)
    motion, force, rate = simulate(rng, model, 7, noise=False)
    data = Collapsed.of(model, force, rate)
    found = fisher_scoring(data, array.relative)
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


def test_more_gyroscopes_share_a_position():
    """Gyroscope k beyond the last accelerometer is beside another one: no triad's own."""
    assert not ArrayModel.isotropic(small_array(4, 6), 0.04, 0.02, ("size_effect",)).apart
    assert ArrayModel.isotropic(small_array(4, 4), 0.04, 0.02, ("size_effect",)).apart


@pytest.mark.parametrize("samples", [127, 128, 129, 300])
def test_information_adds_up_over_samples(samples):
    """Whole tiles, parts of one and single samples: the same sum."""
    rng = np.random.default_rng(samples)
    model = ArrayModel(small_array(5, 5), noises(rng, 5, 5)["per_triad"])
    motion, force, rate = simulate(rng, model, samples)
    whole = information_at(model, motion, model.array.relative)
    singles = sum(
        information_at(model, motion.select(slice(t, t + 1)), model.array.relative)
        for t in range(samples)
    )
    np.testing.assert_allclose(whole, singles, rtol=1e-9, atol=1e-9 * np.abs(whole).max())


def test_nan_information_is_refused():
    rng = np.random.default_rng(3)
    model = ArrayModel(small_array(4, 4), noises(rng, 4, 4)["isotropic"])
    _, force, rate = simulate(rng, model, 20)
    data = Collapsed.of(model, force, rate)
    data.rate_information[..., 3] = np.nan
    with pytest.raises(IdentifiabilityError, match="informative motion"):
        fisher_scoring(data, model.array.relative)


@pytest.mark.parametrize("still", ["motion", "weight"])
def test_information_that_is_zero_is_refused(still):
    rng = np.random.default_rng(3)
    model = ArrayModel(small_array(4, 4), noises(rng, 4, 4)["isotropic"])
    _, force, rate = simulate(rng, model, 20)
    if still == "motion":
        force, rate = np.zeros_like(force), np.zeros_like(rate)
    data = Collapsed.of(model, force, rate)
    if still == "weight":
        data.weights[2] = 0.0
    with pytest.raises(IdentifiabilityError, match="informative motion"):
        fisher_scoring(data, model.array.relative)


def test_a_prior_of_another_size_is_refused():
    rng = np.random.default_rng(3)
    model = ArrayModel(small_array(4, 4), noises(rng, 4, 4)["isotropic"])
    _, force, rate = simulate(rng, model, 20)
    for size in (3, 12):
        with pytest.raises(InputError, match=r"prior's mean: expected shape \(9,\)"):
            calibrate_gauss_newton(model, force, rate, position_prior=(np.zeros(size), 1e-3))


@pytest.mark.parametrize("limit", [-1, 0, 1, 2])
def test_covariance_is_of_where_a_search_stopped(limit):
    rng = np.random.default_rng(3)
    model = ArrayModel(small_array(5, 4), noises(rng, 5, 4)["isotropic"])
    _, force, rate = simulate(rng, model, 20)
    data = Collapsed.of(model, force, rate)
    start = np.asfortranarray(model.array.relative + 1e-3 * rng.standard_normal((5, 3)))
    found = fisher_scoring(data, start, limit=limit, tolerance=0)
    assert not found.converged and len(found.cost) == max(limit, 0) + 1
    moved = np.ascontiguousarray(found.motion.motion.angular_rate.T)
    state = np.zeros((12, 20))
    state[:6] = products(moved.T).T
    state[6:9] = found.motion.motion.angular_acceleration.T
    reduced, _ = data.reduce(found.positions)
    known = fisher(found.positions, data, moved, arms(state), reduced)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(known), rtol=1e-9)


def test_covariance_where_no_shorter_step_is_better():
    """A search that ends after refused steps: the information is of where it stayed."""
    rng = np.random.default_rng(3)
    model = ArrayModel(small_array(5, 4), noises(rng, 5, 4)["isotropic"])
    _, force, rate = simulate(rng, model, 20)
    data = Collapsed.of(model, force, rate)
    given = newton.Problem(data, np.empty(0), np.empty((0, 0)))
    here, there = (newton._place(given, model.array.relative) for _ in range(2))
    cost, _ = newton._evaluate(given, here)
    before, after = np.empty((2, 12, 12))
    assert newton._curvature(given, here, before)
    uphill = -1e-3 * here.slope / np.abs(here.slope).max()
    share, _, sound = newton._shortened(given, here, there, uphill, cost - 1.0)
    assert share == 0.0 and sound
    assert newton._curvature(given, here, after)
    np.testing.assert_array_equal(after, before)


def test_another_model_is_refused():
    noise = noises(np.random.default_rng(13), 4, 4)["crosstalk"]
    models = (
        ArrayModel(small_array(4, 4), noise),
        ArrayModel.isotropic(small_array(4, 4), 0.04, 0.02, ("size_effect",)),
    )
    for model, said in zip(models, ("found a covariance", "found size_effect"), strict=True):
        with pytest.raises(InputError, match=said):
            calibrate_gauss_newton(model, np.zeros((5, 4, 3)), np.zeros((5, 4, 3)))


def test_descents_that_overlap_leave_the_threads_of_blas_as_they_were():
    def blas():
        found = [item for item in threadpool_info() if item["user_api"] == "blas"]
        return {item["num_threads"] for item in found}

    with threadpool_limits(2, user_api="blas"):
        one, other = one_thread(), one_thread()
        one.__enter__()
        other.__enter__()
        assert blas() == {1}
        one.__exit__(None, None, None)
        assert blas() == {1}  # the other one still runs
        other.__exit__(None, None, None)
        assert blas() == {2}
