"""Mistakes that leave no residual, and those that do: status 3 or 2, and the suspect by name."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

import imuarray
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.firstorder.correct import corrected
from imuarray.firstorder.gyroscopes import shared_chance
from imuarray.firstorder.settings import SETTINGS as FIRSTORDER
from imuarray.geometry import mimu4444, mimu4444_corners
from imuarray.recording.record import CORRECTION
from imuarray.trust import misfit
from imuarray.trust import reasons as doubts
from imuarray.trust.drawing import Places, departures
from imuarray.trust.misfit import changed, residuals, unsteady
from imuarray.trust.rigid import slope, turning
from imuarray.trust.settings import SETTINGS
from imuarray.trust.suspects import clipped, suspects, wrapped
from imuarray_papers.blind.cases import Case, make

CASE = Case("trust", duration=8.0)
FLIP = np.array([1.0, 1.0, -1.0])
DEGREE = np.pi / 180


@pytest.fixture(scope="module")
def sound():
    return make(CASE, 1)[0]


def swapped(values, i, j):
    """Columns ``i`` and ``j`` of (T, K, 3) readings exchanged."""
    order = np.arange(values.shape[1])
    order[[i, j]] = j, i
    return values[:, order]


def one(recording, imu, change, kinds=("specific_force", "angular_rate")):
    """The recording with ``change`` of an IMU's readings (T, 3)."""
    fields = {name: getattr(recording, name).copy() for name in kinds}
    for values in fields.values():
        values[:, imu] = change(values[:, imu])
    return replace(recording, **fields)


def times(recording, force=1.0, rate=1.0):
    """Readings times factors."""
    return replace(
        recording, specific_force=recording.specific_force * force,
        angular_rate=recording.angular_rate * rate,
    )  # fmt: skip


def turned(degrees):
    """IMU 3 turned about an axis that is none of its own."""
    rotation = Rotation.from_rotvec(degrees * DEGREE * np.array([0.36, 0.48, 0.8]))
    return lambda recording: one(recording, 2, rotation.apply)


def late(values):
    """By one sample."""
    return np.vstack([values[:1], values[:-1]])


def doubled(recording):
    half = len(recording.time) // 2
    whole = np.r_[np.arange(2 * half), np.arange(half)]
    found = recording.select(whole)
    return replace(found, time=np.arange(len(whole)) * recording.time[1])


def with_poses(recording):
    """A still pose at the end, in units of g as the rest."""
    count, rng = 200, np.random.default_rng(0)
    shape = recording.specific_force.shape[1:]
    force = [0, 0, 9.81] + 0.04 * rng.standard_normal((count, *shape))
    rate = 1e-3 * rng.standard_normal((count, *recording.angular_rate.shape[1:]))
    samples = len(recording.time)
    found = replace(
        recording, time=np.arange(samples + count) * recording.time[1],
        specific_force=np.concatenate([recording.specific_force, force]),
        angular_rate=np.concatenate([recording.angular_rate, rate]),
        stationary=np.arange(samples + count) >= samples,
    )  # fmt: skip
    return times(found, force=1 / 9.81)


