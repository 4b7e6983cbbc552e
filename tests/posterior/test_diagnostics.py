"""R-hat, effective sample size, burn-in, on chains whose law is known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from imuarray.posterior.diagnostics import agreement, ess, find_burn_in, rhat


def ar1(rng, shape, coefficient):
    """Stationary AR(1) chains (chains, draws, size) with unit variance."""
    noise = rng.standard_normal(shape) * np.sqrt(1 - coefficient**2)
    noise[:, 0] = rng.standard_normal((shape[0], shape[2]))
    return lfilter([1.0], [1.0, -coefficient], noise, axis=1)


@pytest.mark.parametrize("coefficient", [0.0, 0.5, 0.9])
def test_ess_of_autoregressive_chains(coefficient):
    """Seed 1; n (1 - a) / (1 + a) within 35 % for 2 x 20 000 draws (about 5 % is one sd)."""
    draws = ar1(np.random.default_rng(1), (2, 20_000, 3), coefficient)
    expected = 40_000 * (1 - coefficient) / (1 + coefficient)
    assert ess(draws).shape == (3,)
    np.testing.assert_allclose(ess(draws), expected, rtol=0.35)


def test_rhat():
    """Seed 2; like chains are below 1.01 (typical excess: 1e-3); one shifted by one sd
    gives sqrt(1 + 1/3) = 1.155 for four half chains before ranks are taken, in its own place."""
    draws = ar1(np.random.default_rng(2), (2, 4000, 3), 0.5)
    assert rhat(draws).shape == (3,)
    assert rhat(draws).max() < 1.01
    shifted = draws.copy()
    shifted[1, :, 1] += 1.0
    found = rhat(shifted)
    assert found[1] == pytest.approx(1.155, abs=0.06)
    assert found[[0, 2]].max() < 1.01


def test_rhat_sees_a_drift_both_chains_share():
    """Split chains: two that drift together agree with one another but not with themselves."""
    draws = ar1(np.random.default_rng(3), (2, 4000, 1), 0.5)
    assert rhat(draws + np.linspace(-2, 2, 4000)[:, None])[0] > 1.2


def test_agreement_is_in_standard_errors():
    """Seed 4; 200 independent parameters: the root mean square z is one within 25 %
    (five sigma), and a shift of ten standard errors is seen as ten."""
    draws = ar1(np.random.default_rng(4), (2, 4000, 200), 0.6)
    z = agreement(draws)
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, rel=0.25)
    error = np.sqrt(2 / (4000 * (1 - 0.6) / (1 + 0.6)))
    draws[1] += 10 * error
    assert np.median(agreement(draws)) == pytest.approx(10.0, rel=0.15)


def with_transient(seed, length, time, height):
    """Chains that fall towards stationarity from both sides, their log target from below."""
    rng = np.random.default_rng(seed)
    draws, log_target = ar1(rng, (2, length, 4), 0.8), ar1(rng, (2, length, 1), 0.8)[..., 0]
    fall = height * np.exp(-np.arange(length) / time)
    draws[..., 0] += np.array([[1.0], [-1.0]]) * fall
    return draws, log_target - 3 * fall


def passed(cut, table) -> bool:
    return bool(table.set_index("burn_in").rhat_max[cut] < 1.05)


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_burn_in_covers_a_transient(seed):
    """It starts 20 sd off and falls as exp(-i / 100): at 300 still one sd off, gone at 900."""
    draws, log_target = with_transient(seed, 4000, 100, 20.0)
    cut, table = find_burn_in(draws, log_target)
    assert passed(cut, table)
    assert 300 <= cut <= 2000
    left = draws[:, cut:]
    assert rhat(left).max() < 1.05
    assert agreement(left).max() < 5
    assert 11 <= len(table) <= 12
    assert table.burn_in.iloc[0] == 0
    sizes = table.set_index("burn_in").ess_min
    assert sizes[0] < 0.5 * sizes[cut]


def test_burn_in_sees_the_log_target_alone():
    """Positions converged, likelihood not: discarded all the same."""
    draws, log_target = with_transient(8, 4000, 100, 20.0)
    still = ar1(np.random.default_rng(8), draws.shape, 0.8)
    cut, table = find_burn_in(still, log_target)
    assert cut >= 300
    assert table.rhat_log_target.iloc[0] == pytest.approx(table.rhat_max.iloc[0])


def test_burn_in_of_converged_chains_is_short():
    """Seed 9; no transient: at most a quarter is thrown away, and R-hat passes."""
    rng = np.random.default_rng(9)
    cut, table = find_burn_in(ar1(rng, (2, 8000, 2), 0.5), ar1(rng, (2, 8000, 1), 0.5)[..., 0])
    assert passed(cut, table)
    assert cut <= 2000


def test_burn_in_that_is_never_reached():
    """Chains that stay apart are reported as such."""
    rng = np.random.default_rng(10)
    draws = ar1(rng, (2, 2000, 2), 0.5)
    draws[1] += 3.0
    cut, table = find_burn_in(draws, ar1(rng, (2, 2000, 1), 0.5)[..., 0])
    assert not passed(cut, table)
    assert table.rhat_max.min() > 1.05
