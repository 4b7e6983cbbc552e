"""Independence Metropolis-Hastings against laws whose moments and quantiles are known."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import imuarray
from imuarray.analysis import sampling
from imuarray.geometry import sub_array
from imuarray.model.jax64 import jnp
from imuarray.posterior.diagnostics import ess, rhat
from imuarray.posterior.independent import run_independent, walked
from imuarray.posterior.settings import SETTINGS

MEAN = np.array([1.0, -2.0, 0.5])
FACTOR = np.array([[2.0, 0.0, 0.0], [1.0, 0.3, 0.0], [-1.0, 0.2, 1e-3]])


def normal(theta, mean):
    return -0.5 * jnp.sum(jnp.linalg.solve(FACTOR, theta - mean) ** 2)


def skewed(theta):
    """Tails lighter than the normal density's at the mode, 0, and one lighter than the other."""
    return (-(theta**2) / 2 + theta**3 / 3 - theta**4 / 4).sum()


def test_a_normal_target_is_drawn_from_wherever_the_search_ended(capsys):
    """The centre is looked for: three sds off, nearly every proposal is taken all the same."""
    off = MEAN + FACTOR @ np.array([3.0, -2.0, 1.0])
    chains, k = run_independent(normal, off, FACTOR @ FACTOR.T, None, seed=1, data=(MEAN,))
    assert chains.acceptance.min() > 0.8 and k < 0.3
    assert re.search(r"100%.* (\d+)/\1 ", capsys.readouterr().err)  # all that was announced
    assert rhat(chains.draws).max() <= 1.01 and ess(chains.draws).min() >= 1000
    z = np.linalg.solve(FACTOR, (chains.draws - MEAN).reshape(-1, 3).T)
    # of standard normal z, four standard errors of 1000 draws
    assert np.abs(z.mean(axis=1)).max() < 4 / np.sqrt(1000)
    assert np.abs(np.cov(z) - np.eye(3)).max() < 4 * np.sqrt(2 / 1000)
    exact = [float(normal(theta, MEAN)) for theta in chains.draws[:, -1]]
    apart = chains.log_target[:, -1] - exact
    np.testing.assert_allclose(apart, apart[0], atol=1e-9)  # up to its constant


def test_a_target_that_is_not_normal_is_drawn_from_exactly():
    """Quantiles within five standard errors of those by summation."""
    chains, k = run_independent(skewed, np.zeros(2), np.eye(2), 5000, seed=2, quiet=True)
    assert k < SETTINGS.unreliable and 0.3 < chains.acceptance.min() < 0.9
    grid, levels = np.linspace(-6, 6, 4001), np.array([0.05, 0.25, 0.5, 0.75, 0.95])
    density = np.exp([skewed(value[None]) for value in grid])
    law, sizes = np.cumsum(density) / density.sum(), ess(chains.draws)
    assert sizes.min() > 5000
    for place, size in enumerate(sizes):
        found = np.interp(np.quantile(chains.draws[..., place], levels), grid, law)
        error = np.sqrt(levels * (1 - levels) / size)
        assert np.abs((found - levels) / error).max() < 5
        proposed = stats.norm.cdf(np.interp(levels, law, grid))  # another law, and seen to be
        assert np.abs((proposed - levels) / error).max() > 10


def test_tails_that_proposals_do_not_reach_are_told():
    _, k = run_independent(
        lambda t: -2.0 * jnp.log1p(t[0] ** 2 / 3), np.zeros(1), np.eye(1), 4000, seed=3, quiet=True
    )
    assert k > SETTINGS.unreliable


def test_walk_takes_what_is_denser_and_what_it_must_of_the_rest():
    weights = np.array([[0.0, 1.0, 0.5, 0.5, -np.inf, 3.0], [-np.inf, -np.inf, 0.0, 0.1, 0.2, 0.0]])
    log_half = np.full(weights.shape, np.log(0.65))  # a share 0.607 of exp(-0.5) is not taken
    place = walked(weights, log_half)
    np.testing.assert_array_equal(place, [[0, 1, 1, 1, 1, 5], [0, 0, 2, 3, 4, 5]])
    np.testing.assert_array_equal(walked(weights, log_half - 1.0)[0], [0, 1, 2, 3, 3, 5])


def test_same_seed_same_draws_on_any_number_of_threads():
    def run(seed, threads):
        return run_independent(
            skewed, np.zeros(2), np.eye(2), 60, seed, quiet=True, threads=threads
        )[0].draws

    np.testing.assert_array_equal(run(1, 1), run(1, 2))
    assert not np.any(run(1, 1)[:, -1] == run(2, 1)[:, -1])
    assert len(np.unique(run(1, 1)[:, 0])) == 8  # no two chains alike


@pytest.mark.slow
def test_where_it_is_not_enough_nuts_is_taken_and_that_is_told(monkeypatch):
    """Both samplers agree on a recording; neither's word is taken where its tails say nothing."""
    array = sub_array(imuarray.mimu4444(), 4)
    recording, _ = imuarray.simulate(array, 20.0, 100.0, seed=3, angular_rate=15.0)
    recording = imuarray.select(recording, 40)
    first = imuarray.sample(recording, "papers")
    assert first.attrs["sampler"] == "independent" and first.attrs["converged"]
    assert first.attrs["ess_min"] >= 1000 and first.attrs["rhat_max"] <= 1.01
    monkeypatch.setattr(sampling, "POSTERIOR", replace(SETTINGS, unreliable=-np.inf))
    refused = imuarray.sample(recording, "papers", method="independent")
    assert not refused.attrs["converged"]
    made = sampling.posterior_of
    with monkeypatch.context() as patch:  # NUTS is not begun about a point that is no mode
        patch.setattr(sampling, "posterior_of", lambda *a: made(*a)._replace(converged=False))
        lost = imuarray.sample(recording, "papers")
    assert lost.attrs["sampler"] == "independent" and not lost.attrs["converged"]
    said: list[str] = []
    other = imuarray.sample(recording, "papers", steps=250, notify=said.append)
    assert other.attrs["sampler"] == "nuts" and "Pareto's k" in other.attrs["instead_of"]
    assert any(line.endswith("NUTS instead") for line in said)
    mine, theirs = (
        tree["posterior"]["position"].to_numpy().reshape(-1, 9) for tree in (first, other)
    )
    sd = theirs.std(axis=0)
    assert np.abs((mine.mean(axis=0) - theirs.mean(axis=0)) / sd).max() < 0.2
    assert np.abs(mine.std(axis=0) / sd - 1).max() < 0.15