GYROSCOPE, ACCELEROMETER = ("angular_rate",), ("specific_force",)
MISTAKES = {
    "two IMUs exchanged": (
        lambda r: replace(r, specific_force=swapped(r.specific_force, 2, 5)),
        "IMUs 3 and 6 come out at each other's place",
    ),
    "the reference exchanged": (
        lambda r: replace(r, specific_force=swapped(r.specific_force, 0, 3)),
        "IMUs 1 and 4 come out at each other's place",
    ),
    "specific force of the wrong sign": (
        lambda r: times(r, force=-1.0), "specific force of the wrong sign"
    ),
    "z of both sensors flipped": (lambda r: times(r, FLIP, FLIP), "left-handed axes"),
    "all rates of the wrong sign": (lambda r: times(r, rate=-1.0), "all rates of the wrong sign"),
    "z of the gyroscopes flipped": (
        lambda r: times(r, rate=FLIP), "all gyroscopes have axis z of the wrong sign"
    ),
    "g declared as m/s^2": (
        lambda r: times(r, force=1 / 9.81), "specific force in g declared m/s^2"
    ),
    "g declared as m/s^2, with still poses": (
        with_poses, "in the still poses is 1 m/s^2, gravity 9.807: in g declared"
    ),
    "gyroscopes in deg/s declared rad/s": (
        lambda r: times(r, rate=1 / DEGREE), "too small: gyroscopes in deg/s declared"
    ),
    "degrees to radians twice": (
        lambda r: times(r, rate=DEGREE), "too large: gyroscopes in rad/s declared"
    ),
    "gyroscopes 2.4 % too large": (
        lambda r: times(r, rate=1.024), "angular acceleration says: gyroscopes 2."
    ),
    "nominal positions in mm declared m": (
        lambda r: replace(r, accelerometer_position=1e3 * r.accelerometer_position),
        "nominal positions in mm declared m",
    ),
    "nominal positions in cm declared mm": (
        lambda r: replace(r, accelerometer_position=0.1 * r.accelerometer_position),
        "nominal positions in cm declared mm",
    ),
    "stamps in ms declared s": (
        lambda r: replace(r, time=1e3 * r.time), "in ms declared s"
    ),
    "half of the recording twice": (doubled, "500 of 1500 samples are copies"),
    "an IMU at 37 degrees": (turned(37), "IMU 3 is turned by 37 degrees"),
    "an IMU at 90 degrees": (turned(90), "IMU 3 is turned by 90 degrees"),
    "an IMU at 2 degrees": (turned(2), "gyroscope 3 is turned by 2 degrees"),
    "a gyroscope's axis of the wrong sign": (
        lambda r: one(r, 2, lambda x: x * [1, -1, 1], GYROSCOPE),
        "gyroscope 3 has axis y of the wrong sign",
    ),
    "an accelerometer's axes exchanged": (
        lambda r: one(r, 2, lambda x: x[:, [1, 0, 2]], ACCELEROMETER),
        "accelerometer 3 reads y, x, z in place of x, y, z",
    ),
    "an IMU one sample late": (lambda r: one(r, 2, late), "IMU 3 is 1 sample late"),
    "a clipped accelerometer": (
        lambda r: one(r, 2, lambda x: np.clip(x, -12, 12), ACCELEROMETER),
        "accelerometer 3, axis x, is clipped at -12 and 12",
    ),
    "the array turned against the drawing": (
        lambda r: replace(
            r, accelerometer_position=r.accelerometer_position @ Rotation.from_rotvec(
                [0, 0, 37 * DEGREE]
            ).as_matrix()
        ), "turned by 37 degrees: are the sensors in the drawing's frame?",
    ),
}  # fmt: skip
REFUSED = {
    "a constant channel": (
        lambda r: one(r, 2, lambda x: x * [0, 1, 1], GYROSCOPE), "gyroscope '3', axis x"
    ),
    "an IMU given twice": (
        lambda r: replace(r, specific_force=r.specific_force[:, [0, 1, 2, 2, 4, 5, 6, 7]]),
        "accelerometer '4' reads what '3' reads",
    ),
    "hardly any motion": (
        lambda r: replace(
            r, angular_rate=np.random.default_rng(0).normal(0, 1e-3, r.angular_rate.shape),
            specific_force=np.random.default_rng(1).normal(0, 0.04, r.specific_force.shape),
        ), "expected rotation",
    ),
}  # fmt: skip


PAPERS = ("--model", "papers")


def calibrated(recording, folder, capsys, options=PAPERS) -> tuple[int, str, dict]:
    """Status, last line and JSON of `imuarray calibrate`."""
    imuarray.write_recording(recording, folder / "rec.nc")
    asked = ["calibrate", str(folder / "rec.nc"), "--json", *options]
    capsys.readouterr()
    status = main([*asked, "--out", str(folder / "cal.nc")])
    said = capsys.readouterr()
    return status, said.err, json.loads(said.out) if status in (0, 3) else {}


