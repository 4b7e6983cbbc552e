"""What first order is told wrongly by still poses: drift, filters, turns, motion, stamps."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from imuarray.errors import InputError
from imuarray.firstorder.correct import calibrate_first_order
from imuarray.firstorder.outliers import fit_triads
from imuarray.firstorder.pose_noise import walked_mean
from imuarray.firstorder.report import summary_lines
from imuarray.firstorder.still import averaged_sd, reading_sd, smoothing, still_poses
from imuarray.trust import of_first_order, reasons_of_poses
from tests.firstorder.test_first_order import GRAVITY, RATE, board, directions, triads

WALKS = [[0.0, 1e-2, 0.0, 0.0], [2e-2] * 4]  # one triad's; strong beside the noise


def averages(rng, poses, walks, sd=1e-3):
    """Means (P, A, 3) and sds of poses each 12 s, before the offsets (A, 3) that they end at."""
    matrix, offset = triads(len(walks), rng)
    time, sds = -12.0 * np.arange(poses, 0, -1), np.full((poses, len(walks), 3), sd)
    steps = np.sqrt(12.0) * rng.standard_normal((poses + 1, len(walks), 3))
    path = (np.array(walks)[:, None] * steps).cumsum(axis=0)
    mean = np.einsum("kij,pj->pki", matrix, GRAVITY * directions(poses, rng)) + offset
    return mean + path[:-1] - path[-1] + sds * rng.standard_normal(sds.shape), sds, time, offset


@pytest.mark.parametrize("walks", WALKS)
def test_each_triad_walks_by_itself(walks):
    """A walk that is one for all leaves the sds of the one that drifts too small."""
    squares, found = [], []
    for seed in range(25):
        mean, sd, time, offset = averages(np.random.default_rng([31, seed]), 14, walks)
        fit = fit_triads(mean, sd, GRAVITY, time=time)
        squares.append(((fit.offset - offset) / fit.parts_sd()["offset"]) ** 2)
        found.append(fit.walk)
    assert np.sqrt(np.mean(squares, axis=(0, 2))).max() < 1.7
    drifting = np.array(walks) > 0
    assert np.median(found, axis=0)[drifting] == pytest.approx(np.array(walks)[drifting], rel=0.3)
    assert (np.median(found, axis=0)[~drifting] < 1e-3).all()


def test_a_gyroscope_that_drifts_alone_is_told_from_the_others():
    rng, time, sd = (
        np.random.default_rng(32),
        -12.0 * np.arange(14, 0, -1),
        np.full((14, 4, 3), 2e-5),
    )
    squares = []
    for _ in range(40):
        steps = np.sqrt(12.0) * rng.standard_normal((15, 4, 3)) * np.array([0, 3e-4, 0, 0])[:, None]
        path = steps.cumsum(axis=0)
        mean, spread, _ = walked_mean(
            path[:-1] - path[-1] + sd * rng.standard_normal(sd.shape), sd, time
        )
        squares.append((mean / spread) ** 2)
    each = np.sqrt(np.mean(squares, axis=(0, 2)))
    assert 0.6 < each.min() and each.max() < 1.3


def test_a_pose_that_fits_in_no_triad_counts_little():
    """Where the board was pulled: 0.03 m/s^2 along gravity in all triads, 30 sds."""
    mean, sd, time, offset = averages(np.random.default_rng(33), 16, [0.0] * 4)
    mean[5] *= 1 + 0.03 / GRAVITY
    fit = fit_triads(mean, sd, GRAVITY, time=time)
    assert np.flatnonzero(fit.doubtful > 1).tolist() == [5]
    assert not fit.relied[5].any() and np.delete(fit.relied, 5, axis=0).all()
    off = (fit.offset - offset) / fit.parts_sd()["offset"]
    assert np.sqrt(np.mean(off**2)) < 1.7 and fit.residual_ratio < 1.3


def test_few_triads_do_not_say_which_of_them_walks():
    """Of two that walk alike one was found steady by chance: sds of offsets 10 times too small."""
    squares = []
    for seed in range(24):
        mean, sd, time, offset = averages(np.random.default_rng([38, seed]), 12, [1e-2] * 2)
        fit = fit_triads(mean, sd, GRAVITY, time=time)
        squares.append(np.mean(((fit.offset - offset) / fit.parts_sd()["offset"]) ** 2))
    assert np.sqrt(np.mean(squares)) < 1.9


def test_a_triad_that_scatters_by_itself_has_the_wider_sds():
    """One of eight, 20 times as much as its noise says; poses say so, too."""
    squares, ratios = [], []
    for seed in range(12):
        rng = np.random.default_rng([39, seed])
        mean, sd, time, offset = averages(rng, 14, [0.0] * 8)
        mean[:, 3] += 0.02 * rng.standard_normal((14, 3))
        fit = fit_triads(mean, sd, GRAVITY, time=time)
        squares.append(((fit.offset - offset) / fit.parts_sd()["offset"]) ** 2)
        ratios.append(fit.residual_ratio)
    each = np.sqrt(np.mean(squares, axis=(0, 2)))
    assert each[3] < 1.7 and 0.7 < np.median(each) < 1.4
    assert np.median(ratios) > 3


def test_a_jump_of_one_triad_leaves_the_pose_to_the_others():
    for seed in range(4):
        mean, sd, time, _ = averages(np.random.default_rng([40, seed]), 16, [0.0] * 8)
        mean[4, 2] += [0.0, 0.1, 0.2]
        fit = fit_triads(mean, sd, GRAVITY, time=time)
        assert (fit.doubtful == 1).all() and np.argwhere(~fit.used).tolist() == [[4, 2]]


@pytest.mark.parametrize("pulled", [2, 4])
def test_poses_pulled_beyond_what_can_be_told_are_answered(pulled):
    for seed in range(4):
        mean, sd, time, _ = averages(np.random.default_rng([41, seed]), 16, [0.0] * 4)
        mean[1 : 1 + pulled] *= 1 + 0.03 / GRAVITY
        assert np.isfinite(fit_triads(mean, sd, GRAVITY, time=time).offset).all()


def test_averages_of_filtered_noise_scatter_as_said():
    """A low-pass filter of 12 Hz at 250 Hz."""
    white = np.random.default_rng(34).standard_normal((40, 2000))
    pieces = list(lfilter([0.26], [1, -0.74], white)[:, 500:, None])
    means = np.std([piece.mean() for piece in pieces])
    assert averaged_sd(pieces, 0.004) / np.sqrt(1500) == pytest.approx(means, rel=0.35)
    assert averaged_sd(pieces, 0.004) == pytest.approx(1.0, rel=0.15)
    assert reading_sd(pieces, 0.004) == pytest.approx(np.std(pieces), rel=0.05)


def test_a_steady_turn_is_no_still_pose():
    recording, poses = board(np.random.default_rng(35))[:2]
    rate, turned = recording.angular_rate.copy(), still_poses(recording)[6]
    begin, end = turned.start - 200, turned.stop + 200
    rate[begin:end] += np.radians([0.0, 0.0, 20.0])
    found = still_poses(replace(recording, angular_rate=rate))
    assert len(found) == len(still_poses(recording)) - 1
    assert not any(begin < pose.start < end for pose in found)


def test_sensors_turned_over_do_not_hide_that_the_board_moves():
    """Half of them by half a turn: the mean of all as declared showed only one axis in three."""
    recording = board(np.random.default_rng(36))[0]
    over = Rotation.from_euler("x", 180, degrees=True).as_matrix()
    force, rate = recording.specific_force.copy(), recording.angular_rate.copy()
    force[:, ::2], rate[:, ::2] = force[:, ::2] @ over, rate[:, ::2] @ over
    found = still_poses(replace(recording, specific_force=force, angular_rate=rate))
    assert found == still_poses(recording)


def test_stamps_in_bursts_are_one_line():
    recording = board(np.random.default_rng(37))[0]
    time = recording.time.copy()
    step = np.median(np.diff(time))
    time -= 0.9 * step * (np.arange(len(time)) % 10)
    with pytest.raises(InputError, match="found bursts: .* declare the sensors' rate"):
        calibrate_first_order(replace(recording, time=time))


@pytest.mark.parametrize("seconds", [5, 8, 14])  # still all along, in one pose, in two
def test_a_recording_of_few_poses_says_nothing_to_the_others(seconds):
    whole, short = (board(np.random.default_rng(seed))[0] for seed in (36, 37))
    short = short.select(np.arange(int(seconds * RATE)))
    found, alone = (
        calibrate_first_order(whole, gyroscopes="offset", others=others) for others in ([short], [])
    )
    np.testing.assert_array_equal(found.triads.matrix, alone.triads.matrix)
    assert "recording 1 of those beside it left out" in "\n".join(summary_lines(found, whole))
    with pytest.raises(InputError, match="expected still poses in three orientations or more"):
        calibrate_first_order(short, gyroscopes="offset", others=[whole])


def test_orientations_that_repeat_are_few():
    """Four poses in two orientations leave a circle of solutions."""
    whole, other = (board(np.random.default_rng(seed))[0] for seed in (36, 37))
    pair = np.arange(int(14 * RATE))
    both = np.concatenate([pair, pair])
    noise = 1e-3 * np.random.default_rng(1).standard_normal((len(both), 4, 3))
    again = replace(
        other, time=np.arange(len(both)) / RATE, specific_force=other.specific_force[both] + noise,
        angular_rate=other.angular_rate[both] + noise,
    )  # fmt: skip
    assert calibrate_first_order(whole, gyroscopes="offset", others=[again]).left_out == (1,)


def test_averaged_and_interpolated_readings_are_told_and_drifts_and_steps_are_not():
    rng = np.random.default_rng(8)
    white = rng.standard_normal((4000, 3, 3))
    slow = white + 0.05 * np.cumsum(rng.standard_normal(white.shape), axis=0)
    assert np.abs(smoothing([white, slow])).max() < 0.1
    assert np.abs(smoothing([lfilter([1], [1, -0.6], white, axis=0)]) - 0.6).max() < 0.1
    assert np.abs(smoothing([lfilter(np.ones(5) / 5, 1, white, axis=0)]) - 1.0).max() < 0.1
    recording = board(rng)[0]
    found = calibrate_first_order(recording, GRAVITY)
    assert of_first_order(found).smoothed == ()
    force = (recording.specific_force[1:] + recording.specific_force[:-1]) / 2
    mean = replace(recording.select(slice(1, None)), specific_force=force)
    smoothed = of_first_order(calibrate_first_order(mean, GRAVITY))
    assert smoothed.smoothed == ("accelerometer",)
    assert "averaged, filtered or interpolated" in reasons_of_poses(smoothed)[-1]
