"""The likelihood, collapsed to six dimensions, against the reference in 3A dimensions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import logsumexp

from imuarray.errors import InputError
from imuarray.geometry import mimu4444
from imuarray.model import ArrayModel
from imuarray.motion import normal_motion
from imuarray.simulation.recordings import measure
from imuarray_papers import reference
from imuarray_papers.estimation.bcd import calibrate_bcd
from imuarray_papers.estimation.collapsed import Collapsed, estimate_motion
from imuarray_papers.estimation.newton import calibrate_gauss_newton
from imuarray_papers.posterior import draws, kernels
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray_papers.reference import linear_part, nonlinear_part
from tests import oracles
from tests.cases import noises, simulate, small_array

FORMS = ("isotropic", "per_triad", "triad_covariances", "crosstalk")


def problem(form="isotropic", seed=1, samples=7, array=None):
    """(rng, model, measurements, positions off by 1 mm, rates (T, N = 9, 3))."""
    rng = np.random.default_rng(seed)
    array = array or small_array()
    model = ArrayModel(array, noises(rng, array.accelerometers, array.gyroscopes)[form])
    motion, force, rate = simulate(rng, model, samples)
    positions = array.relative + 1e-3 * rng.standard_normal(array.relative.shape)
    positions[0] = 0.0
    rates = motion.angular_rate[:, None] + 0.1 * rng.standard_normal((samples, 9, 3))
    return rng, model, (force, rate), positions, rates


@pytest.mark.parametrize("determinant", ["derived", "printed"])
@pytest.mark.parametrize("form", FORMS)
def test_equals_the_direct_form(form, determinant):
    _, model, data, positions, rates = problem(form)
    found = Likelihood.of(model, *data, determinant=determinant).on(positions, rates)
    direct = reference.log_likelihood(
        data[0], positions, model.noise.accelerometer, rates, 0.5 if determinant == "derived" else 1
    )
    assert found == pytest.approx(direct, rel=1e-9)


def test_equals_the_direct_form_in_96_dimensions():
    _, model, data, positions, rates = problem(array=mimu4444(), samples=4)
    found = Likelihood.of(model, *data).on(positions, rates)
    direct = reference.log_likelihood(data[0], positions, model.noise.accelerometer, rates)
    assert found == pytest.approx(direct, rel=1e-9)


@pytest.mark.parametrize("form", FORMS)
def test_one_draw(form):
    _, model, data, positions, rates = problem(form)
    found = Likelihood.of(model, *data).on(positions, rates[:, :1])
    direct = reference.log_likelihood(data[0], positions, model.noise.accelerometer, rates[:, :1])
    assert found == pytest.approx(direct, rel=1e-9)


@pytest.mark.parametrize("form", FORMS)
def test_flat_phi_is_the_limit_of_a_wide_prior(form):
    """Differences in theta, against a normal density with no algebra in it: only the
    derived determinant has them."""
    _, model, data, positions, rates = problem(form)
    other = 1.3 * positions
    covariance = model.noise.accelerometer

    def difference(function):
        return function(other) - function(positions)

    wide = difference(
        lambda r: oracles.proper_log_likelihood(data[0], r, covariance, rates, phi_sd=3e3)
    )
    derived = difference(lambda r: Likelihood.of(model, *data).on(r, rates))
    printed = difference(lambda r: Likelihood.of(model, *data, determinant="printed").on(r, rates))
    assert derived == pytest.approx(wide, abs=0.2)  # the prior is wide, not flat
    assert abs(printed - wide) > 3.0


@pytest.mark.parametrize("form", ["isotropic", "crosstalk"])
def test_common_specific_force_does_not_matter(form):
    """s_t is marginalised under a flat prior: any force common to all triads is absorbed."""
    rng, model, (force, rate), positions, rates = problem(form)
    shift = 100.0 * rng.standard_normal((len(force), 1, 3))
    one = Likelihood.of(model, force, rate).on(positions, rates)
    two = Likelihood.of(model, force + shift, rate).on(positions, rates)
    assert two == pytest.approx(one, rel=1e-9)


@pytest.mark.parametrize("form", ["isotropic", "crosstalk"])
def test_only_relative_positions_matter(form):
    _, model, data, positions, rates = problem(form)
    likelihood = Likelihood.of(model, *data)
    moved = likelihood.on(positions + [0.3, -0.2, 0.1], rates)
    assert moved == pytest.approx(likelihood.on(positions, rates), rel=1e-9)


@pytest.mark.parametrize("form", FORMS)
def test_elimination_of_phi(form):
    """C, b, phi, const, log determinant and inverse against plain linear algebra."""
    _, model, data, positions, rates = problem(form)
    precision = np.linalg.inv(model.noise.accelerometer)
    collapsed = Collapsed.of(model, *data)
    reduced, logdet = collapsed.reduce(positions)
    H = linear_part(positions)
    w = np.stack(
        [
            rates[0, :, i] * rates[0, :, j]
            for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        ]
    )
    h = nonlinear_part(rates[0], positions).T
    B = np.linalg.lstsq(w.T, h.T, rcond=None)[0].T
    y = (data[0] - data[0].mean(axis=1, keepdims=True)).reshape(len(data[0]), -1).T
    gram = H.T @ precision @ H
    S = precision - precision @ H @ np.linalg.solve(gram, H.T @ precision)

    def close(found, direct):
        np.testing.assert_allclose(found, direct, atol=1e-8 * np.abs(direct).max())

    close(reduced.C, B.T @ S @ B)
    close(reduced.b, B.T @ S @ y)
    close(reduced.X, np.linalg.solve(gram, H.T @ precision @ B))
    close(reduced.phi, np.linalg.solve(gram, H.T @ precision @ y))
    np.testing.assert_allclose(reduced.const, np.einsum("it,ij,jt->t", y, S, y), rtol=1e-7)
    assert logdet == pytest.approx(np.linalg.slogdet(gram)[1], rel=1e-10)
    close(reduced.inverse, np.linalg.inv(gram))


extreme = st.one_of(
    st.floats(-1e300, 1e300), st.floats(-50, 50), st.floats(600, 800), st.floats(-800, -600),
    st.just(-np.inf),
)  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(arrays(float, st.integers(1, 30), elements=extreme))
def test_log_mean_exp(exponent):
    with np.errstate(all="ignore"):
        direct = logsumexp(exponent) - np.log(exponent.size)
    found = kernels._log_mean_exp(exponent)
    assert found == pytest.approx(direct, rel=1e-12, abs=1e-12)
    tile = draws.tile(exponent.size, np.random.default_rng(1))
    tile.exponent[:, :3] = exponent[:, None]  # three samples alike, the last of them shifted
    tile.exponent[:, 2] += 7.0
    assert draws.log_means(3, tile) == pytest.approx(3 * direct + 7.0, rel=1e-12, abs=1e-11)


@pytest.mark.parametrize("odd", [[np.nan, 1], [1, np.nan], [np.inf, 1], [-np.inf, -np.inf]])
def test_odd_exponents_stay_odd(odd):
    """A draw without a number leaves none, among samples that have one; nothing is made finite."""
    tile = draws.tile(2, np.random.default_rng(1))
    tile.exponent[:, :3] = 0.5
    tile.exponent[:, 1] = odd
    found = draws.log_means(3, tile)
    expected = 1.0 + kernels._log_mean_exp(np.array(odd, float))
    assert not np.isfinite(found)
    np.testing.assert_equal(found, expected)


@pytest.mark.parametrize("samples", [1, 31, 32, 77])
@pytest.mark.parametrize("count", [1, 2, 25])
def test_fresh_draws_are_those_of_their_numbers(samples, count):
    """A tile at a time, with the density that is drawn from or another: the same as one by one."""
    rng = np.random.default_rng(samples)
    model = ArrayModel(small_array(4, 2), noises(rng, 4, 2)["isotropic"])
    _, force, rate = simulate(rng, model, samples)
    plain = Likelihood.of(model, force, rate)
    mean, factor = plain.data.mean.T, np.zeros((samples, 3, 3))
    for likelihood in (plain, plain.centred(model.array.relative)):
        mean = likelihood.data.mean.T
        factor[:, *np.tril_indices(3)] = likelihood.data.factor.T
        tile = draws.tile(count, np.random.default_rng(5))
        sizes = [min(draws.TILE, samples - first) for first in range(0, samples, draws.TILE)]
        numbers = np.concatenate([draws.drawn(n, tile).transpose(2, 0, 1).copy() for n in sizes])
        assert np.unique(numbers).size == numbers.size
        rates = mean[:, None] + np.einsum("tij,tnj->tni", factor, numbers)
        found = likelihood.estimate(model.array.relative, count, np.random.default_rng(5))
        assert found == pytest.approx(likelihood.on(model.array.relative, rates), rel=1e-11)


def quadrature_case(seed=2, form="isotropic"):
    """Four triads, 3 samples, gyroscopes so bad that omega has to be integrated out."""
    rng = np.random.default_rng(seed)
    array = small_array(4, 2)
    noise = noises(rng, 4, 2)[form]
    model = ArrayModel(array, type(noise).of(4, 2, noise.accelerometer, 0.2))
    _, force, rate = simulate(rng, model, 3)
    nodes, logs = oracles.gauss_hermite(rate.mean(axis=1), 0.02 * np.eye(3), 21)
    exact = oracles.exact_log_likelihood(
        force, array.parameters[None], noise.accelerometer, nodes, logs
    )[0]
    return rng, Likelihood.of(model, force, rate), array.relative, exact


@pytest.mark.parametrize("form", ["isotropic", "crosstalk"])
def test_estimate_is_unbiased(form):
    """Seed 2; E exp(log p-hat) is p(y_a) by quadrature, within five of its standard errors
    (false alarm 6e-7 each; 4000 values of N = 25 draws)."""
    rng, likelihood, positions, exact = quadrature_case(form=form)
    values = np.array([likelihood.estimate(positions, 25, rng) for _ in range(4000)])
    ratio = np.exp(values - exact)
    assert ratio.std() > 0.05  # the estimate is noisy, or this test says nothing
    assert abs(ratio.mean() - 1.0) < 5 * ratio.std() / np.sqrt(ratio.size)


def test_realisations_are_fresh_estimates():
    """The same stream gives the same numbers one by one."""
    _, model, data, positions, _ = problem()
    likelihood = Likelihood.of(model, *data)
    many = likelihood.realisations(positions, 30, 5, np.random.default_rng(7))
    rng = np.random.default_rng(7)
    single = [likelihood.estimate(positions, 30, rng) for _ in range(5)]
    np.testing.assert_array_equal(many, single)
    assert len(set(single)) == 5


def test_given_rate_distribution_is_used():
    """Draws come from the pair (mean, covariance): with no spread, the value at the mean."""
    _, model, data, positions, rates = problem("isotropic")
    mean = rates[:, 0]
    tight = np.tile(1e-24 * np.eye(3), (len(mean), 1, 1))
    likelihood = Likelihood.of(model, *data, rate_distribution=(mean, tight))
    found = likelihood.estimate(positions, 5, np.random.default_rng(8))
    assert found == pytest.approx(likelihood.on(positions, mean[:, None]), rel=1e-9)


def test_input_errors():
    _, model, (force, rate), _, _ = problem()
    with pytest.raises(InputError, match="determinant"):
        Likelihood.of(model, force, rate, determinant="guessed")
    saturated = np.zeros(rate.shape, bool)
    saturated[3, :, 1] = True
    with pytest.raises(InputError, match="sample 3"):
        Likelihood.of(model, force, rate, saturated)


@pytest.mark.parametrize("calibrate", [calibrate_bcd, calibrate_gauss_newton, estimate_motion])
def test_other_shapes_are_refused(calibrate):
    """Before compiled code, which checks no bounds, reads or writes beyond an array."""
    model = ArrayModel.isotropic(small_array(4, 4), 0.04, 1e-3)
    motion = normal_motion(np.random.default_rng(1), (20,), 17.0, 600.0, 20.0)
    force, rate, lost = measure(model, motion, model.array.relative, np.random.default_rng(2))
    twice = np.concatenate([force, force], axis=1)
    for wrong in ((force[:, :3], rate), (twice, rate), (force, rate[:, :3]), (force, rate[:9])):
        with pytest.raises(InputError, match=r"(specific_force|angular_rate): expected shape"):
            calibrate(model, *wrong)
    with pytest.raises(InputError, match="saturated: expected shape"):
        calibrate(model, force, rate, saturated=lost[:, :3])
    name = "positions" if calibrate is estimate_motion else "start"
    for places in (model.array.relative[:3], np.tile(model.array.relative, (2, 1))):
        with pytest.raises(InputError, match=f"{name}: expected shape"):
            calibrate(model, force, rate, **{name: places})


def test_a_likelihood_refuses_other_shapes():
    model = ArrayModel.isotropic(small_array(4, 4), 0.04, 1e-3)
    rng = np.random.default_rng(1)
    motion = normal_motion(rng, (20,), 17.0, 600.0, 20.0)
    force, rate, _ = measure(model, motion, model.array.relative, rng)
    likelihood = Likelihood.of(model, force, rate)
    for places in (model.array.relative[:3], np.tile(model.array.relative, (2, 1))):
        with pytest.raises(InputError, match="positions: expected shape"):
            likelihood.estimate(places, 5, rng)
    with pytest.raises(InputError, match="rates: expected shape"):
        likelihood.on(model.array.relative, np.zeros((19, 5, 3)))
    wrong = np.zeros((19, 3)), np.tile(np.eye(3), (20, 1, 1))
    with pytest.raises(InputError, match="mean: expected shape"):
        Likelihood.of(model, force, rate, rate_distribution=wrong)