@pytest.mark.filterwarnings("ignore:.*gap")
@pytest.mark.parametrize("mistake", [*MISTAKES, *REFUSED])
def test_a_mistake_is_named(sound, mistake, tmp_path, capsys):
    change, words = (MISTAKES | REFUSED)[mistake]
    status, said, document = calibrated(change(sound), tmp_path, capsys)
    assert words in said and said.count("\n") == 1
    if mistake in REFUSED:
        assert status == 2 and not (tmp_path / "cal.nc").exists()
        return
    assert status == 3 and document["trusted"] is False
    with xr.open_dataset(tmp_path / "cal.nc") as written:
        assert written.attrs["trusted"] == 0
        assert json.loads(written.attrs["reasons"]) == document["reasons"]


@pytest.mark.parametrize("mistake", ["", "two IMUs exchanged", "an IMU at 90 degrees"])
def test_a_mistake_under_the_default_model(sound, mistake, tmp_path, capsys):
    """Which estimates noise, and so makes its sds as large as a wrong sensor wants them."""
    change, words = MISTAKES.get(mistake, (lambda recording: recording, ""))
    recording = change(sound).select(slice(0, 500))
    status, said, _ = calibrated(recording, tmp_path, capsys, ())
    assert status == (3 if mistake else 0) and words in said


SOUND = [
    Case("sound", duration=4.0), Case("sound", duration=8.0, rails=True),
    Case("sound", imus=32, duration=4.0), Case("sound", sampling_rate=62.5, duration=8.0),
]  # fmt: skip


@pytest.mark.parametrize("case", SOUND, ids=["8", "rails", "32", "62.5 Hz"])
def test_a_sound_recording_gives_none(case):
    """101 of 101 others did not either; at p = 1e-6 none should."""
    for seed in range(3):
        recording, _ = make(case, seed)
        found = imuarray.calibrate(recording, "papers")
        assert doubts.reasons_of_calibration(recording, found) == []


def test_samples_that_are_no_course_give_none():
    """The papers' motion, drawn anew for each sample, has no angular acceleration in time."""
    recording, _ = imuarray.simulate(mimu4444_corners(), 4.0, 100.0, seed=1)
    shuffled = recording.select(np.random.default_rng(0).permutation(len(recording.time)))
    recording = replace(shuffled, time=recording.time)
    found = imuarray.calibrate(recording, "papers")
    assert doubts.reasons_of_calibration(recording, found) == []


def test_a_drawing_wrong_by_its_declared_amount_gives_none():
    """And one wrong by eight times as much gives a sentence, whichever triad it is."""
    nominal, rng = mimu4444().relative, np.random.default_rng(0)
    labels, prior = mimu4444().labels, 1e-3

    def said(off):
        found = nominal + off - off[0]
        return departures(Places(labels, found, nominal, np.zeros((96, 96)), prior))

    assert not any(said(prior * rng.standard_normal(nominal.shape)) for _ in range(200))
    for k in (0, 7):
        off = prior * rng.standard_normal(nominal.shape)
        off[k] += [0, 0, 8 * prior]
        assert said(off).startswith(f"IMU {labels[k]} comes out")
    assert "too large" in said(0.15 * nominal)  # 8.5 sds of the size


def test_the_motion_of_a_rigid_array():
    places, rng = mimu4444_corners().relative, np.random.default_rng(0)
    rate, turn, force = rng.standard_normal((3, 20, 3))
    w, a = rate[:, None], turn[:, None]
    readings = np.cross(w, np.cross(w, places)) + np.cross(a, places) + force[:, None]
    found = turning(readings, rate, places)
    np.testing.assert_allclose(found.acceleration, turn, atol=1e-12)
    np.testing.assert_allclose(found.force, force, atol=1e-12)
    np.testing.assert_allclose(found.at(places), readings, atol=1e-12)
    # two triads do not see the turning about the line through them
    two = turning(readings[:, :2], rate, places[:2])
    along = (places[1] - places[0]) / np.linalg.norm(places[1] - places[0])
    np.testing.assert_allclose(two.acceleration @ along, 0.0, atol=1e-12)
    np.testing.assert_allclose(two.acceleration, turn - np.outer(turn @ along, along), atol=1e-12)


