"""Tuning: the number of draws from the variance law, the step from the acceptance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imuarray.model import ArrayModel
from imuarray.posterior.prior import GaussianPrior
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray_papers.posterior.tuning import (
    acceptance,
    acceptance_sweep,
    choose_draws,
    choose_step,
    variance_sweep,
)
from tests.cases import simulate, small_array
from tests.generic import GenericTarget

DRAWS = np.array([5, 20, 80, 320, 1280])


@settings(max_examples=100, deadline=None)
@given(st.floats(0.2, 200.0), st.floats(0.05, 3.0))
def test_draws_by_the_law(scale, target):
    """variance = scale / N exactly: the smallest N with variance at most the target."""
    chosen = choose_draws(DRAWS, scale / DRAWS, target)
    assert scale / chosen <= target * (1 + 1e-9)
    assert chosen == 1 or scale / (chosen - 1) > target * (1 - 1e-9)


def test_draws_rest_on_the_regime_where_the_law_holds():
    """Below a variance of one the law is 30 / N; above it the variance grows faster."""
    variances = np.where(30 / DRAWS < 1, 30 / DRAWS, (30 / DRAWS) ** 3)
    assert variances[0] > 100
    assert choose_draws(DRAWS, variances, 0.099) == 304
    assert choose_draws(DRAWS[::-1], variances[::-1], 0.099) == 304


def test_draws_where_no_variance_is_below_one():
    assert choose_draws([5, 20], [800.0, 200.0], 0.11) == 36364


@settings(max_examples=100, deadline=None)
@given(st.floats(0.05, 0.6), st.floats(1e-5, 1e-2))
def test_step_where_the_acceptance_crosses(target, scale):
    """Rates that are linear in log sigma_q are interpolated exactly, in any order of steps."""
    steps = scale * np.array([1.0, 10.0, 0.1, 100.0])
    rates = 0.5 - 0.25 * np.log10(steps / scale)
    expected = scale * 10 ** ((0.5 - target) / 0.25)
    assert choose_step(steps, rates, target) == pytest.approx(expected, rel=1e-9)


def test_step_with_rates_that_are_not_monotone():
    """Noise in the rates does not make the choice jump: it stays between the neighbours."""
    steps = np.array([1.0, 2.0, 4.0, 8.0, 16.0])
    found = choose_step(steps, [0.6, 0.4, 0.43, 0.1, 0.12], 0.2)
    assert 4.0 < found < 8.0


def test_step_outside_the_sweep_is_its_end():
    assert choose_step([1.0, 2.0], [0.9, 0.8], 0.18) == pytest.approx(2.0)
    assert choose_step([1.0, 2.0], [0.1, 0.05], 0.18) == pytest.approx(1.0)


def test_variance_goes_as_one_over_draws():
    """Seed 1; 4000 estimates each at N = 100 and 1600: the ratio of variances is 16 within
    20 %, seven standard errors of near-normal values (false alarm below 1e-9)."""
    rng = np.random.default_rng(1)
    model = ArrayModel.isotropic(small_array(5, 2), 0.04, 0.02)
    _, force, rate = simulate(rng, model, 5)
    likelihood = Likelihood.of(model, force, rate)
    few, many = variance_sweep(likelihood, model.array.relative, [100, 1600], 4000, rng)
    assert 0 < few < 0.5
    assert few / many == pytest.approx(16, rel=0.2)


def normal_target() -> GenericTarget:
    return GenericTarget(
        lambda theta, rng: 0.0, GaussianPrior.of(np.zeros(1), 1.0), np.array([1.0])
    )


@pytest.mark.parametrize("step", [0.5, 2.4, 10.0])
def test_acceptance_of_a_walk_on_a_normal(step):
    """Exactly (2 / pi) arctan(2 / step); 20 000 transitions, each counted with an
    autocorrelation time below 3: 0.03 is five standard errors (false alarm 6e-7)."""
    rng = np.random.default_rng(2)
    found = acceptance(normal_target(), [0.0], step, 20_000, rng)
    assert found == pytest.approx(2 / np.pi * np.arctan(2 / step), abs=0.03)


def test_acceptance_sweep_and_choice():
    """Seed 3; the chosen step accepts the target share within 0.03."""
    steps = np.geomspace(0.3, 30.0, 8)
    rng = np.random.default_rng(3)
    start = np.zeros(1)
    rates = acceptance_sweep(normal_target(), start, steps, 5000, rng)
    assert rates.shape == (8,)
    chosen = choose_step(steps, rates, 0.3)
    assert 2 / np.pi * np.arctan(2 / chosen) == pytest.approx(0.3, abs=0.03)
    np.testing.assert_array_equal(start, 0)
