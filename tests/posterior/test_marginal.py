"""The marginal likelihood without Monte Carlo noise, against quadrature, sampling and itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from imuarray.engine.readings import measured
from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.model.jax64 import jax, jnp
from imuarray.posterior import generic as generic_likelihood
from imuarray.posterior.marginal import grid, log_marginal, scaled
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray_papers.reference import linear_part, nonlinear_part
from tests import oracles
from tests.cases import noises, simulate, small_array
from tests.generic import GenericLikelihood
from tests.papers import test_pmmh_targets


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
    found = likelihood.marginal(positions, 7)(positions)
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
        marginal = likelihood.marginal(positions[0], nodes)
        assert np.abs([marginal(p) for p in positions] - direct).max() < within


def test_against_importance_sampling():
    """Brute force: the mean of (26a) over draws from each mode's own normal, T = 500."""
    likelihood, *_, positions = case(seed=2, samples=500)
    centred = likelihood.centred(positions)
    rng = np.random.default_rng(4)
    values = np.array([centred.estimate(positions, 4000, rng) for _ in range(8)])
    error = values.std(ddof=1) / np.sqrt(len(values))
    found = likelihood.marginal(positions)(positions)
    assert abs(found - values.mean()) < 5 * error
    assert error < 0.02


@pytest.mark.parametrize("gyroscope_sd", [0.02, 0.05, 0.2])
def test_within_a_thousandth_of_a_nat(gyroscope_sd):
    """In total at T = 500, as many nodes as are taken by default, at four places."""
    likelihood, *_, positions = case(seed=2, samples=500, gyroscope_sd=gyroscope_sd)
    marginal, fine = likelihood.marginal(positions), likelihood.marginal(positions, 13)
    rng = np.random.default_rng(1)
    for scale in (0, 1, 1, 1):
        moved = positions + 2e-4 * scale * rng.standard_normal(positions.shape)
        assert marginal(moved) == pytest.approx(fine(moved), abs=1e-3)
    assert marginal.gap < 1e-4


def test_a_quadrature_that_is_not_enough_says_so():
    """Gyroscopes of 1 rad/s, T = 500."""
    likelihood, *_, positions = case(seed=2, samples=500, gyroscope_sd=1.0)
    assert likelihood.marginal(positions).gap > 1e-3


def test_the_printed_determinant_is_refused():
    _, force, rate, model, positions = case()
    likelihood = Likelihood.of(model, force, rate, determinant="printed")
    with pytest.raises(InputError, match="printed"):
        likelihood.marginal(positions)


def test_nodes_are_taken_where_they_are_needed():
    for gyroscope_sd, several in ((0.02, False), (1.0, True)):
        likelihood, *_, positions = case(gyroscope_sd=gyroscope_sd)
        assert (len(likelihood.marginal(positions).nodes) > 1) == several


def test_start_of_the_modes_hardly_matters():
    likelihood, *_, positions = case()
    far = positions + 2e-3 * np.random.default_rng(5).standard_normal(positions.shape)
    near, other = likelihood.marginal(positions), likelihood.marginal(far)
    assert near(positions) == pytest.approx(other(positions), abs=1e-8)


@pytest.mark.parametrize("nodes", [1, 3])
def test_gradient(nodes):
    """Laplace's too, where its volume moves with theta: gyroscopes that see little."""
    likelihood, *_, positions = case(gyroscope_sd=0.05 if nodes > 1 else 1.0)
    marginal = likelihood.marginal(positions, nodes)
    theta = positions[1:].ravel()
    slope, value = jax.jit(jax.grad(marginal.log_density))(theta), jax.jit(marginal.log_density)
    for place in range(theta.size):
        step = 1e-6 * np.eye(theta.size)[place]
        ends = [float(value(theta + sign * step)) for sign in (1, -1)]
        assert slope[place] == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-4, abs=1.0)


MOTION_SD = (8.0, 200.0)  # rad/s, rad/s^2


def dense(force, rate, positions, sds):
    """log p(y_a, y_g | theta, sds) up to a constant: dense normals of the differences between
    triads, which s does not touch, and of rates, at nodes of a wide Gauss-Hermite rule in omega."""
    accelerometer, gyroscope, omega, acceleration = sds
    apart = np.kron(np.linalg.svd(np.ones((1, len(positions))))[2][1:], np.eye(3))
    H, total = apart @ linear_part(positions)[:, :3], 0.0
    covariance = accelerometer**2 * np.eye(len(H)) + acceleration**2 * H @ H.T
    for y_a, y_g in zip(force, rate, strict=True):
        information = len(y_g) / gyroscope**2 + omega**-2
        mean = y_g.sum(axis=0) / gyroscope**2 / information
        nodes, logs = oracles.gauss_hermite(mean[None], np.eye(3) / information, 15)
        off = (y_a.ravel() - nonlinear_part(nodes[0], positions)) @ apart.T
        inside = stats.multivariate_normal(np.zeros(len(H)), covariance).logpdf(off)
        seen = stats.norm.logpdf(y_g, mean, gyroscope).sum()
        seen += stats.norm.logpdf(mean, 0, omega).sum() - 1.5 * np.log(information)
        total += logsumexp(inside + logs) + seen
    return total


def proper(seed=1, gyroscope_sd=0.05):
    """(`Marginal` under a proper motion prior, force, rate, model, positions)."""
    _, force, rate, model, positions = case(seed, gyroscope_sd=gyroscope_sd)
    likelihood = Likelihood.of(model, force, rate, motion_sd=MOTION_SD)
    off = rate - rate.mean(axis=1, keepdims=True)
    apart = model.noise.misfit(np.zeros((len(force), 15)), off)
    spread = apart, rate.size
    return likelihood.marginal(positions, 7, spread), force, rate, model, positions