def test_two_suspects_are_both_named(sound):
    recording = one(turned(20)(sound), 5, late)
    assert suspects(recording) == ["IMU 3 is turned by 20 degrees", "IMU 6 is 1 sample late"]


def test_a_delay_among_samples_that_are_no_course(sound):
    few = one(sound, 2, late, GYROSCOPE).select(slice(0, None, 7))
    shaken = np.sort(np.random.default_rng(0).uniform(0, 8, len(few.time)))
    assert suspects(replace(few, time=shaken)) == ["gyroscope 3 is 8 ms late"]


def test_samples_too_far_apart_for_an_integral_give_none(sound):
    """Of motion at some 4 Hz every fourth sample, 31 a second, leaves 4 % out."""
    few = sound.select(slice(0, None, 4))
    found = slope(few.time, turning(few.specific_force, np.median(few.angular_rate, axis=1),
                                    sound.relative_positions()))  # fmt: skip
    assert found.low > 1.01 and not found.off


@pytest.mark.parametrize("share", [0.0, 0.005])
def test_samples_dropped_before_they_were_stamped_are_seen_as_longer_steps(share):
    """One in 200 is gone, the stamps are even again: its neighbours' rates differ twice as much."""
    whole, _ = imuarray.simulate(mimu4444(), 20.0, 200.0, seed=4, angular_rate=10.0)
    left = np.random.default_rng(1).random(len(whole.time)) >= share
    fewer = replace(whole.select(left), time=whole.time[: left.sum()])
    rate = np.median(fewer.angular_rate, axis=1)
    motion = turning(fewer.specific_force, rate, fewer.relative_positions())
    skipped = slope(fewer.time, motion).skipped
    assert 0.2 * np.sum(~left) <= skipped <= np.sum(~left) if share else skipped == 0


def posterior_of(found, scale=1.0):
    """A posterior as of `sample`, its draws from a calibration's normal approximation."""
    covariance = found["position_covariance"].to_numpy().reshape((24, 24))[3:, 3:]
    rng, mean = np.random.default_rng(0), scale * found["position"].to_numpy()[1:].ravel()
    draws = rng.multivariate_normal(mean, covariance, size=200).reshape(2, 100, 7, 3)
    part = xr.Dataset({"position": (("chain", "draw", "accelerometer", "axis"), draws)})
    tree = xr.DataTree.from_dict({"posterior": part})
    tree.attrs["converged"] = 1
    return tree


def test_a_posterior(sound):
    found = imuarray.calibrate(sound, "papers")
    assert doubts.reasons_of_posterior(sound, posterior_of(found)) == []
    wrong = times(sound, force=-1.0)
    (said,) = doubts.reasons_of_posterior(wrong, posterior_of(found, -1.0))
    assert "specific force of the wrong sign" in said
    noisy = one(sound, 2, lambda x: x + 0.1 * np.sin(np.arange(len(x)))[:, None], GYROSCOPE)
    (said,) = doubts.reasons_of_posterior(noisy, posterior_of(found))
    assert "gyroscope 3 does not fit the others" in said
    assert doubts.reasons_of_posterior(noisy, posterior_of(found), spread=True) == []
    tree = posterior_of(found)
    tree.attrs["converged"] = 0
    assert doubts.reasons_of_posterior(sound, tree) == [
        "the search or the chains have not converged"
    ]
    # noise that has taken up what the model does not have
    tree["posterior"]["effect_parameter"] = ("chain", "draw"), np.zeros((2, 100))
    names = "accelerometer_noise_sd", "gyroscope_noise_sd"
    tree.attrs |= {name: 3.5 * getattr(noisy, name) for name in names}
    said, _ = doubts.reasons_of_posterior(noisy, tree)
    assert "3.5 times the declared noise: gyroscope 3" in said


