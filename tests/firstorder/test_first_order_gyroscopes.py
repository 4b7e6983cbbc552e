"""Gyroscopes from still poses and moves: known maps, mistakes by name, what is skipped and said."""

import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy import stats
from scipy.linalg import rq
from scipy.spatial.transform import Rotation

from benchmarks.board import GRAVITY, Options, draw_board, draw_hand
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.firstorder.correct import calibrate_first_order, calibrate_together, correct
from imuarray.firstorder.gyroscopes import shared_chance, shift_odds
from imuarray.firstorder.moves import Move, _carried, _to_end, common_map, gather
from imuarray.firstorder.report import gyroscope_lines, parameter_table, turned_lines
from imuarray.firstorder.settings import SETTINGS
from imuarray.firstorder.still import still_poses
from imuarray.recording import read_recording, write_recording
from imuarray.recording.format import load_dataset
from imuarray.trust.misfit import Poses, of_file, reasons_of_poses
from imuarray.trust.settings import SETTINGS as TRUST

SHORT = Options(sampling_rate=100.0, still=3.2, move=1.5, twisting=4.0)


def calibrated(seed=0, **different):
    """(board, first-order calibration) of a short recording."""
    board = draw_board(seed, replace(SHORT, **different))
    return board, calibrate_first_order(board.recording(), GRAVITY)


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


@pytest.mark.parametrize(
    "different",
    [{}, {"turned": 37.0}, {"turned": 180.0}, {"mount": 2.0, "late": 0.003}, {"imus": 2}],
    ids=str,
)
def test_known_maps_are_found_whatever_the_mounts(different):
    """Entries are 5e-3 (scales) and 3e-3 (skews) off, a late IMU's, ignored, would be 1e-3 more."""
    board, found = calibrated(1, **different)
    maps = found.gyroscopes
    error = maps.matrix - board.truth.gyroscopes
    sds = np.sqrt(np.diag(maps.covariance)).reshape(error.shape)
    assert rms(error) < 4e-4 and rms(error / sds) < 2.0
    assert rms(found.triads.matrix - board.truth.accelerometers) < 6e-4
    corrected = correct(board.recording(), found)
    common = (np.linalg.inv(maps.matrix) @ board.truth.gyroscopes).mean(axis=0) - np.eye(3)
    known = corrected.gyroscope_common_covariance
    assert common.ravel() @ np.linalg.solve(known, common.ravel()) < 28  # chi-squared, 9: 0.1 %
    rates = corrected.angular_rate
    assert rms(rates[:, 0] - board.truth.rate) < 2.5e-3  # noise of 1e-3, offsets


def test_recordings_calibrated_together_are_each_as_beside_the_others():
    one, rng = draw_board(1, SHORT).recording(), np.random.default_rng(4)
    force, rate = (2e-3 * rng.standard_normal(x.shape) for x in (one.specific_force,) * 2)
    two = replace(
        one, specific_force=one.specific_force + force, angular_rate=one.angular_rate + rate / 4
    )
    for own, other, found in zip(
        (one, two), (two, one), calibrate_together([one, two]), strict=True
    ):
        alone = calibrate_first_order(own, others=[other])
        for name in ("matrix", "offset", "residual", "covariance"):
            new, old = (getattr(each.triads, name) for each in (found, alone))
            np.testing.assert_allclose(new, old, rtol=0, atol=1e-5 * np.abs(old).max())
        new, old = (each.gyroscopes for each in (found, alone))
        np.testing.assert_allclose(new.matrix, old.matrix, atol=1e-6)
        np.testing.assert_array_equal(new.common.first, old.common.first)
        assert found.poses == alone.poses


