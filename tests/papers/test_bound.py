"""The Cramer-Rao bound: reached by maximum likelihood, and what ML-BCD's rate follows from."""

import numpy as np
import pytest

from imuarray.motion import normal_motion
from imuarray_papers.studies import bound
from tests.cases import model

MOTION = (20.0, 300.0, 10.0)  # rad/s, rad/s^2, m/s^2
OPTIONS = {"position_sd": 1e-3, "rail": np.inf, "realisations": 400, "limit": 4000}


def test_maximum_likelihood_reaches_the_bound():
    """400 realisations of 30 samples: within 3 %, with and without a prior."""
    table = bound.efficiency(model(), 2, [30], MOTION, OPTIONS)
    assert list(table.estimator) == ["maximum likelihood", "with the prior"]
    assert np.all(np.abs(table.ratio - 1) < 0.03)
    assert np.all(table.ratio_se < 0.012) and np.all(table.not_converged == 0)
    assert np.all(table.iterations_max <= 10)
    assert table.bound_m[1] < table.bound_m[0]


def test_rate_of_bcd_is_predicted_and_newton_is_quick():
    table = bound.convergence(model(), 3, 50, [MOTION], OPTIONS, count=2)
    np.testing.assert_allclose(np.log(table.observed), np.log(table.contraction), rtol=0.15)
    assert np.all(table.newton_iterations <= 10)
    assert np.all(table.bcd_iterations > 2 * table.newton_iterations)


def test_larger_arrays_have_the_same_sds_relative_to_noise():
    table = bound.against_size(model(), 4, 30, MOTION, [1.0, 2.0], count=5)
    assert table.extent_m[1] == pytest.approx(2 * table.extent_m[0])
    assert table.bound_m[1] == pytest.approx(table.bound_m[0], rel=0.1)


def test_ranks():
    """One sample determines too little, two all, one axis of rotation never (Lemma 1)."""
    rng = np.random.default_rng(5)
    one = normal_motion(rng, (1,), 10.0, 300.0, 20.0)
    two = normal_motion(rng, (2,), 10.0, 300.0, 20.0)
    many = normal_motion(rng, (20,), 10.0, 300.0, 20.0)
    axis = np.array([0.0, 0.0, 1.0])
    flat = many._replace(
        angular_rate=many.angular_rate[:, 2:] * axis,
        angular_acceleration=many.angular_acceleration[:, 2:] * axis,
    )
    cases = {"one": one, "two": two, "many": many, "axis": flat}
    table = bound.ranks([(name, model(), motion) for name, motion in cases.items()])
    assert list(table["rank"] < table.unknowns) == [True, False, False, True]