def test_a_diagnosis(sound):
    """Its extended model's positions against the drawing, as every answer's."""
    found = imuarray.calibrate(sound, "papers")
    sds = np.sqrt(np.einsum("kaka->ka", found["position_covariance"].to_numpy()))
    places = found["position"].to_numpy()

    def reasons(recording, positions):
        section = {"positions_m": positions.tolist(), "positions_sd_m": sds.tolist()}
        return doubts.reasons_of_diagnosis(recording, {"extended": section})

    assert reasons(sound, places) == []
    (said,) = reasons(times(sound, force=-1.0), -places)
    assert "specific force of the wrong sign" in said


def test_a_recording_that_says_little(sound):
    """Whatever sds are claimed of it; slow enough for its motion to be good for an application."""
    found = imuarray.calibrate(sound, "papers")
    slow = replace(times(sound, 1e-4, 1e-2), time=100 * sound.time)
    (said,) = doubts.reasons_of_calibration(slow, found)
    assert "says little of the positions" in said
    assert doubts.reasons_of_motion(slow, found) == []


def test_positions_known_worse_than_drawn(sound):
    """Neither their size nor where the search ended is a reason then."""
    drawn = replace(sound, accelerometer_position=4.2 * sound.accelerometer_position)
    found = xr.Dataset(
        {"position": (("accelerometer", "axis"), sound.relative_positions())},
        attrs={"model": "papers", "residual_ratio": 1.0, "converged": 0},
    )
    one = np.eye(3 * len(sound.accelerometer_labels)) * sound.position_prior_sd**2
    known, little = (
        doubts.reasons_of_calibration(
            drawn, found.assign(position_covariance=(("row", "column"), share * one))
        )
        for share in (0.01, 4.0)
    )
    assert "the array comes out 4.2 times too small" in known[0] and "converged" in known[1]
    assert "8 s are too short: record a dozen still poses and a minute" in little[0]
    # the drawn places, taken for found ones here, leave a residual
    assert len(little) == 2 and "most at accelerometer" in little[1]


def test_several_recordings_of_a_board(sound):
    found = imuarray.calibrate(sound, "papers")
    assert doubts.reasons_of_calibration([sound, sound], found) == []
    wrong = times(sound, rate=-1.0)
    (said,) = doubts.reasons_of_calibration([sound, wrong], found)
    assert said.startswith("recording 2: the gyroscopes turn the other way round")


def test_a_selection_that_finds_no_motion_names_the_unit(sound):
    with pytest.raises(imuarray.InputError, match="rates in rad/s declared deg/s"):
        imuarray.select(times(sound, rate=DEGREE), 20)


def test_a_motion_of_another_board_s_calibration(sound, tmp_path, capsys):
    other, _ = make(CASE, 2)
    assert calibrated(other, tmp_path, capsys)[0] == 0
    imuarray.write_recording(sound, tmp_path / "rec.nc")
    files = [str(tmp_path / name) for name in ("cal.nc", "rec.nc")]
    status = main(["apply", *files, "--out", str(tmp_path / "motion.nc"), "--quiet"])
    said = capsys.readouterr().err
    assert status == 3 and "times the declared noise" in said and "of another board?" in said
    # a calibration that is not to be trusted makes no motion that is
    calibrated(times(sound, rate=1.024), tmp_path, capsys)
    imuarray.write_recording(sound, tmp_path / "rec.nc")
    status = main(["apply", *files, "--out", str(tmp_path / "motion.nc"), "--quiet"])
    assert status == 3 and "the calibration is not to be trusted" in capsys.readouterr().err