def moves_of(hand, options, change, rng=None, sd=1e-3):
    """Moves whose rates have to be multiplied by ``change``, directions, and their covariance."""
    pace, ups, moves = options.still + options.move, [], []
    for p in range(options.poses):
        middle = p * pace + options.still / 2
        ups.append(hand.attitude(np.array([middle]))[0].inv().apply([0.0, 0.0, 1.0]))
        if p + 1 < options.poses:
            time = middle + np.arange(round(pace * options.sampling_rate) + 1) / 100.0
            noise = 0.0 if rng is None else sd * rng.standard_normal((len(time), 3))
            rate = hand.rates(time)[0] @ np.linalg.inv(change).T + noise
            moves.append(Move(p, time, rate, np.full(3, sd * 0.01 * np.sqrt(len(time)))))
    return moves, np.array(ups), 1e-10 * np.eye(3 * len(ups))


@pytest.fixture(scope="module")
def hand():
    return draw_hand(np.random.default_rng(2), SHORT)


CHANGE = np.eye(3) + 0.01 * np.random.default_rng(3).standard_normal((3, 3))


def test_rates_are_integrated_to_fourth_order(hand):
    """At 100 Hz; the rule of the middle is off by 2e-5."""
    moves, ups, _ = moves_of(hand, SHORT, np.eye(3))
    for move in moves[:4]:
        ends = hand.attitude(move.time[[0, -1]])
        exact = (ends[0].inv() * ends[1]).as_matrix()
        np.testing.assert_allclose(_to_end(move, np.eye(3))[0], exact, atol=2e-6)


def test_slopes_of_the_carried_direction_are_its_derivatives(hand):
    move = moves_of(hand, SHORT, np.eye(3))[0][1]
    total, slopes = _carried(move, np.eye(3))
    up = np.array([0.6, 0.0, 0.8])
    for entry in range(9):
        small = np.zeros(9)
        small[entry] = 1e-6
        moved = _to_end(move, np.eye(3) + small.reshape(3, 3))[0]
        expected = (moved.T - total.T) @ up / 1e-6
        np.testing.assert_allclose(np.cross(total.T @ up, slopes[:, entry]), expected, atol=2e-3)


def test_the_common_map_is_within_its_sds(hand):
    """Seed 4, 30 draws: nine entries' and the scale's squared z; 5 sds of the law, 1e-6."""
    rng, squares, scales = np.random.default_rng(4), [], []
    for _ in range(30):
        found = common_map(*moves_of(hand, SHORT, CHANGE, rng))
        error = (found.map - CHANGE).ravel()
        squares.append(error @ np.linalg.solve(found.covariance, error) / 9)
        scales.append((found.scale - np.trace(CHANGE) / 3) / found.scale_sd)
    # robust weights cost some 10 % of the information, and claim it
    assert np.mean(squares) == pytest.approx(0.9, abs=5 * np.sqrt(2 / 9 / 30))
    assert np.mean(np.square(scales)) == pytest.approx(0.9, abs=5 * np.sqrt(2 / 30))
    assert found.scale_sd < 2e-4


def test_a_shock_in_a_move_counts_little(hand):
    moves, *given = moves_of(hand, SHORT, CHANGE, np.random.default_rng(5))
    plain = common_map(moves, *given)
    for k in (2, 7):
        rate = moves[k].rate.copy()
        rate[300] += 2.0  # 0.02 rad about each axis
        moves[k] = moves[k]._replace(rate=rate)
    found = common_map(moves, *given)
    assert found.weight[[2, 7]].max() < 0.01 and np.delete(found.weight, [2, 7]).min() > 0.1
    assert np.abs(found.map - CHANGE).max() < 4 * np.abs(plain.map - CHANGE).max()
    np.testing.assert_allclose(np.flatnonzero(found.error > 0.01), [2, 7])


@pytest.mark.parametrize(("gap", "counts"), [((0.99, 1.06), True), ((0.6, 0.67), False)])
def test_a_gap_in_a_move_costs_no_more_than_the_way_over_it(gap, counts):
    """A log that lost what came when the board was at rest again has the move all the same."""
    time = np.arange(0, 2, 0.005)
    time = time[(time < gap[0]) | (time > gap[1])]
    u = np.clip(2 * time - 1, 0, 1)[:, None]
    rate = u**2 * (1 - u) ** 2 * [90.0, 0, 0]
    poses = slice(0, np.sum(time < 0.5)), slice(np.sum(time < 1.0), len(time))
    moves = gather(rate, time, poses, np.zeros((2, 3)), np.ones(len(time), bool), 1e-4)
    assert len(moves) == counts
    for move in moves:
        turned = Rotation.from_matrix(_to_end(move, np.eye(3))[0]).as_rotvec()
        assert abs(turned[0] - 1.5) < move.sd.max() < 4e-3


