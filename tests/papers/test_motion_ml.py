"""Motion by maximum likelihood against a general optimiser on all nine unknowns."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from imuarray.errors import IdentifiabilityError
from imuarray.geometry import mimu4444
from imuarray.model import ArrayModel, Noise
from imuarray_papers.estimation import rates
from imuarray_papers.estimation.collapsed import Collapsed, estimate_motion
from tests import oracles
from tests.cases import measure, noises, random_covariance, simulate, small_array
from tests.oracles import most_likely_motion


def problem(form="isotropic", seed=1, samples=12):
    rng = np.random.default_rng(seed)
    array = small_array(5, 2)
    first = noises(rng, 5, 2)[form].accelerometer
    second = random_covariance(rng, 6, 0.05) if form == "crosstalk" else 0.05
    model = ArrayModel(array, Noise.of(5, 2, first, second))
    return (rng, model, *simulate(rng, model, samples))


def optimum(model, force, rate, keep, start):
    """(motion (9,), cost) of one sample; variables scaled to order one."""
    scale = np.repeat([1.0, 100.0, 10.0], 3)
    result = least_squares(
        lambda x: oracles.whitened_residual(
            x * scale, model.array.relative, force, rate, model.noise, keep
        ),
        start / scale, xtol=1e-15, ftol=1e-15, gtol=1e-12, jac="3-point",
    )  # fmt: skip
    return result.x * scale, 2 * result.cost


def disagreement(model, rate, keep):
    """What the gyroscopes' differing among themselves costs, whatever omega: left out of `cost`."""
    if not keep.any():
        return 0.0
    factor = np.linalg.cholesky(model.noise.gyroscope[np.ix_(keep, keep)])
    stack = np.linalg.solve(factor, np.tile(np.eye(3), (len(rate), 1))[keep])
    values = np.linalg.solve(factor, rate.ravel()[keep])
    return np.sum((values - stack @ np.linalg.lstsq(stack, values, rcond=None)[0]) ** 2)


def check(model, truth, force, rate, saturated=None):
    found = estimate_motion(model, force, rate, saturated=saturated)
    assert found.converged.all()
    for t in range(len(force)):
        keep = np.ones(6, bool) if saturated is None else ~saturated[t].ravel()
        start = np.concatenate([field[t] for field in truth[:3]])
        expected, cost = optimum(model, force[t], rate[t], keep, start)
        np.testing.assert_allclose(found.motion.angular_rate[t], expected[:3], atol=2e-6)
        np.testing.assert_allclose(found.motion.angular_acceleration[t], expected[3:6], atol=1e-4)
        np.testing.assert_allclose(found.motion.specific_force[t], expected[6:], atol=1e-5)
        assert found.cost[t] == pytest.approx(
            cost - disagreement(model, rate[t], keep), rel=1e-6, abs=1e-6
        )


@pytest.mark.parametrize("form", ["isotropic", "per_triad", "triad_covariances", "crosstalk"])
def test_is_the_optimum(form):
    _, model, *data = problem(form)
    check(model, *data)


@pytest.mark.parametrize("form", ["isotropic", "crosstalk"])
def test_is_the_optimum_with_saturated_axes(form):
    """Some axes at a rail; in the last samples one axis, then all, of every gyroscope."""
    rng, model, truth, force, rate = problem(form, seed=2)
    saturated = rng.random(rate.shape) < 0.3
    saturated[:6] &= np.arange(2)[:, None] > 0
    saturated[9] = False
    saturated[9, :, 1] = True
    saturated[10:] = True
    rail = np.clip(rate, -5, 5)
    check(model, truth, force, np.where(saturated, rail, rate), saturated)


def test_noise_free_motion_is_recovered_from_rails_alone():
    """Every gyroscope clipped to half: accelerometers give |omega|, the reading the sign."""
    rng = np.random.default_rng(5)
    model = ArrayModel.isotropic(mimu4444(), 0.04, 0.001)
    truth, force, rate = simulate(rng, model, 30, rate_sd=20.0, noise=False)
    found = estimate_motion(model, force, 0.5 * rate, saturated=np.ones(rate.shape, bool))
    np.testing.assert_allclose(found.motion.angular_rate, truth.angular_rate, atol=1e-6)
    assert found.converged.all()