@pytest.mark.parametrize("effect", ["sensor_clock", "bias_drift", "position_shift"])
def test_what_looks_at_the_time_is_of_its_own_recording(sound, effect):
    rate = np.median(sound.angular_rate, axis=1)[::2]
    calibration = xr.Dataset(
        {"angular_rate": (("time", "axis"), rate)}, {"time": sound.time[::2]},
        {"effects": f"{effect},gyroscope_delay", "model": "diagnosis"},
    )  # fmt: skip
    part = sound.select(slice(100, 400))
    assert doubts._of_another_time(sound, calibration, False) == []
    assert doubts._of_another_time(part, calibration, False) == []
    another = make(CASE, 2)[0]
    later = replace(another, time=another.time + 100.0)
    for one in (another, later):
        (said,) = doubts._of_another_time(one, calibration, False)
        assert effect in said
        assert bool(doubts._of_another_time(one, calibration, True)) == (effect != "sensor_clock")
    without = calibration.assign_attrs(effects="gyroscope_delay")
    assert doubts._of_another_time(another, without, False) == []


def test_a_rail_within_the_range_shows_under_a_correction(sound):
    raw = one(sound, 2, lambda x: np.clip(x, -12, 12), ACCELEROMETER)
    rng, variables = np.random.default_rng(3), {}
    for kind, values in (("accelerometer", raw.specific_force), ("gyroscope", raw.angular_rate)):
        inverse = np.eye(3) + 0.005 * rng.standard_normal((values.shape[1], 3, 3))
        offset = 0.05 * rng.standard_normal(values.shape[1:])
        parts = {"inverse": inverse, "offset": offset, "offset_sd": offset,
                 "offset_walk": offset[:, 0]}  # fmt: skip
        variables |= {f"{kind}_{n}": (CORRECTION[f"{kind}_{n}"], x) for n, x in parts.items()}
    correction = xr.Dataset(variables)
    found = replace(
        raw, correction=correction, specific_force=corrected(
            *(variables[f"accelerometer_{n}"][1] for n in ("inverse", "offset")), raw.specific_force
        ), angular_rate=corrected(
            *(variables[f"gyroscope_{n}"][1] for n in ("inverse", "offset")), raw.angular_rate
        ),
    )  # fmt: skip
    assert clipped(found) == clipped(raw) != []


def test_rough_motion_is_judged_by_its_smooth_samples(sound):
    labels = list(sound.accelerometer_labels)
    ones = np.ones(len(labels))
    calibration = xr.Dataset(
        {
            "accelerometer_smooth_residual": ("accelerometer", ones),
            "gyroscope_smooth_residual": ("gyroscope", 2 * ones),
        },
        {"accelerometer": labels, "gyroscope": labels}, {"residual_ratio": 40.0},
    )  # fmt: skip
    found = residuals(sound, calibration, None)
    assert found[""] == pytest.approx(np.sqrt(2.5)) and found[f"gyroscope {labels[0]}"] == 2.0


def jumped(recording, imu, by=(0.1, 0.1, 0.1)):
    """The recording with an accelerometer's offset other from its middle on."""
    late = recording.time > recording.time.mean()
    return one(recording, imu, lambda read: read + np.outer(late, by), ("specific_force",))


@pytest.mark.parametrize("imu", [0, 2], ids=["the reference", "another"])
def test_an_offset_that_jumps_is_named(sound, imu, monkeypatch):
    """It leaves hardly a residual: all parts of the recording fit, at other places of the IMU."""
    monkeypatch.setattr(doubts, "unsteady", lambda found, *_: unsteady(found, True))
    found = imuarray.calibrate(jumped(sound, imu))
    assert found.attrs["residual_ratio"] < 1.5
    (reason,) = doubts.reasons_of_calibration(jumped(sound, imu), found)
    assert f"on the place of IMU {sound.accelerometer_labels[imu]}, by" in reason


@pytest.mark.parametrize(
    ("ratios", "corrected", "named"),
    [
        ([1.3, 1.0, 1.2], True, None),
        ([3.0, 1.5, 1.4], False, "IMU 2"),
        ([4.0, 5.0, 1.4, 1.3], False, "IMU 2 and 3"),
        ([4.0, 4.2, 4.4], True, "IMU 1"),
        ([4.0, 4.2, 4.4], False, None),  # wrong scales do the same
        ([9.0], True, "IMU 1 and 2"),
    ],
)  # fmt: skip
def test_whom_parts_of_a_recording_disagree_on(ratios, corrected, named):
    ones = np.ones((len(ratios) + 1, 3))
    ones[0] = 0.0
    wide = ones.copy()
    wide[1:] *= np.array(ratios)[:, None]
    sds = {"position_sd_jackknife": wide, "position_sd_formal": ones}
    labels = [str(k + 1) for k in range(len(ones))]
    calibration = xr.Dataset(
        {name: (("accelerometer", "axis"), value) for name, value in sds.items()},
        {"accelerometer": labels},
    )
    found = unsteady(calibration, corrected)
    assert not found if named is None else f"the place of {named}, by" in found[0]
    joint = unsteady(calibration, corrected, 2)
    assert not joint if named is None else joint[0].startswith("the recordings disagree")


