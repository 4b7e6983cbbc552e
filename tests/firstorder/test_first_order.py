"""First-order calibration: still poses, triads, noise, and the recording it corrects."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from imuarray.errors import IdentifiabilityError, InputError
from imuarray.firstorder.correct import calibrate_first_order, correct, corrected
from imuarray.firstorder.outliers import fit_triads
from imuarray.firstorder.pose_noise import PoseNoise, walked_mean
from imuarray.firstorder.report import noise_table, parameter_table, residual_table
from imuarray.firstorder.still import (
    allan_deviation,
    lag_correlation,
    reading_sd,
    steps_sd,
    still_poses,
    window_spread,
)
from imuarray.firstorder.turns import parts_of
from imuarray.geometry import mimu4444_corners
from imuarray.recording import Recording, read_recording, write_recording

GRAVITY = 9.81
RATE = 50.0


def directions(count, rng):
    """Unit vectors all over the sphere."""
    points = rng.standard_normal((count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def triads(count, rng):
    """Matrices (first upper triangular), offsets."""
    matrix = np.eye(3) + 0.01 * rng.standard_normal((count, 3, 3))
    matrix[0] = np.triu(matrix[0])
    return matrix, 0.3 * rng.standard_normal((count, 3))


def board(rng, poses=16, count=4, seconds=6.0, noise=0.04, rate_noise=1e-3):
    """A recording: still poses of known direction, a second of waving in between."""
    matrix, offset = triads(count, rng)
    unit = directions(poses, rng)
    still, moving = int(seconds * RATE), int(2 * RATE)
    force, rate, marks = [], [], []
    for pose in range(poses):
        start, stop = unit[pose], unit[(pose + 1) % poses]
        force.append(np.tile(GRAVITY * start, (still, 1)))
        rate.append(np.zeros((still, 3)))
        marks.append(np.ones(still, bool))
        s = np.linspace(0, 1, moving)[:, None]
        wave = np.sin(40 * s * np.array([1.0, 1.3, 0.7]))
        force.append(GRAVITY * ((1 - s) * start + s * stop) + 3 * wave)
        rate.append(2.0 * np.cos(25 * s) * np.ones(3) + 0.5)
        marks.append(np.zeros(moving, bool))
    true, turn = np.concatenate(force), np.concatenate(rate)
    bias = np.radians(rng.standard_normal((count, 3)))
    readings = np.einsum("kij,tj->tki", matrix, true) + offset
    readings += noise * rng.standard_normal(readings.shape)
    rates = turn[:, None] + bias + rate_noise * rng.standard_normal((len(turn), count, 3))
    labels = tuple(str(k + 1) for k in range(count))
    recording = Recording(
        np.arange(len(true)) / RATE, readings, rates, mimu4444_corners().positions[[0, 2, 4, 7]],
        labels, labels, noise, rate_noise, 157.0, 34.9, 3e-3,
    )  # fmt: skip
    return recording, matrix, offset, bias, unit, np.concatenate(marks)


def test_every_pose_is_found_and_nothing_else():
    recording, *_, marks = board(np.random.default_rng(0))
    poses = still_poses(recording)
    assert len(poses) == 16
    for pose in poses:
        assert marks[pose].all() and pose.stop - pose.start > 3.5 * RATE


def test_window_spread_is_the_plain_one():
    readings = np.random.default_rng(1).normal(5.0, 2.0, (200, 3))
    found = window_spread(readings, 20)
    for t in (10, 100, 180):
        assert found[t] == pytest.approx(np.sqrt(readings[t - 10 : t + 10].var(axis=0).mean()))


def test_declared_poses_are_used_as_they_are():
    recording, *_, marks = board(np.random.default_rng(2))
    poses = still_poses(replace(recording, stationary=marks))
    assert [pose.stop - pose.start for pose in poses] == [300] * 16


def test_a_gap_ends_a_pose():
    recording, *_ = board(np.random.default_rng(3), seconds=12.0)
    kept = np.ones(len(recording.time), bool)
    kept[290:310] = False
    assert len(still_poses(recording.select(kept))) == 17


def test_missing_rows_and_late_stamps_end_no_pose():
    recording, *_ = board(np.random.default_rng(3))
    rng = np.random.default_rng(4)
    kept = recording.select(rng.random(len(recording.time)) > 0.02)
    late = np.abs(0.2 / RATE * rng.standard_normal(len(kept.time)))
    for given in (kept, replace(kept, time=kept.time + late)):
        assert np.diff(given.time).max() > 1.5 / RATE
        assert len(still_poses(given)) == 16


def test_nothing_still_is_one_line():
    recording, *_ = board(np.random.default_rng(4))
    rng = np.random.default_rng(5)
    waved = recording.angular_rate + rng.standard_normal((len(recording.time), 1, 3))
    with pytest.raises(InputError, match="expected still poses"):
        still_poses(replace(recording, angular_rate=waved))
    with pytest.raises(InputError, match="expected at least 2 s .*, found 0.78 s"):
        still_poses(recording.select(slice(0, 40)))
    with pytest.raises(InputError, match="found 0.05 over .*; are they in ms"):
        still_poses(replace(recording, time=1000 * recording.time))


def test_the_truth_is_within_the_claimed_widths():
    """40 fits, seed 6: mean squared z of 45 parameters; 6 sds of its law, false alarm 1e-8."""
    squares = []
    for seed in range(40):
        rng = np.random.default_rng([6, seed])
        matrix, offset = triads(4, rng)
        unit = directions(14, rng)
        sd = np.full((14, 4, 3), 2e-3)
        mean = np.einsum("kij,pj->pki", matrix, GRAVITY * unit) + offset
        found = fit_triads(mean + sd * rng.standard_normal(mean.shape), sd, GRAVITY)
        errors = np.concatenate(
            [(found.matrix - matrix).reshape(4, 9), found.offset - offset], axis=1
        ).ravel()
        free = np.diag(found.covariance) > 0
        assert free.sum() == 45
        covariance = found.covariance[np.ix_(free, free)] / max(found.residual_ratio, 1.0) ** 2
        squares.append(errors[free] @ np.linalg.solve(covariance, errors[free]))
    assert np.mean(squares) / 45 == pytest.approx(1.0, abs=6 * np.sqrt(2 / 45 / 40))


def test_offsets_that_walk_bias_no_map():
    """30 fits, seed 9: squared z of the 36 parameters of maps, and less error than white noise."""
    squares, errors, plain = [], [], []
    for seed in range(30):
        rng = np.random.default_rng([9, seed])
        matrix, offset = triads(4, rng)
        unit, time = directions(14, rng), -12.0 * np.arange(14, 0, -1)
        sd = np.full((14, 4, 3), 1e-3)
        steps = 1e-3 * np.sqrt(12.0) * rng.standard_normal((14, 4, 3))
        mean = np.einsum("kij,pj->pki", matrix, GRAVITY * unit) + offset + steps.cumsum(axis=0)
        mean += sd * rng.standard_normal(mean.shape)
        found, steady = fit_triads(mean, sd, GRAVITY, time=time), fit_triads(mean, sd, GRAVITY)
        covariance = found.covariance.reshape(4, 12, 4, 12)[:, :9, :, :9].reshape(36, 36)
        free = np.diag(covariance) > 0
        off = (found.matrix - matrix).ravel()
        squares.append(off[free] ** 2 / np.diag(covariance)[free])
        errors.append(np.mean(off**2))
        plain.append(np.mean((steady.matrix - matrix) ** 2))
    assert np.mean(squares) == pytest.approx(1.0, abs=0.3)
    assert np.sqrt(np.mean(errors) / np.mean(plain)) < 0.75


def test_a_walk_is_whitened_as_the_dense_covariance_says():
    rng = np.random.default_rng(10)
    time, sd = np.array([-30.0, -18.0, -7.0, 4.0, 16.0]), rng.uniform(1e-3, 3e-3, (5, 2, 3))
    recording, used = np.array([0, 0, 0, 0, 1]), np.ones((5, 2), bool)
    used[1, 1] = False
    noise = PoseNoise.of(sd, time, recording)._replace(walk=np.full(2, 1e-6))
    white = noise.whitening(used)
    walked = np.zeros((5, 5))  # two ways from time 0, each recording its own
    walked[:3, :3] = [[30, 18, 7], [18, 18, 7], [7, 7, 7]]
    walked[3, 3], walked[4, 4] = 4, 16
    for k in range(2):
        for i in range(3):
            own = np.flatnonzero(used[:, k])
            dense = np.diag(sd[:, k, i] ** 2) + 1e-6 * walked
            expected = np.linalg.inv(dense[np.ix_(own, own)])
            np.testing.assert_allclose(
                (white[k, i].T @ white[k, i])[np.ix_(own, own)], expected, rtol=1e-9
            )
            assert not white[k, i][:, ~used[:, k]].any()


def test_the_mean_of_offsets_that_walk_is_within_its_sd():
    rng, squares, walks = np.random.default_rng(11), [], []
    time, sd = -12.0 * np.arange(12, 0, -1), np.full((12, 4, 3), 2e-5)
    for _ in range(60):
        steps = 2e-5 * np.sqrt(12.0) * rng.standard_normal((13, 4, 3))
        path = steps.cumsum(axis=0)
        readings = path[:12] - path[12] + sd * rng.standard_normal(sd.shape)
        mean, spread, walk = walked_mean(readings, sd, time)
        squares.append(np.mean((mean / spread) ** 2))
        walks.append(walk)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)
    assert np.median(walks) == pytest.approx(2e-5, rel=0.3)


def plain_fit(mean, sd, magnitude):
    """The same by angles and numerical derivatives: the slow, obvious form."""
    poses, count = mean.shape[:2]

    def unpack(p):
        matrix = p[: 9 * count].reshape(count, 3, 3)
        matrix = np.concatenate([np.triu(matrix[:1]), matrix[1:]])
        offset = p[9 * count : 12 * count].reshape(count, 3)
        polar, azimuth = p[12 * count :].reshape(2, poses)
        unit = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth),
                         np.cos(polar)], axis=1)  # fmt: skip
        return matrix, offset, unit

    def residual(p):
        matrix, offset, unit = unpack(p)
        predicted = magnitude * np.einsum("kij,pj->pki", matrix, unit) + offset
        return ((mean - predicted) / sd).ravel()

    unit = mean.mean(axis=1) / np.linalg.norm(mean.mean(axis=1), axis=1, keepdims=True)
    start = np.concatenate(
        [np.tile(np.eye(3).ravel(), count), np.zeros(3 * count), np.arccos(unit[:, 2]),
         np.arctan2(unit[:, 1], unit[:, 0])]
    )  # fmt: skip
    return unpack(least_squares(residual, start, xtol=1e-15, ftol=1e-15).x)


def test_the_fit_is_that_of_the_plain_form():
    rng = np.random.default_rng(7)
    matrix, offset = triads(3, rng)
    unit = directions(15, rng)
    sd = rng.uniform(1e-3, 3e-3, (15, 3, 3))
    mean = np.einsum("kij,pj->pki", matrix, GRAVITY * unit) + offset
    mean += sd * rng.standard_normal(mean.shape)
    found, plain = fit_triads(mean, sd, GRAVITY), plain_fit(mean, sd, GRAVITY)
    np.testing.assert_allclose(found.matrix, plain[0], atol=1e-7)
    np.testing.assert_allclose(found.offset, plain[1], atol=1e-6)
    np.testing.assert_allclose(found.direction, plain[2], atol=1e-7)


def test_recordings_of_a_board_share_matrices_and_have_offsets_of_their_own():
    rng = np.random.default_rng(12)
    matrix, offset = triads(3, rng)
    offsets = np.array([offset, offset + rng.normal(0, 0.05, offset.shape)])
    recording = np.repeat([0, 1], [9, 12])
    unit = directions(21, rng)
    sd = np.full((21, 3, 3), 1e-3)
    mean = np.einsum("kij,pj->pki", matrix, GRAVITY * unit) + offsets[recording]
    mean += sd * rng.standard_normal(mean.shape)
    both = fit_triads(mean, sd, GRAVITY, recording=recording)
    alone = fit_triads(mean[:9], sd[:9], GRAVITY)
    np.testing.assert_allclose(both.offset, offsets[0], atol=4e-3)
    np.testing.assert_allclose(both.matrix, matrix, atol=5e-4)
    assert both.residual_ratio == pytest.approx(1.0, abs=0.25)
    narrower = both.parts_sd()["scale"] / both.residual_ratio < alone.parts_sd()["scale"]
    assert narrower.all()
    own = both.of(0)
    assert own.residual.shape == (9, 3, 3) and own.direction.shape == (9, 3)


def test_a_jumping_offset_is_left_out_where_it_jumps():
    rng = np.random.default_rng(8)
    matrix, offset = triads(4, rng)
    unit = directions(16, rng)
    sd = np.full((16, 4, 3), 1e-3)
    mean = np.einsum("kij,pj->pki", matrix, GRAVITY * unit) + offset
    mean += sd * rng.standard_normal(mean.shape)
    mean[:2, 2] += [0.0, 0.01, 0.04]
    found = fit_triads(mean, sd, GRAVITY)
    expected = np.ones((16, 4), bool)
    expected[:2, 2] = False
    np.testing.assert_array_equal(found.used, expected)
    np.testing.assert_allclose(found.matrix, matrix, atol=2e-3)
    assert found.residual_rms[2] < 2e-3 < np.sqrt(np.mean(found.residual[:, 2] ** 2))


@pytest.mark.parametrize("count", [3, 5])
def test_too_few_poses_are_refused(count):
    rng = np.random.default_rng(9)
    matrix, offset = triads(3, rng)
    mean = np.einsum("kij,pj->pki", matrix, GRAVITY * directions(count, rng)) + offset
    with pytest.raises(IdentifiabilityError, match=f"found {count}, which determine"):
        fit_triads(mean, np.full(mean.shape, 1e-3), GRAVITY)


def test_poses_in_one_plane_are_refused():
    rng = np.random.default_rng(10)
    matrix, offset = triads(3, rng)
    angle = np.linspace(0, 6, 20)
    unit = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    mean = np.einsum("kij,pj->pki", matrix, GRAVITY * unit) + offset
    with pytest.raises(IdentifiabilityError, match="still poses"):
        fit_triads(mean, np.full(mean.shape, 1e-3), GRAVITY)


def test_the_parts_make_the_matrix_and_carry_its_errors():
    rng = np.random.default_rng(11)
    matrix, offset = triads(3, rng)
    unit = directions(15, rng)
    mean = np.einsum("kij,pj->pki", matrix, GRAVITY * unit) + offset
    found = fit_triads(mean, np.full(mean.shape, 1e-3), GRAVITY)
    parts = parts_of(found.matrix)
    for k in range(3):
        scale, (xy, xz, yz) = parts["scale"][k], parts["misalignment"][k]
        upper = np.diag(scale) @ np.array([[1, xy, xz], [0, 1, yz], [0, 0, 1]])
        rotation = Rotation.from_rotvec(parts["orientation"][k]).as_matrix()
        np.testing.assert_allclose(upper @ rotation, matrix[k], atol=1e-8)
    assert np.abs(parts["orientation"][0]).max() < 1e-8
    # the sd of a scale, by drawing matrices: 5 % of 4000 draws, false alarm below 1e-4
    block = found.covariance.reshape(3, 12, 3, 12)[1, :9, 1, :9]
    draws = rng.multivariate_normal(found.matrix[1].ravel(), block, 4000).reshape(-1, 3, 3)
    spread = np.linalg.norm(draws[:, 2], axis=1).std()
    assert found.parts_sd()["scale"][1, 2] == pytest.approx(spread, rel=0.05)


def test_corrected_readings_have_gravitys_size_and_keep_their_rails(tmp_path):
    rng = np.random.default_rng(12)
    recording, matrix, offset, bias, unit, _ = board(rng)
    recording.specific_force[320, 1, 2] = 157.0
    recording.angular_rate[321, 0, 0] = -34.9
    found = calibrate_first_order(recording, GRAVITY)
    done = correct(recording, found)
    for pose, direction in zip(found.poses, unit, strict=True):
        mean = done.specific_force[pose].mean(axis=0)
        # sd of a mean of at least 200 readings: 3 mm/s^2; 6 of them, and the calibration's own
        np.testing.assert_allclose(mean, np.tile(GRAVITY * direction, (4, 1)), atol=0.025)
    np.testing.assert_allclose(found.at_rest["gyroscope"].offset, bias, atol=6e-4)
    write_recording(done, tmp_path / "done.nc")
    again = read_recording(tmp_path / "done.nc")
    assert np.argwhere(again.saturated_accelerometers()).tolist() == [[320, 1, 2]]
    assert np.argwhere(again.saturated_gyroscopes()).tolist() == [[321, 0, 0]]
    assert again.stationary.sum() == sum(pose.stop - pose.start for pose in found.poses)
    assert again.accelerometer_noise_sd == pytest.approx(0.04, rel=0.03)
    assert again.gyroscope_noise_sd == pytest.approx(1e-3, rel=0.03)


def test_the_correction_is_kept_and_gives_the_readings_bit_for_bit(tmp_path):
    recording, *_ = board(np.random.default_rng(17))
    found = calibrate_first_order(recording, GRAVITY, "offset")
    done = correct(recording, found)
    write_recording(done.select(slice(0, 700)), tmp_path / "part.nc")
    part = read_recording(tmp_path / "part.nc")
    for kind, name in (("accelerometer", "specific_force"), ("gyroscope", "angular_rate")):
        inverse, offset = (part.correction[f"{kind}_{x}"].to_numpy() for x in ("inverse", "offset"))
        x = getattr(recording, name)[:700] - offset
        y = (
            inverse[..., 0] * x[..., :1]
            + inverse[..., 1] * x[..., 1:2]
            + inverse[..., 2] * x[..., 2:]
        )
        np.testing.assert_array_equal(getattr(part, name), y)
        np.testing.assert_allclose(y, np.einsum("kij,tkj->tki", inverse, x), rtol=1e-13, atol=1e-13)
    # a second one, of what the first has corrected: both as one
    twice = correct(done, calibrate_first_order(done, GRAVITY, "offset"))
    both = corrected(
        twice.correction.accelerometer_inverse.to_numpy(),
        twice.correction.accelerometer_offset.to_numpy(), recording.specific_force,
    )  # fmt: skip
    np.testing.assert_allclose(both, twice.specific_force, atol=1e-12)


def test_tables_have_a_row_for_each_number():
    recording, *_ = board(np.random.default_rng(13))
    found = calibrate_first_order(recording, GRAVITY)
    table = parameter_table(found, recording)
    assert len(table) == 4 * 12 + 4 * 12 and np.isfinite(table[["value", "sd"]]).all(axis=None)
    assert residual_table(found, recording).left_out.sum() == 0
    noise = noise_table(found, recording)
    np.testing.assert_allclose(noise.ratio, 1.0, atol=0.05)
    assert np.abs(noise.correlation).max() < 0.1


def slow_allan(x, n):
    """Definition, with loops."""
    means = [x[i : i + n].mean() for i in range(len(x) - n + 1)]
    squares = [(means[i + n] - means[i]) ** 2 for i in range(len(means) - n)]
    return np.sqrt(np.mean(squares) / 2)


def test_allan_deviation_is_the_definition():
    x = np.random.default_rng(14).standard_normal((120, 1)).cumsum(axis=0)
    taus, deviation = allan_deviation([x], 0.1)
    assert taus[:3] == pytest.approx([0.1, 0.2, 0.4])
    for n, value in zip((1, 2, 4, 8), deviation[:, 0], strict=False):
        assert value == pytest.approx(slow_allan(x[:, 0], n))


def test_allan_deviation_of_white_noise_falls_as_its_law():
    """Seed 15; 10 pieces of 2000: 5 sds of each point, false alarm below 1e-5."""
    rng = np.random.default_rng(15)
    pieces = [0.3 * rng.standard_normal((2000, 2)) for _ in range(10)]
    taus, deviation = allan_deviation(pieces, 1.0)
    for tau, values in zip(taus, deviation, strict=True):
        error = 5 / np.sqrt(2 * 20000 / (1.5 * tau))
        np.testing.assert_allclose(values * np.sqrt(tau) / 0.3, 1.0, atol=error)
    np.testing.assert_allclose(reading_sd(pieces, 0.01), 0.3, rtol=0.03)
    assert np.abs(lag_correlation(pieces)).max() < 0.04


@pytest.mark.parametrize("factor", [0.0, 1 / 9.81, 1e-3])
def test_readings_in_g_or_dead_are_refused(factor):
    rng = np.random.default_rng(16)
    matrix, offset = triads(3, rng)
    mean = factor * np.einsum("kij,pj->pki", matrix, GRAVITY * directions(15, rng))
    with pytest.raises(InputError, match="are unit and --gravity right"):
        fit_triads(mean, np.full(mean.shape, 1e-3), GRAVITY)


def test_poses_read_in_coarse_steps_are_as_uncertain_as_a_step():
    rng = np.random.default_rng(6)
    fine = [9.8 + 0.04 * rng.standard_normal((300, 2, 3)) for _ in range(3)]
    assert not steps_sd(fine).any()
    found = steps_sd([np.round(piece / 0.5) * 0.5 for piece in fine])
    np.testing.assert_allclose(found[found > 0], 0.5 / np.sqrt(12))
    assert (found > 0).all(axis=(0, 2)).any()


def test_a_dead_band_says_nothing_of_noise():
    recording, _, _, bias, *_ = board(np.random.default_rng(3))
    rate = recording.angular_rate - bias
    dead = replace(recording, angular_rate=np.where(np.abs(rate) < 0.02, 0.0, rate))
    rates = calibrate_first_order(dead, GRAVITY).at_rest["gyroscope"]
    assert np.all(rates.noise == recording.gyroscope_noise_sd)
    assert not np.any(rates.smoothing) and not np.any(rates.correlation)


def test_gravity_that_was_taken_out_is_named():
    """Offsets are left, and what an attitude was off by: of no one size."""
    rng = np.random.default_rng(16)
    mean = 0.3 * directions(3, rng) + 0.1 * rng.standard_normal((15, 3, 3))
    with pytest.raises(InputError, match="gravity .* found 0.3.? m/s.2: it was taken out"):
        fit_triads(mean, np.full(mean.shape, 1e-3), GRAVITY)
