"""The benchmarks' board: its motion against another integrator, its counts, its frame."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.board import GRAVITY, Options, draw_board, draw_hand, write
from tests.recording.cases import read_csv

FEW = Options(poses=3, still=1.0, twisting=3.0, shock=0.5)


@pytest.fixture(scope="module")
def hand():
    return draw_hand(np.random.default_rng(1), FEW)


def test_the_attitude_is_the_integral_of_the_rate(hand):
    times = np.linspace(hand.stretches[1].start, hand.stretches[2].start + 1.5, 30)

    def slope(time, rows):
        x, y, z = hand.rates(np.array([time]))[0][0]
        return (rows.reshape(3, 3) @ np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])).ravel()

    start = hand.attitude(times[:1]).as_matrix().ravel()
    found = solve_ivp(slope, times[[0, -1]], start, "DOP853", times, rtol=1e-9, max_step=2e-3)
    # the solver's steps pass over the touch-down's kink; without the commutator it were 6e-5
    attitude = hand.attitude(times).as_matrix()
    np.testing.assert_allclose(found.y.T.reshape(-1, 3, 3), attitude, atol=2e-5)


def test_the_acceleration_is_the_rates_derivative(hand):
    times = np.linspace(0, hand.duration, 2000)
    change = (hand.rates(times + 1e-5)[0] - hand.rates(times - 1e-5)[0]) / 2e-5
    np.testing.assert_allclose(change, hand.rates(times)[1], atol=0.02)


def test_still_poses_show_gravity_in_every_matrix(tmp_path):
    """Averages of 100 readings, noise 0.04 m/s^2: 6 sds; read back from the table."""
    board = draw_board(2, FEW)
    write(board.table(), board.columns(), tmp_path)
    recording = read_csv(tmp_path / "log.csv", tmp_path / "columns.yaml")
    np.testing.assert_allclose(recording.angular_rate, board.recording().angular_rate, atol=1e-12)
    np.testing.assert_allclose(recording.specific_force, board.recording().specific_force)
    poses = [slice(a, a + 100) for a in (50, 650, 1250)]
    means = np.array([recording.specific_force[pose].mean(axis=0) for pose in poses])
    change = means[1:] - means[0]  # offsets are gone
    true = np.einsum("kij,pkj->pki", np.linalg.inv(board.truth.accelerometers), change)
    np.testing.assert_allclose(true, true[:, :1].repeat(4, axis=1), atol=0.05)
    assert np.linalg.norm(true, axis=2).max() < 2 * GRAVITY