@pytest.mark.parametrize(
    ("size", "stretches", "effects", "named"),
    [(5, 5, "", True), (2, 5, "", False), (5, 1, "", False), (5, 20, "", False),
     (5, 5, "gyroscope_filter", False)],
)  # fmt: skip
def test_a_triad_that_fits_a_part_of_the_time_is_named(size, stretches, effects, named):
    rms = np.ones((20, 3))
    rms[:stretches, 1] = size
    found = changed(xr.Dataset(
        {"gyroscope_residual": (("stretch", "gyroscope"), rms)},
        {"stretch": np.arange(20.0), "gyroscope": ["a", "b", "c"]}, {"effects": effects},
    ))  # fmt: skip
    assert bool(found) == named
    assert all(said.startswith("gyroscope b does not fit the others in 25 %") for said in found)


def test_a_search_that_diverges_is_bad_input(monkeypatch, sound):
    """As of a raw pair, one of them turned by 37 degrees: its equations end in infinities."""

    def diverge(*_, **__):
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr("imuarray.analysis.sensors.select_forward", diverge)
    with pytest.raises(InputError, match="search that diverges.*imuarray first-order"):
        imuarray.calibrate(sound)


def test_a_map_that_does_not_hold_while_twisting_is_named(sound):
    """A triad that turned between the poses and the twisting; one that did not is no matter."""
    count = len(sound.accelerometer_labels)
    sound = replace(sound, map_covariance=1e-8 * np.eye(9 * count))
    found = imuarray.calibrate(sound)
    assert found.attrs["accelerometer_maps_hold"] > SETTINGS.maps_chance
    assert doubts._moved_maps(found) == []
    turn = Rotation.from_rotvec([0, 0, np.radians(1.0)]).as_matrix()
    force = sound.specific_force.copy()
    force[:, 2] = force[:, 2] @ turn
    said = doubts._moved_maps(imuarray.calibrate(replace(sound, specific_force=force)))
    assert len(said) == 1 and f"accelerometer {sound.accelerometer_labels[2]} does not" in said[0]


def test_one_imu_that_moves_explains_what_all_growing_does_not(sound):
    """Half a millimetre, in the middle."""
    rate = np.median(sound.angular_rate, axis=1)
    turn = np.gradient(rate, sound.time, axis=0)
    shift = np.array([5e-4, 0.0, 0.0])
    more = np.cross(rate, np.cross(rate, shift)) + np.cross(turn, shift)
    late = (sound.time > np.median(sound.time))[:, None]
    force = sound.specific_force.copy()
    force[:, 2] += late * more
    found = imuarray.calibrate(replace(sound, specific_force=force))
    assert found.attrs["farthest_moved"] == sound.accelerometer_labels[2]
    assert found.attrs["farthest_move"] > 100.0
    found.attrs |= {"size_growth": 0.01, "size_growth_sd": 1e-3}
    (reason,) = doubts._grows(found)
    assert reason.startswith(
        f"parts of the recording disagree on the place of IMU {found.attrs['farthest_moved']}"
    )
    found.attrs["farthest_move"] = 10.0
    assert "the array grows by 1 %" in doubts._grows(found)[0]


