"""The sampler against the posterior by quadrature in omega and importance sampling in theta.

Three triads, so six unknowns; gyroscopes bad enough that integrating omega out matters;
few samples and a wide prior, so that the determinant's power matters.
"""

from functools import cache

import numpy as np
import pytest

from imuarray.geometry import Array
from imuarray.model import ArrayModel
from imuarray.posterior.diagnostics import ess
from imuarray.posterior.prior import GaussianPrior
from imuarray_papers.posterior.likelihood import CompiledTarget, Likelihood
from imuarray_papers.posterior.pmmh import run_chains
from tests import oracles
from tests.cases import SHAPE, simulate
from tests.generic import GenericTarget

pytestmark = pytest.mark.slow

LEVELS = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
PRIOR_SD = 2e-3
DEGREES = 7  # of freedom of the proposal
SAMPLES, GYROSCOPE_SD, ACCELEROMETER_SD = 3, 0.15, 0.1


@cache
def problem():
    """(model, specific force, angular rate, prior), seed 1."""
    rng = np.random.default_rng(1)
    array = Array(0.7 * SHAPE[:3], ("1", "2", "3"), 1, "three")
    model = ArrayModel.isotropic(array, ACCELEROMETER_SD, GYROSCOPE_SD)
    _, force, rate = simulate(rng, model, SAMPLES, rate_sd=8.0)
    mean = array.parameters + PRIOR_SD * rng.standard_normal(6)
    return model, force, rate, GaussianPrior.of(mean, PRIOR_SD)


def exact_log_target(thetas, power, order=7):
    """log prior + log p(y_a | theta) for thetas (B, 6), from the direct form."""
    model, force, rate, prior = problem()
    nodes, logs = oracles.gauss_hermite(rate[:, 0], GYROSCOPE_SD**2 * np.eye(3), order)
    value = oracles.exact_log_likelihood(
        force, thetas, model.noise.accelerometer, nodes, logs, power
    )
    return value - 0.5 * np.sum(((thetas - prior.mean) / prior.sd) ** 2, axis=1)


@cache
def exact(power):
    """Weighted sample (thetas (B, 6), weights (B,)) of the posterior, seed 2.

    Student proposals fitted to the weighted sample before, from the prior on.
    """
    rng = np.random.default_rng(2)
    _, _, _, prior = problem()
    centre, spread = prior.mean, np.diag(prior.sd**2)
    for count in (1000, 1500, 1500, 8000):
        factor = np.linalg.cholesky(spread)
        scale = np.sqrt(DEGREES / rng.chisquare(DEGREES, count))
        z = rng.standard_normal((count, 6)) * scale[:, None]
        thetas = centre + z @ factor.T
        log_weights = exact_log_target(thetas, power)
        log_weights += 0.5 * (DEGREES + 6) * np.log1p(np.sum(z**2, axis=1) / DEGREES)
        weights = np.exp(log_weights - log_weights.max())
        weights /= weights.sum()
        centre = weights @ thetas
        spread = 1.3 * (thetas - centre).T @ (weights[:, None] * (thetas - centre))
    return thetas, weights


def quantiles(thetas, weights):
    """(len(LEVELS), 6)."""
    out = np.empty((len(LEVELS), 6))
    for j in range(6):
        order = np.argsort(thetas[:, j])
        out[:, j] = np.interp(LEVELS, np.cumsum(weights[order]), thetas[order, j])
    return out


def test_reference_is_accurate():
    """Quadrature has converged where the posterior is, and the weights are even."""
    thetas, weights = exact(0.5)
    assert 1 / np.sum(weights**2) > 3000
    picked = thetas[np.argsort(weights)[-200::10]]
    coarse, fine = (exact_log_target(picked, 0.5, order) for order in (7, 13))
    np.testing.assert_allclose(coarse, fine, atol=0.01)


def test_omega_and_data_matter():
    """Were omega the gyroscopes' reading, or the posterior the prior, this would be seen."""
    thetas, weights = exact(0.5)
    model, force, rate, _ = problem()
    picked = thetas[np.argsort(weights)[-200::10]]
    point = oracles.exact_log_likelihood(
        force, picked, model.noise.accelerometer, rate[:, :1], np.zeros(1)
    )
    rest = exact_log_target(picked, 0.5) - point
    assert rest.std() > 0.5
    sd = np.sqrt(weights @ (thetas - weights @ thetas) ** 2)
    assert sd.min() < 0.7 * PRIOR_SD


@cache
def chains(draws, determinant, transitions):
    """Four chains with seed 3, the first tenth left out."""
    model, force, rate, prior = problem()
    likelihood = Likelihood.of(model, force, rate, determinant=determinant)
    target = CompiledTarget(likelihood, prior, draws)
    starts = prior.mean + 1e-3 * np.random.default_rng(3).standard_normal((4, 6))
    run = run_chains(target, starts, 4e-4, transitions // 100, 100, seed=3, quiet=True)
    assert np.all(run.acceptance > 0.02)
    return run.draws[:, transitions // 1000 :]


def deviations(draws, power):
    """Difference of cumulative probabilities at the exact quantiles, in its standard errors."""
    thetas, weights = exact(power)
    below = np.mean(draws[:, :, None] <= quantiles(thetas, weights), axis=(0, 1))
    error = 1 / ess(draws) + np.sum(weights**2)
    return (below - LEVELS[:, None]) / np.sqrt((LEVELS * (1 - LEVELS))[:, None] * error)


@pytest.mark.parametrize(("draws", "transitions"), [(1, 1_000_000), (20, 400_000)])
def test_quantiles_agree(draws, transitions):
    """Five quantiles of six unknowns within five standard errors (false alarm 2e-5), with
    the exact posterior as it is even for N = 1: pseudo-marginal chains are not approximate."""
    sample = chains(draws, "derived", transitions)
    assert ess(sample).min() > 600
    assert np.abs(deviations(sample, 0.5)).max() < 5


def test_printed_determinant_is_another_posterior():
    """The printed form is sampled as rightly, but its posterior is not the derived one."""
    sample = chains(20, "printed", 400_000)
    assert np.abs(deviations(sample, 1.0)).max() < 5
    assert np.abs(deviations(sample, 0.5)).max() > 8


def test_generic_target_has_the_same_law():
    """The Python walk against the quantiles; 40 000 transitions, five standard errors."""
    model, force, rate, prior = problem()
    likelihood = Likelihood.of(model, force, rate)

    def estimate(theta, rng):
        return likelihood.estimate(np.vstack([np.zeros(3), theta.reshape(-1, 3)]), 20, rng)

    target = GenericTarget(estimate, prior, np.full(6, 4e-4))
    starts = np.tile(exact(0.5)[1] @ exact(0.5)[0], (4, 1))
    run = run_chains(target, starts, 1.0, 500, 20, seed=4, quiet=True)
    sample = run.draws[:, 50:]
    assert ess(sample).min() > 100
    assert np.abs(deviations(sample, 0.5)).max() < 5
