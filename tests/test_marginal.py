"""The marginal likelihood without Monte Carlo noise, against quadrature, sampling and itself."""

import numpy as np
import pytest

from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.model.jax64 import jax
from imuarray.posterior.generic import GenericLikelihood
from imuarray.posterior.likelihood import Likelihood
from imuarray.posterior.marginal import Marginal
from tests import oracles, test_pmmh_targets
from tests.cases import noises, simulate, small_array


def case(seed=1, samples=4, gyroscope_sd=0.02, form="isotropic"):
    """(likelihood, force, rate, model, positions near the truth)."""
    rng = np.random.default_rng(seed)
    array = small_array(5, 2)
    noise = noises(rng, 5, 2)[form]
    model = ArrayModel(array, type(noise).of(5, 2, noise.accelerometer, gyroscope_sd))
    _, force, rate = simulate(rng, model, samples)
    positions = array.relative + 1e-4 * rng.standard_normal((5, 3))
    return Likelihood.of(model, force, rate), force, rate, model, positions - positions[0]


@pytest.mark.parametrize("form", ["isotropic", "per_triad", "triad_covariances", "crosstalk"])
def test_is_quadrature_of_the_direct_form(form):
    """96 -> 15 dimensions, wide Gauss-Hermite nodes around the gyroscopes' mean."""
    likelihood, force, rate, model, positions = case(form=form, gyroscope_sd=0.05)
    mean, covariance = likelihood.rate_mean, likelihood.rate_covariance[0]
    nodes, logs = oracles.gauss_hermite(mean, covariance, 25)
    theta = positions[1:].ravel()[None]
    direct = oracles.exact_log_likelihood(force, theta, model.noise.accelerometer, nodes, logs)
    found = Marginal.of(likelihood, positions, 7)(positions)
    assert found == pytest.approx(float(direct[0]), abs=1e-6)


def test_gyroscopes_that_hardly_see_the_motion():
    """Where p(omega | y_g) is so wide that Laplace's method is off, nodes are not."""
    model, force, rate, prior = test_pmmh_targets.problem()
    rng = np.random.default_rng(3)
    likelihood = Likelihood.of(model, force, rate)
    thetas = prior.mean + 1e-4 * rng.standard_normal((3, 6))
    direct = test_pmmh_targets.exact_log_target(thetas, 0.5, 21)
    direct += 0.5 * np.sum(((thetas - prior.mean) / prior.sd) ** 2, axis=1)
    positions = np.concatenate([np.zeros((3, 1, 3)), thetas.reshape(3, 2, 3)], axis=1)
    for nodes, within in ((1, 0.05), (3, 2e-3), (7, 1e-5)):
        marginal = Marginal.of(likelihood, positions[0], nodes)
        assert np.abs([marginal(p) for p in positions] - direct).max() < within


def test_against_importance_sampling():
    """Brute force: the mean of (26a) over draws from each mode's own normal, T = 500."""
    likelihood, *_, positions = case(seed=2, samples=500)
    centred = likelihood.centred(positions)
    rng = np.random.default_rng(4)
    values = np.array([centred.estimate(positions, 4000, rng) for _ in range(8)])
    error = values.std(ddof=1) / np.sqrt(len(values))
    found = Marginal.of(likelihood, positions)(positions)
    assert abs(found - values.mean()) < 5 * error
    assert error < 0.02


@pytest.mark.parametrize("gyroscope_sd", [0.02, 0.05, 0.2])
def test_within_a_thousandth_of_a_nat(gyroscope_sd):
    """In total at T = 500, as many nodes as are taken by default, at four places."""
    likelihood, *_, positions = case(seed=2, samples=500, gyroscope_sd=gyroscope_sd)
    marginal, fine = Marginal.of(likelihood, positions), Marginal.of(likelihood, positions, 13)
    rng = np.random.default_rng(1)
    for scale in (0, 1, 1, 1):
        moved = positions + 2e-4 * scale * rng.standard_normal(positions.shape)
        assert marginal(moved) == pytest.approx(fine(moved), abs=1e-3)
    assert marginal.gap < 1e-4


def test_a_quadrature_that_is_not_enough_says_so():
    """Gyroscopes of 1 rad/s, T = 500."""
    likelihood, *_, positions = case(seed=2, samples=500, gyroscope_sd=1.0)
    assert Marginal.of(likelihood, positions).gap > 1e-3


def test_the_printed_determinant_is_refused():
    _, force, rate, model, positions = case()
    likelihood = Likelihood.of(model, force, rate, determinant="printed")
    with pytest.raises(InputError, match="printed"):
        Marginal.of(likelihood, positions)