def test_unknown_noise_and_motion_against_dense_normals():
    """Places, noise and the size of the motion's prior all move: one constant is left."""
    marginal, force, rate, model, positions = proper()
    sds = np.array([np.sqrt(model.noise.accelerometer[0, 0]), 0.05, *MOTION_SD])
    rng, differences = np.random.default_rng(6), []
    for logs in (np.zeros(4), *np.diag([0.3, 0.2, -0.4, 0.5]), 0.2 * rng.standard_normal(4)):
        moved = positions + 1e-4 * rng.standard_normal(positions.shape)
        moved -= moved[0]
        data, evidence = scaled(marginal.data, logs)
        found = log_marginal(moved, data, marginal.nodes, marginal.log_weights) + evidence
        differences.append(float(found) - dense(force, rate, moved, sds * np.exp(logs)))
    np.testing.assert_allclose(differences, differences[0], atol=1e-5)


def test_unknown_noise_and_motion_of_the_generic_likelihood():
    """Two forms of one posterior: their differences agree, and so do their slopes."""
    marginal, force, rate, model, positions = proper(gyroscope_sd=0.02)
    same = ArrayModel(model.array, model.noise, (), motion_sd=(*MOTION_SD, np.inf))
    start = np.hstack([rate.mean(axis=1), np.zeros((len(rate), 3)), force.mean(axis=1)])
    generic = GenericLikelihood(
        same, measured(same, force, rate), start, steps=4, logs=np.eye(5)[:, :4]
    )

    def one(theta):
        data, evidence = scaled(marginal.data, theta[12:])
        places = jnp.concatenate([jnp.zeros((1, 3)), theta[:12].reshape(-1, 3)])
        return log_marginal(places, data, *grid(3)) + evidence

    rng = np.random.default_rng(6)
    middle = np.append(positions[1:].ravel(), np.zeros(4))
    wide = np.append(np.full(12, 1e-4), np.full(4, 0.2))
    thetas = middle + wide * rng.standard_normal((4, 16))
    both = [jax.jit(jax.vmap(jax.value_and_grad(f)))(thetas) for f in (one, generic.log_density)]
    difference = both[0][0] - both[1][0]
    np.testing.assert_allclose(difference, difference[0], atol=2e-3)
    np.testing.assert_allclose(both[0][1] * wide, both[1][1] * wide, atol=5e-3, rtol=1e-3)


def test_proper_motion_prior_of_the_estimator():
    """The compiled estimate's mean is the marginal, with the same priors of omega, omega_dot."""
    _, force, rate, model, positions = case(gyroscope_sd=0.05)
    likelihood = Likelihood.of(model, force, rate, motion_sd=(8.0, 200.0))
    rng = np.random.default_rng(8)
    values = likelihood.centred(positions).realisations(positions, 2000, 20, rng)
    error = values.std(ddof=1) / np.sqrt(len(values))
    assert likelihood.marginal(positions, 5)(positions) == pytest.approx(
        values.mean(), abs=5 * error + 1e-6
    )
    assert error < 0.01


def test_inverse_and_determinant_are_numpys():
    """Of rows whose units differ by a million, as the motion's do."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(40, 15)) * np.geomspace(1e-3, 1e3, 15)
    inverse, log = generic_likelihood._inverse(root.T @ root)
    assert np.allclose(inverse @ root.T @ root, np.eye(15), atol=1e-9)
    assert float(log) == pytest.approx(np.linalg.slogdet(root.T @ root)[1], abs=1e-9)


@pytest.mark.slow
def test_laplace_of_the_generic_likelihood(monkeypatch):
    """With effects: against its own estimate by importance sampling, and its own differences."""
    rng = np.random.default_rng(7)
    array = small_array(5, 2)
    model = ArrayModel.isotropic(array, 0.04, 0.02, ("sensor_delay",))
    _, force, rate = simulate(rng, ArrayModel.isotropic(array, 0.04, 0.02), 3)
    model = ArrayModel(array, model.noise, model.effects, motion_sd=(10.0, 300.0, 20.0))
    start = np.zeros((3, 15))
    start[:, :3], start[:, 6:9] = rate.mean(axis=1), force.mean(axis=1)
    generic = GenericLikelihood(model, measured(model, force, rate), start, draws=400, steps=3)
    p = np.concatenate([array.parameters, 1e-3 * model.effect_prior_sd])
    values = [generic(p, rng) for _ in range(8)]
    whole = float(jax.jit(generic.log_density)(p))
    jax.clear_caches()
    error = np.std(values, ddof=1) / np.sqrt(8)
    assert whole == pytest.approx(np.mean(values), abs=5 * error + 1e-3)
    small = replace(generic_likelihood.SETTINGS, chunk=2)
    monkeypatch.setattr(generic_likelihood, "SETTINGS", small)
    both = jax.jit(jax.value_and_grad(generic.log_density))
    value, slope = both(p)
    assert float(value) == pytest.approx(whole, abs=1e-8)
    slope = np.asarray(slope)
    for place in rng.permutation(p.size)[:6]:
        step = 1e-4 * np.concatenate([np.full(12, 3e-3), model.effect_prior_sd])[place]
        moved = [p + sign * step * np.eye(p.size)[place] for sign in (1, -1)]
        ends = [float(both(q)[0]) for q in moved]
        assert slope[place] * step == pytest.approx((ends[0] - ends[1]) / 2, rel=1e-3, abs=1e-4)