def test_given_positions_are_used():
    rng, model, truth, *_ = problem(seed=6)
    moved = model.array.relative + [0.0, 0.0, 1.0] * np.arange(5)[:, None] * 1e-3
    elsewhere = ArrayModel(type(model.array)(moved, model.array.labels, 2), model.noise)
    force, rate = measure(rng, elsewhere, truth, noise=False)
    right = estimate_motion(model, force, rate, positions=moved + [1.0, 2.0, 3.0])
    wrong = estimate_motion(model, force, rate)
    assert np.abs(right.cost).max() < 1e-4
    assert wrong.cost.min() > 1.0


def test_is_the_references_motion():
    _, model, _, force, rate = problem(seed=4)
    found = estimate_motion(model, force, rate).motion
    positions = model.array.relative
    for t, given in enumerate(zip(force, rate, strict=True)):
        sds = np.sqrt(np.diag(model.noise.accelerometer)[::3]), 0.05
        omega, omega_dot, s = most_likely_motion(*given, positions, *sds)
        np.testing.assert_allclose(found.angular_rate[t], omega, atol=1e-8)
        np.testing.assert_allclose(found.angular_acceleration[t], omega_dot, atol=1e-6)
        np.testing.assert_allclose(found.specific_force[t], s, atol=1e-7)


def test_convergence_flags():
    _, model, _, force, rate = problem(seed=7)
    few = estimate_motion(model, force, rate, limit=1)
    assert not few.converged.any()
    np.testing.assert_array_equal(few.iterations, 1)
    many = estimate_motion(model, force, rate)
    assert many.converged.all()
    assert np.all((many.iterations > 1) & (many.iterations < 50))


def test_triads_that_do_not_determine_the_motion():
    _, model, _, force, rate = problem()
    line = np.arange(5)[:, None] * [0.01, 0.02, 0.0]
    with pytest.raises(IdentifiabilityError, match="collinear"):
        estimate_motion(model, force, rate, positions=line)
    with pytest.raises(IdentifiabilityError, match="at least 3"):
        estimate_motion(model, force, rate, positions=line[:2])


@pytest.mark.parametrize("limit", [1, 2, 4, 5, 6, 50])
@pytest.mark.parametrize("accelerometers", [3, 6])
def test_all_samples_together_are_each_alone(accelerometers, limit):
    """Steps of all samples at once, some of them hard: what each sample's own search gives."""
    rng = np.random.default_rng(accelerometers)
    model = ArrayModel.isotropic(small_array(accelerometers, 2), 1.0, 0.5)
    _, force, rate = simulate(rng, model, 400)
    saturated = np.zeros(rate.shape, bool)
    saturated[::2] = True  # nothing but accelerometers: steps have to be damped
    data = Collapsed.of(model, force, rate, saturated)
    reduced, _ = data.reduce(model.array.relative)
    given = reduced.C, reduced.b, data.mean, data.rate_information, 1e-10
    together, cost, counts = data.mean.copy(), np.empty(400), np.empty(400, np.int64)
    rates.angular_rates(together, *given, limit, cost, counts)
    alone, price, steps = data.mean.copy(), np.empty(400), np.empty(400, np.int64)
    rates._costs(alone, *given[:4], price)
    for t in range(400):
        rates._alone(t, alone, *given, 1, limit, price, steps)
    ended = (counts > 0) & (steps > 0) | (limit <= 6)  # where rounding cannot have grown
    np.testing.assert_allclose(together[:, ended], alone[:, ended], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(cost[ended], price[ended], rtol=1e-9, atol=1e-9)
    # the last steps compare equal costs, which may fall either way by rounding
    assert np.mean(counts == steps) > (0.75 if limit == 50 else 0.9)
    assert abs(np.sum(counts < 0) - np.sum(steps < 0)) <= 0.03 * 400
    if limit == 50:
        assert np.mean(counts > rates.TOGETHER) > 0.02  # the hard ones


def test_what_is_not_finite_is_not_found():
    _, model, _, force, rate = problem()
    data = Collapsed.of(model, force, rate)
    reduced, _ = data.reduce(model.array.relative)
    C, b = reduced.C, reduced.b
    b[:, 3], b[:, 5] = np.nan, np.inf
    found, cost, counts = data.mean.copy(), np.empty(12), np.empty(12, np.int64)
    rates.angular_rates(found, C, b, data.mean, data.rate_information, 1e-10, 50, cost, counts)
    assert counts[3] < 0 and counts[5] < 0
    assert np.all(np.delete(counts, [3, 5]) > 0)