def test_what_the_moves_do_not_tell_stays_with_the_priors_sd():
    """All moves about one axis: the others' scales are not seen."""
    time = np.arange(200) / 100.0
    rate = np.array([0.0, 0.0, 1.0]) * (1 - np.cos(np.pi * time))[:, None]
    angles = (1.99 - np.sin(1.99 * np.pi) / np.pi) * np.arange(8)[:, None]
    ups = np.hstack([np.cos(angles), -np.sin(angles), 0 * angles])
    moves = [Move(p, time, rate, np.full(3, 1e-4)) for p in range(7)]
    found = common_map(moves, ups, 1e-10 * np.eye(24))
    sds = np.sqrt(np.diag(found.covariance)).reshape(3, 3)
    assert sds[2, 2] < 1e-4 and found.map[2, 2] == pytest.approx(1.0, abs=3e-4)
    assert sds[0, 0] == pytest.approx(0.01) and found.map[0, 0] == 1.0


MISTAKES = {
    "one gyroscope's axis": (
        lambda r: r.angular_rate * np.where(np.arange(12).reshape(4, 3) == 7, -1, 1), None,
        "gyroscope '3': expected right-handed axes.*sign of its y axis",
    ),
    "the same in all": (
        lambda r: r.angular_rate * [1, 1, -1], None, "sign of z wrong in all of them",
    ),
    "one accelerometer's axis": (
        None, lambda r: r.specific_force * np.where(np.arange(12).reshape(4, 3) == 0, -1, 1),
        "accelerometer '1': expected right-handed axes.*sign of its x axis",
    ),
    "left-handed": (
        lambda r: r.angular_rate * [1, 1, -1], lambda r: r.specific_force * [1, 1, -1],
        "is the board's frame left-handed",
    ),
    "rad/s declared deg/s": (
        lambda r: r.angular_rate * np.pi / 180, None, "57.3 times as large; are they in rad/s",
    ),
    "an axis in another unit": (
        lambda r: np.where(np.arange(12).reshape(4, 3) == 4, 0.1, 1.0) * r.angular_rate, None,
        r"gyroscope '2': expected angular rates like the others', found its y axis to read 0\.1 ",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def recording():
    return draw_board(6, SHORT).recording()


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_refused_by_name(recording, name):
    rate, force, words = MISTAKES[name]
    if rate is not None:
        recording = replace(recording, angular_rate=rate(recording))
    if force is not None:
        recording = replace(recording, specific_force=force(recording))
    with pytest.raises(InputError, match=words):
        calibrate_first_order(recording, GRAVITY)


def test_rates_in_degrees_declared_rad_are_refused(recording):
    """All moves are farther then than any is."""
    declared = {
        name: getattr(recording, name) * 180 / np.pi
        for name in ("angular_rate", "gyroscope_noise_sd", "gyroscope_range")
    }
    with pytest.raises(InputError, match="57.3 times smaller; are they in deg/s"):
        calibrate_first_order(replace(recording, **declared), GRAVITY)


def test_gyroscopes_on_other_axes_than_the_accelerometers_are_turned(recording):
    """All of them: x and y exchanged and z reversed, a half turn about the diagonal."""
    turned = recording.angular_rate[..., [1, 0, 2]] * [1, 1, -1]
    found = calibrate_first_order(replace(recording, angular_rate=turned), GRAVITY)
    plain = calibrate_first_order(recording, GRAVITY).gyroscopes.matrix
    expected = plain[:, [1, 0, 2]] * np.array([1, 1, -1])[:, None]
    np.testing.assert_allclose(found.gyroscopes.matrix, expected, atol=2e-4)
    assert any("all turned" in x for x in gyroscope_lines(found.gyroscopes, recording))


def test_without_moves_accelerometers_are_as_before_and_it_is_said(recording):
    poses = still_poses(recording)
    between = np.ones(len(recording.time), bool)
    for one, two in zip(poses[:-1], poses[1:], strict=True):
        between[one.stop + 60 : two.start - 60] = False
    gaps = recording.select(between)
    found, plain = (calibrate_first_order(gaps, GRAVITY, kind) for kind in ("calibrate", "offset"))
    np.testing.assert_array_equal(found.triads.matrix, plain.triads.matrix)
    offsets = (one.at_rest["gyroscope"].offset for one in (found, plain))
    np.testing.assert_array_equal(*offsets)
    assert "0 moves between still poses off the rails" in found.gyroscopes.common
    assert np.isnan(found.common_scale_sd) and plain.gyroscopes is None
    said = "\n".join(gyroscope_lines(found.gyroscopes, gaps))
    assert "no map common to all: 0 moves" in said and "compared with each other in" in said
    # what nothing is known of has the prior's width
    table = parameter_table(found, gaps).set_index(["sensor", "parameter"])
    assert table.loc[("gyroscope", "scale"), "sd"].to_numpy() == pytest.approx(0.01, rel=0.05)


def test_a_turned_triads_rails_show_in_all_its_axes(recording):
    found = calibrate_first_order(draw_board(6, replace(SHORT, turned=37.0)).recording(), GRAVITY)
    recording = replace(recording, angular_rate=recording.angular_rate.copy())
    recording.angular_rate[50, [0, 3], 0] = recording.gyroscope_range
    rails = correct(recording, found).saturated_gyroscopes()
    assert rails[50].sum(axis=1).tolist() == [1, 0, 0, 3] and rails.sum() == 4


@pytest.mark.parametrize("first", [False, True])
def test_a_turned_imu_is_named_and_the_drawing_follows_the_first(first):
    """The turned one is the last, or the same recording's first."""
    board = draw_board(6, replace(SHORT, turned=37.0))
    order, recording = ([3, 0, 1, 2] if first else range(4)), board.recording()
    labels = tuple(recording.accelerometer_labels[k] for k in order)
    recording = replace(
        recording, specific_force=recording.specific_force[:, order],
        angular_rate=recording.angular_rate[:, order], accelerometer_labels=labels,
        accelerometer_position=recording.accelerometer_position[order], gyroscope_labels=labels,
    )  # fmt: skip
    found = calibrate_first_order(recording, GRAVITY)
    said = turned_lines(found, recording)
    # mounts and skews are off by some half a degree themselves
    assert re.fullmatch(r"IMU 4 is turned by 3[678]\.\d degrees against .*", said[0])
    assert said[1:] == (["the drawing was turned into the axes of IMU 4"] if first else [])
    upper, rotation = rq(board.truth.accelerometers[3])
    turn = np.sign(np.diag(upper))[:, None] * rotation if first else np.eye(3)
    expected = board.drawing[order] @ turn.T
    drawing = correct(recording, found).accelerometer_position
    np.testing.assert_allclose(drawing, expected, atol=6e-4)  # two degrees of 20 mm


@pytest.mark.parametrize(("still", "count"), [(3.1, 12), (2.3, 0)])
def test_poses_of_three_seconds_are_found_and_the_longest_is_said(still, count):
    recording = draw_board(7, replace(SHORT, still=still, twisting=2.0)).recording()
    if count:
        assert len(still_poses(recording)) == count
        return
    with pytest.raises(InputError, match=r"at least 3 s .* the longest lasts 2\.[3-9] s"):
        still_poses(recording)
    with pytest.raises(InputError, match="it is corrected already: give it as `convert`"):
        still_poses(replace(recording, correction=xr.Dataset()))
    assert len(still_poses(recording, shortest=2.0)) == 12


def test_poses_that_follow_each_other_are_not_one(recording):
    """The moves are left out, and what is left is declared still as a whole."""
    poses = still_poses(recording)
    parts = [recording.select(pose) for pose in poses]
    count = sum(len(part.time) for part in parts)
    joined = replace(
        parts[0], time=np.arange(count) / 100.0,
        specific_force=np.concatenate([part.specific_force for part in parts]),
        angular_rate=np.concatenate([part.angular_rate for part in parts]),
        stationary=np.ones(count, bool),
    )  # fmt: skip
    found = still_poses(joined, shortest=1.0)
    assert len(found) == len(poses)
    ends = np.cumsum([len(part.time) for part in parts])
    assert [int(np.searchsorted(ends, (p.start + p.stop) / 2)) for p in found] == list(range(12))


def test_the_file_and_the_report_carry_it(tmp_path, recording, capsys):
    write_recording(recording, tmp_path / "rec.nc")
    given = ["first-order", str(tmp_path / "rec.nc"), "--gravity", str(GRAVITY), "--out"]
    assert main([*given, str(tmp_path / "a.nc")]) == 0
    said = capsys.readouterr().out
    assert "11 moves carry gravity from pose to pose to 0.0" in said and "turned deg" in said
    assert main([*given, str(tmp_path / "b.nc"), "--gyroscopes", "offset"]) == 0
    assert "gyroscopes: offsets only" in capsys.readouterr().out
    with_maps, without = (load_dataset(tmp_path / f"{x}.nc", "first_order") for x in "ab")
    sd = with_maps.attrs["gyroscope_common_scale_sd"]
    diagonal = with_maps.gyroscope_common_covariance.to_numpy()[::4, ::4]
    assert sd == pytest.approx(np.sqrt(diagonal.sum()) / 3)
    assert "gyroscope_matrix" not in without and "gyroscope_common_scale_sd" not in without.attrs
    assert of_file(tmp_path / "a.nc").ratio == pytest.approx(1.0, abs=0.3)
    assert np.isnan(of_file(tmp_path / "b.nc").scale)
    # what later steps read
    assert main(["select", str(tmp_path / "a.nc"), "--out", str(tmp_path / "c.nc")]) == 0
    kept, bare = (read_recording(tmp_path / f"{x}.nc") for x in "cb")
    # maps relative to a common one that is 1 within some per cent
    assert kept.gyroscope_common_scale_sd == pytest.approx(sd, rel=0.02)
    assert np.isnan(bare.gyroscope_common_scale_sd)
    assert len(kept.map_covariance) == 2 * len(bare.map_covariance)


def test_a_common_scale_far_from_one_is_told():
    """Stamps and gyroscopes' scale look alike in the moves; accelerometers do not decide."""
    (said,) = reasons_of_poses(Poses(1.0, 0.001, 0.999), Poses(1.0, 0.001, 0.96))
    assert "read 4.2 % too much" in said and "time base" in said and "8.3 % too small" in said
    # a residual of many sds that is nothing: sensors behind a filter, long poses
    assert reasons_of_poses(Poses(7.0, 0.004, 1.01)) == []
    assert "fit 7 times worse" in reasons_of_poses(Poses(7.0, 0.04, 1.01))[0]


def test_poses_that_fit_badly_are_told(tmp_path, recording, capsys):
    """A board that bends as gravity pulls at it; here, and by what reads the file."""
    force = recording.specific_force.copy()
    force[:, 1, 0] += 0.3 * (force[:, 0, 1] / GRAVITY) ** 3
    force[:, 2, 1] += 0.3 * (force[:, 0, 2] / GRAVITY) ** 3
    write_recording(replace(recording, specific_force=force), tmp_path / "rec.nc")
    out = str(tmp_path / "out.nc")
    given = ["first-order", str(tmp_path / "rec.nc"), "--gravity", str(GRAVITY), "--out", out]
    assert main(given) == 3
    assert "not to be trusted: the still poses fit" in capsys.readouterr().err
    assert of_file(out).ratio > TRUST.pose_noise
    cal = ["calibrate", out, "--model", "papers", "--out", str(tmp_path / "cal.nc"), "--quiet"]
    assert main(cal) == 3
    assert "still poses fit" in load_dataset(tmp_path / "cal.nc").attrs["reasons"]


def test_offsets_that_drift_bias_no_position(tmp_path, capsys):
    """By 2 mg in 60 s, as of a sensor that warms up; with steady offsets 50 um are wrong."""
    board = draw_board(6, SHORT)
    recording = board.recording()
    force = recording.specific_force.copy()
    force[:, 1] += np.linspace(0.0, 0.2, len(force))[:, None] * [0.0, 1.0, 0.5]
    write_recording(replace(recording, specific_force=force), tmp_path / "rec.nc")
    out, cal = (str(tmp_path / name) for name in ("out.nc", "cal.nc"))
    given = ["first-order", str(tmp_path / "rec.nc"), "--gravity", str(GRAVITY), "--out", out]
    assert main(given) == 0
    said = re.search(r"in a minute by some: accelerometers (\S+) mm/s", capsys.readouterr().out)
    assert 10 < float(said[1]) < 100
    assert main(["calibrate", out, "--out", cal, "--quiet"]) == 0
    assert rms(off(board, load_dataset(cal))) < 20e-6
    assert main(["calibrate", out, "--model", "papers", "--out", cal, "--quiet"]) == 3
    assert rms(off(board, load_dataset(cal))) > 40e-6
    assert "offsets drift by some" in load_dataset(cal).attrs["reasons"]


def off(board, calibration):
    """Errors (A - 1, 3) m of positions."""
    position = calibration["position"].to_numpy()
    return (position - position[0] - board.truth.positions)[1:]


def test_stamps_that_run_fast_make_the_size_uncertain():
    """By 0.3 %: gyroscopes whose own scales hardly scatter do not explain what they share."""
    sound = draw_board(6, replace(SHORT, ideal_gyroscopes=True)).recording()
    fast = replace(sound, time=1.003 * sound.time)
    known, doubtful = (correct(one, calibrate_first_order(one)).clock_sd for one in (sound, fast))
    assert not known > 1e-3 and doubtful == pytest.approx(3e-3, abs=1e-3)


def test_a_declared_rate_is_doubted_sooner_than_stamps():
    """One per cent off beside scales that scatter by half as much."""
    sound = draw_board(7, SHORT).recording()
    wrong = replace(sound, time=sound.time / 1.01)
    found = calibrate_first_order(wrong)
    assert shared_chance(found.gyroscopes.matrix) > SETTINGS.odd_scale
    given = (0.0, 1e-5, 1e-3)  # stamps, the user's word, a declared rate
    stamped, own, declared = (correct(replace(wrong, clock_sd=sd), found).clock_sd for sd in given)
    assert stamped < declared and own == pytest.approx(stamped, rel=0.1)
    assert 7e-3 < declared < 0.02
    right = correct(replace(sound, clock_sd=1e-3), calibrate_first_order(sound)).clock_sd
    assert right < 2.5e-3


@pytest.mark.parametrize(("mean", "freedom"), [(0.0, 11), (0.004, 11), (-0.01, 5), (0.02, 40)])
def test_odds_of_a_shift_are_those_of_both_densities(mean, freedom):
    normal, student = stats.norm(0, np.hypot(2e-3, 0.01)), stats.t(freedom, 0, 2e-3)
    wanted = normal.pdf(mean) / student.pdf(mean)
    assert shift_odds(mean, 2e-3, freedom, 0.01) == pytest.approx(wanted, rel=1e-12)


def test_a_gyroscope_that_failed_is_not_one_of_another_scale(recording):
    rate = recording.angular_rate.copy()
    half = len(rate) // 2
    rate[half:, 2] = rate[half, 2]
    with pytest.raises(InputError, match=f"gyroscope '{recording.gyroscope_labels[2]}' repeats"):
        calibrate_first_order(replace(recording, angular_rate=rate), GRAVITY)