def test_maps_of_all_others_are_the_first_ones():
    """All maps are in the first accelerometer's axes."""
    attrs = {"accelerometer_maps_hold": 0.0, "accelerometer_maps_farthest": "c, b"}
    found = xr.Dataset(coords={"accelerometer": ["a", "b", "c"]}, attrs=attrs)
    assert (
        "gave accelerometer a (in its axes c, b all differ) does not"
        in doubts._moved_maps(found)[0]
    )
    found.attrs["accelerometer_maps_farthest"] = "c"
    assert "gave accelerometer c does not" in doubts._moved_maps(found)[0]


def test_an_array_that_shrinks_while_it_moves_is_told(sound):
    """The scale of all gyroscopes rises by 0.5 %, and with its square the centrifugal force."""
    assert doubts._grows(imuarray.calibrate(sound)) == []
    rise = np.linspace(1.0, 1.005, len(sound.time))[:, None, None]
    (said,) = doubts._grows(
        imuarray.calibrate(replace(sound, angular_rate=rise * sound.angular_rate))
    )
    assert "scales rise" in said and 0.9 < float(re.search(r"by (\S+) %", said)[1]) < 1.1


def test_an_odd_scale_of_all_gyroscopes_is_the_time_base_or_theirs():
    rng, maps = np.random.default_rng(3), np.tile(np.eye(3), (6, 1, 1))
    maps += 0.005 * rng.standard_normal((6, 3, 1)) * np.eye(3)
    chances = [shared_chance(part * maps) for part in (1.0, 1.015)]
    assert chances[0] > FIRSTORDER.odd_scale > chances[1]
    assert misfit.reasons_of_poses(misfit.Poses(scale=1.0, chance=chances[0])) == []
    (said,) = misfit.reasons_of_poses(misfit.Poses(scale=1 / 1.015, chance=chances[1]))
    assert "read 1.5 % too much" in said and "time base" in said
    assert misfit.reasons_of_poses(misfit.Poses(scale=1.003, chance=1e-9)) == []


def test_gyroscopes_that_wrap_are_named(sound):
    end = 0.5 * np.abs(sound.angular_rate).max()
    [said] = wrapped(one(sound, 1, lambda x: (x + end) % (2 * end) - end, ("angular_rate",)))
    assert (
        f"other: {sound.gyroscope_labels[1]} (" in said
        and sound.gyroscope_labels[2] + " (" not in said
    )
    assert float(said.split("wrap at ")[1].split()[0]) == pytest.approx(np.degrees(end), rel=0.05)
    assert wrapped(sound) == []


def test_a_flat_drawing_from_the_other_side_is_named():
    nominal = np.array([[0, 0, 0], [20, 0, 0], [0, 25, 0], [22, 31, 0]]) * 1e-3
    found, covariance = nominal * [-1, 1, 1], 1e-12 * np.eye(12)
    said = departures(Places(("1", "2", "3", "4"), found, nominal, covariance, 1e-4, hand=1))
    assert "mirrored in x: was it drawn from the other side, or turned by 180 degrees?" in said


def test_the_noise_of_the_only_gyroscope_stays_as_declared(sound):
    """There is nothing to hold it against; estimated it came out 24 times as large."""
    alone = replace(
        sound, angular_rate=sound.angular_rate[:, :1], gyroscope_labels=sound.gyroscope_labels[:1]
    )
    found = imuarray.calibrate(alone)
    np.testing.assert_allclose(found.gyroscope_sd, alone.gyroscope_noise_sd)
    assert doubts.reasons_of_calibration(alone, found) == []


def test_a_late_imu_of_another_recording_contradicts_the_calibration(sound):
    """Without effects the rigid array says so, with effects the residual under these."""
    found = imuarray.calibrate(sound)
    late = sound.angular_rate.copy()
    late[20:, 1] = late[:-20, 1]
    said = doubts.reasons_of_motion(replace(sound, angular_rate=late), found)
    assert any("the residual is" in one for one in said), said
    own = found.assign_attrs(effects="sensor_delay")
    assert doubts.reasons_of_motion(sound, own, ratio=1.3) == []
    (said,) = doubts.reasons_of_motion(sound, own, ratio=30.0)
    assert "the residual is 30 times the declared noise" in said
