"""ML-BCD against a general optimiser on positions and motion together."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares

from imuarray.errors import InputError
from imuarray.geometry import Array
from imuarray.model import ArrayModel
from imuarray_papers.estimation.bcd import calibrate_bcd
from tests import oracles
from tests.cases import noises, simulate, small_array
from tests.oracles import ml_bcd


def problem(seed=1, samples=6, noise=True):
    """(model with nominal positions 1 mm off, true positions, forces, rates)."""
    rng = np.random.default_rng(seed)
    array = small_array(5, 2)
    model = ArrayModel.isotropic(array, 0.04, 0.02)
    _, force, rate = simulate(rng, model, samples, noise=noise)
    off = array.relative + 1e-3 * rng.standard_normal((5, 3))
    off[0] = 0.0
    nominal = Array(off, array.labels, array.gyroscopes, "off")
    return ArrayModel(nominal, model.noise), array.relative, force, rate


@cache
def solution():
    """The problem of seed 1 with its calibration to the last digits."""
    model, truth, force, rate = problem()
    return calibrate_bcd(model, force, rate, tolerance=1e-13, limit=200_000)


def joint_residual(x, model, force, rate):
    positions = np.vstack([np.zeros(3), x[:12].reshape(4, 3) * 1e-2])
    motions = x[12:].reshape(-1, 9) * np.repeat([1.0, 100.0, 10.0], 3)
    parts = [
        oracles.whitened_residual(m, positions, f, w, model.noise)
        for m, f, w in zip(motions, force, rate, strict=True)
    ]
    return np.concatenate(parts)


def test_is_the_joint_optimum():
    """66 unknowns; the same positions to 1e-7 m, the same motion and the same cost."""
    model, _, force, rate = problem()
    start = [
        np.concatenate([w.mean(axis=0), np.zeros(3), f.mean(axis=0)])
        for f, w in zip(force, rate, strict=True)
    ]
    start = np.array(start) / np.repeat([1.0, 100.0, 10.0], 3)
    x = np.concatenate([model.array.parameters * 100, start.ravel()])
    best = least_squares(
        joint_residual, x, args=(model, force, rate), xtol=1e-14, ftol=1e-14, gtol=1e-10
    )
    found = solution()
    assert found.converged
    np.testing.assert_allclose(
        found.positions[1:], best.x[:12].reshape(4, 3) * 1e-2, rtol=0, atol=1e-7
    )
    motions = best.x[12:].reshape(-1, 9) * np.repeat([1.0, 100.0, 10.0], 3)
    np.testing.assert_allclose(found.motion.motion.angular_rate, motions[:, :3], atol=1e-5)
    np.testing.assert_allclose(found.motion.motion.angular_acceleration, motions[:, 3:6], atol=1e-2)
    apart = np.sum((rate - rate.mean(axis=1, keepdims=True)) ** 2) / 0.02**2
    assert found.cost[-1] + apart == pytest.approx(2 * best.cost, rel=1e-6)


def test_every_iteration_is_that_of_the_reference():
    """Algorithm 1 written out: the positions after each of four iterations."""
    model, _, force, rate = problem()
    found = calibrate_bcd(model, force, rate, tolerance=0.0, limit=4, marks=(1, 2, 3, 4))
    path = ml_bcd(force, rate, model.array.relative, np.full(5, 0.04), 0.02, 4)
    np.testing.assert_allclose(found.snapshots, path, rtol=0, atol=1e-9)
    assert np.abs(np.diff(path, axis=0)).max(axis=(1, 2)).min() > 1e-6


def test_triads_of_uneven_noise_are_the_references_too():
    model, _, force, rate = problem()
    noise = noises(np.random.default_rng(5), 5, 2)["per_triad"]
    found = calibrate_bcd(ArrayModel(model.array, noise), force, rate, tolerance=0.0, limit=2)
    sds = np.sqrt(np.diag(noise.accelerometer)[::3]), np.sqrt(noise.gyroscope[0, 0])
    path = ml_bcd(force, rate, model.array.relative, *sds, 2)
    np.testing.assert_allclose(found.positions, path[-1], rtol=0, atol=1e-9)


def test_cost_falls_in_every_iteration():
    found = solution()
    assert len(found.cost) > 5
    assert np.all(np.diff(found.cost) <= 1e-9 * found.cost[0])
    assert found.cost[-1] < 0.1 * found.cost[0]


def test_noise_free_positions_are_recovered():
    model, truth, force, rate = problem(seed=2, samples=20, noise=False)
    found = calibrate_bcd(model, force, rate, tolerance=1e-13, limit=200_000)
    np.testing.assert_allclose(found.positions, truth, atol=1e-8)
    np.testing.assert_array_equal(found.positions[0], 0)


def test_stops_by_the_largest_step():
    model, _, force, rate = problem()
    found = calibrate_bcd(model, force, rate, tolerance=1e-6)
    assert found.converged
    assert found.step[-1] <= 1e-6
    assert np.all(found.step[:-1] > 1e-6)
    assert len(found.step) == len(found.cost) < len(solution().cost)


def test_stops_when_the_cost_no_longer_falls():
    model, _, force, rate = problem()
    found = calibrate_bcd(model, force, rate, tolerance=0.0)
    fallen = -np.diff(found.cost)
    assert found.converged
    assert fallen[-1] <= 0 and np.all(fallen[:-1] > 0)


def test_stops_at_the_limit():
    model, _, force, rate = problem()
    found = calibrate_bcd(model, force, rate, tolerance=0.0, limit=7)
    assert not found.converged
    assert len(found.cost) == len(found.step) == 7


def test_snapshots():
    """Positions after the iterations asked for, and the result for those never reached."""
    model, _, force, rate = problem()
    found = calibrate_bcd(model, force, rate, limit=20, tolerance=0.0, marks=(12, 3, 50))
    for mark, snapshot in zip((3, 12, 20), found.snapshots, strict=True):
        short = calibrate_bcd(model, force, rate, limit=mark, tolerance=0.0)
        np.testing.assert_allclose(snapshot, short.positions, rtol=1e-13, atol=1e-16)
    assert np.abs(found.snapshots[0] - found.snapshots[1]).max() > 1e-9


def test_start_is_not_written_to():
    model, truth, force, rate = problem()
    start = truth + 0.5
    before = start.copy()
    found = calibrate_bcd(model, force, rate, start=start, tolerance=1e-13, limit=200_000)
    np.testing.assert_array_equal(start, before)
    np.testing.assert_allclose(found.positions, solution().positions, rtol=0, atol=2e-8)


def test_common_specific_force_does_not_matter():
    model, _, force, rate = problem()
    shift = 50.0 * np.random.default_rng(4).standard_normal((len(force), 1, 3))
    moved = calibrate_bcd(model, force + shift, rate, tolerance=1e-13, limit=200_000)
    np.testing.assert_allclose(moved.positions, solution().positions, rtol=0, atol=2e-8)
    np.testing.assert_allclose(
        moved.motion.motion.specific_force - shift[:, 0],
        solution().motion.motion.specific_force,
        atol=1e-6,
    )


def test_triads_with_uneven_axes_are_for_another_method():
    model, _, force, rate = problem()
    general = ArrayModel(model.array, noises(np.random.default_rng(6), 5, 2)["crosstalk"])
    with pytest.raises(InputError, match="one noise sd"):
        calibrate_bcd(general, force, rate)