def test_nodes_are_taken_where_they_are_needed():
    for gyroscope_sd, several in ((0.02, False), (1.0, True)):
        likelihood, *_, positions = case(gyroscope_sd=gyroscope_sd)
        assert (len(Marginal.of(likelihood, positions).nodes) > 1) == several


def test_start_of_the_modes_hardly_matters():
    likelihood, *_, positions = case()
    far = positions + 2e-3 * np.random.default_rng(5).standard_normal(positions.shape)
    near, other = Marginal.of(likelihood, positions), Marginal.of(likelihood, far)
    assert near(positions) == pytest.approx(other(positions), abs=1e-8)


@pytest.mark.parametrize("nodes", [1, 3])
def test_gradient(nodes):
    """Laplace's too, where its volume moves with theta: gyroscopes that see little."""
    likelihood, *_, positions = case(gyroscope_sd=0.05 if nodes > 1 else 1.0)
    marginal = Marginal.of(likelihood, positions, nodes)
    theta = positions[1:].ravel()
    slope, value = jax.jit(jax.grad(marginal.log_density))(theta), jax.jit(marginal.log_density)
    for place in range(theta.size):
        step = 1e-6 * np.eye(theta.size)[place]
        ends = [float(value(theta + sign * step)) for sign in (1, -1)]
        assert slope[place] == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-4, abs=1.0)


def test_proper_motion_prior_is_that_of_the_generic_likelihood():
    """Two forms of one posterior: their differences in theta agree."""
    likelihood, force, rate, model, positions = case(gyroscope_sd=0.05)
    rng = np.random.default_rng(6)
    motion_sd = (8.0, 200.0, 15.0)
    likelihood = Likelihood.of(model, force, rate, motion_sd=motion_sd[:2])
    marginal = Marginal.of(likelihood, positions, 5, motion_sd[2])
    proper = ArrayModel(model.array, model.noise, (), motion_sd=motion_sd)
    start = np.hstack([rate.mean(axis=1), np.zeros((len(rate), 3)), force.mean(axis=1)])
    generic = GenericLikelihood(proper, force, rate, start, steps=8)
    thetas = positions[1:].ravel() + 1e-4 * rng.standard_normal((3, 12))
    one, other = jax.jit(marginal.log_density), jax.jit(generic.log_density)
    both = [(float(one(t)), float(other(t))) for t in thetas]
    difference = np.subtract(*np.array(both).T)
    np.testing.assert_allclose(difference, difference[0], atol=1e-3)


def test_proper_motion_prior_of_the_estimator():
    """The compiled estimate's mean is the marginal, with the same priors of omega, omega_dot."""
    _, force, rate, model, positions = case(gyroscope_sd=0.05)
    likelihood = Likelihood.of(model, force, rate, motion_sd=(8.0, 200.0))
    rng = np.random.default_rng(8)
    values = likelihood.centred(positions).realisations(positions, 2000, 20, rng)
    error = values.std(ddof=1) / np.sqrt(len(values))
    assert Marginal.of(likelihood, positions, 5)(positions) == pytest.approx(
        values.mean(), abs=5 * error + 1e-6
    )
    assert error < 0.01


@pytest.mark.slow
def test_laplace_of_the_generic_likelihood():
    """With effects: against its own estimate by importance sampling, and its own differences."""
    rng = np.random.default_rng(7)
    array = small_array(5, 2)
    model = ArrayModel.isotropic(array, 0.04, 0.02, ("gyroscope_scale", "sensor_delay"))
    _, force, rate = simulate(rng, ArrayModel.isotropic(array, 0.04, 0.02), 6)
    model = ArrayModel(array, model.noise, model.effects, motion_sd=(10.0, 300.0, 20.0))
    start = np.zeros((6, 15))
    start[:, :3], start[:, 6:9] = rate.mean(axis=1), force.mean(axis=1)
    generic = GenericLikelihood(model, force, rate, start, draws=400, steps=8)
    p = np.concatenate([array.parameters, 1e-3 * model.effect_prior_sd])
    values, density = [generic(p, rng) for _ in range(8)], jax.jit(generic.log_density)
    error = np.std(values, ddof=1) / np.sqrt(8)
    assert float(density(p)) == pytest.approx(np.mean(values), abs=5 * error + 1e-3)
    slope = np.asarray(jax.jit(jax.grad(generic.log_density))(p))
    for place in rng.permutation(p.size)[:6]:
        step = 1e-4 * np.concatenate([np.full(12, 3e-3), model.effect_prior_sd])[place]
        moved = [p + sign * step * np.eye(p.size)[place] for sign in (1, -1)]
        ends = [float(density(q)) for q in moved]
        assert slope[place] * step == pytest.approx((ends[0] - ends[1]) / 2, rel=1e-3, abs=1e-4)
