"""`imuarray apply`: from a calibration and a recording to the motion, end to end."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import imuarray
from imuarray.cli import main
from imuarray.firstorder.correct import corrected
from imuarray.firstorder.rails import less_leak_by_others, rails_shown
from imuarray.motion import normal_motion
from imuarray.recording import read_recording, write_recording
from imuarray.recording.record import CORRECTION
from imuarray.simulation.recordings import measure
from tests.cases import model
from tests.recording.cases import make

RAIL = 25.0  # rad/s


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """(calibration, recording, its truth): 5 triads, 200 samples, gyroscopes at rails."""
    folder, rng, own = tmp_path_factory.mktemp("apply"), np.random.default_rng(1), model()
    motion = normal_motion(rng, (200,), 15.0, 300.0, 10.0)
    force, rate, _ = measure(own, motion, own.array.relative, rng, gyroscope_range=RAIL)
    labels = tuple("12345")
    recording = make(
        time=0.01 * np.arange(200), specific_force=force, angular_rate=rate,
        accelerometer_position=own.array.positions, accelerometer_labels=labels,
        gyroscope_labels=labels, accelerometer_noise_sd=0.04, gyroscope_noise_sd=0.02,
        accelerometer_range=1e3, gyroscope_range=RAIL, stationary=np.zeros(200, bool),
    )  # fmt: skip
    write_recording(recording, folder / "rec.nc")
    given = [str(folder / "rec.nc"), "--out", str(folder / "cal.nc"), "--quiet"]
    assert main(["calibrate", *given, "--model", "papers"]) == 0
    return folder / "cal.nc", folder / "rec.nc", motion


def test_motion_with_covariances(files, tmp_path, capsys):
    calibration, recording, motion = files
    out = tmp_path / "motion.nc"
    assert main(["apply", str(calibration), str(recording), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "with a gyroscope at its rail" in said and "at the rail" in said
    with xr.open_dataset(out) as found:
        error = found.angular_rate.to_numpy() - motion.angular_rate
        z = error / found.angular_rate_sd.to_numpy()
        assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.15)
        assert found.motion_covariance.shape == (200, 9, 9)
        assert np.all(found.specific_force_sd > found.specific_force_sd_from_calibration)
        railed = np.any(np.abs(motion.angular_rate) > RAIL, axis=1)
        assert 5 < railed.sum() and np.all(found.converged)
        # the accelerometers know what the gyroscopes have lost
        assert np.max(np.abs(error[railed])) < 1.0


def test_samples_with_an_accelerometer_at_its_rail_are_left_out(files, tmp_path):
    calibration, recording, _ = files
    whole = read_recording(recording)
    force = whole.specific_force.copy()
    force[7, 2, 1] = 900.0
    write_recording(
        replace(whole, specific_force=np.clip(force, -900, 900), accelerometer_range=900.0),
        tmp_path / "rec.nc",
    )
    out = tmp_path / "motion.nc"
    assert main(["apply", str(calibration), str(tmp_path / "rec.nc"), "--out", str(out)]) == 0
    with xr.open_dataset(out) as found:
        lost = np.isnan(found.angular_rate.to_numpy()).all(axis=1)
        assert np.flatnonzero(lost).tolist() == [7] and not found.converged[7]


def test_an_axis_at_its_rail_does_not_leak_through_the_maps(files):
    """A chip's axes are skew: corrected, each has a share of what a clipped one did not read."""
    calibration, recording, motion = files
    rng, own = np.random.default_rng(2), model()
    force, rate, _ = measure(own, motion, own.array.relative, rng)
    maps = np.eye(3) + 0.02 * rng.standard_normal((rate.shape[1], 3, 3))
    inverse, nothing = np.linalg.inv(maps), np.zeros((rate.shape[1], 3))
    raw = np.clip(corrected(maps, nothing, rate), -RAIL, RAIL)
    parts = {"inverse": inverse, "offset": nothing, "offset_sd": nothing,
             "offset_walk": nothing[:, 0]}  # fmt: skip
    whole = replace(
        read_recording(recording), specific_force=force,
        angular_rate=corrected(inverse, nothing, raw),
        angular_rate_saturated=rails_shown(inverse, np.abs(raw) >= RAIL),
        correction=xr.Dataset({
            f"{kind}_{name}": (CORRECTION[f"{kind}_{name}"], value)
            for kind in ("accelerometer", "gyroscope") for name, value in parts.items()
        }),
    )  # fmt: skip
    with xr.open_dataset(calibration) as found:
        moved = imuarray.apply(found, whole)
    # one chip's alone, whose rate the others know
    raw[:, 1:] = corrected(maps, nothing, rate)[:, 1:]
    railed = rails_shown(inverse, np.abs(raw) >= RAIL)
    railed[:, 1:] = False
    alone = replace(
        whole, angular_rate=corrected(inverse, nothing, raw), angular_rate_saturated=railed
    )
    mended = less_leak_by_others(alone).angular_rate
    left = np.where(railed, 0.0, mended - rate)
    leaked = np.where(railed, 0.0, alone.angular_rate - rate)
    assert np.abs(left).max() < 0.01 < 0.1 < np.abs(leaked).max()
    z = (moved.angular_rate - motion.angular_rate) / moved.angular_rate_sd
    over = np.abs(motion.angular_rate) > 0.9 * RAIL
    off = over.any(axis=1)[:, None] & ~over
    assert off.sum() > 20
    assert np.sqrt(np.mean(z.to_numpy()[off] ** 2)) == pytest.approx(1.0, abs=0.3)


def test_what_does_not_fit_is_refused(files, tmp_path, capsys):
    calibration, recording, _ = files
    out = tmp_path / "motion.nc"
    assert main(["apply", str(recording), str(recording), "--out", str(out)]) == 2
    assert "expected a calibration" in capsys.readouterr().err
    other = replace(read_recording(recording), accelerometer_labels=tuple("abcde"))
    write_recording(other, tmp_path / "other.nc")
    assert main(["apply", str(calibration), str(tmp_path / "other.nc"), "--out", str(out)]) == 2
    assert "expected accelerometers a, b, c, d, e" in capsys.readouterr().err
    assert not out.exists()


def test_a_calibration_with_effects_says_them(files, tmp_path, capsys):
    _, recording, _ = files
    cal, out = tmp_path / "cal.nc", tmp_path / "motion.nc"
    command = f"calibrate {recording} --effects gyroscope_bias --out {cal}"
    assert main(command.split()) == 0
    assert "effect parameter: value (sd)\ngyroscope_bias" in capsys.readouterr().out
    assert main(["apply", str(cal), str(recording), "--out", str(out)]) == 0


def test_the_motion_under_effects(files, tmp_path):
    """Turned axes added to a recording: the extended model's motion is right, with its widths,
    past the rail as well; the papers' is far off."""
    array = model().array
    names = ("gyroscope_misalignment", "size_effect")
    recording, truth = imuarray.simulate(
        array, 3.0, 100.0, seed=5, effects=names, angular_rate=15.0, gyroscope_range=RAIL,
        accelerometer_noise=0.1, gyroscope_noise=0.02,
    )  # fmt: skip
    z = {}
    for effects in (names, ()):
        found = imuarray.calibrate(recording, "sensors" if effects else "papers", effects=effects)
        motion = imuarray.apply(found, recording)
        railed = motion.gyroscope_at_rail.to_numpy()
        assert 20 < railed.sum() < 200 and motion.converged.all()
        error = motion.angular_rate.to_numpy() - truth.angular_rate.to_numpy()
        ratio = error / motion.angular_rate_sd.to_numpy()
        z[effects] = [float(np.sqrt(np.mean(ratio[part] ** 2))) for part in (railed, ~railed)]
    assert z[names] == pytest.approx([1.0, 1.0], abs=0.25)
    assert min(z[()]) > 3.0


def test_whose_time_the_motion_has_is_said_by_lags_as_by_delays():
    """Two of five IMUs 2 ms late: the mean of all is 0.8 ms off most IMUs' clock."""
    recording, _ = imuarray.simulate(model().array, 4.0, 200.0, seed=4, angular_rate=15.0)
    late = {}
    for name in ("specific_force", "angular_rate"):
        values = getattr(recording, name).copy()
        values[1:, :2] = values[:-1, :2] + 0.6 * (values[1:, :2] - values[:-1, :2])
        late[name] = values
    late = replace(recording, **late)
    lags = ("accelerometer_filter", "gyroscope_delay")
    found = [imuarray.calibrate(late, effects=names) for names in (lags, ("sensor_delay",))]
    said = [imuarray.apply(each, late).attrs["late_s"] for each in found]
    assert said == pytest.approx([8e-4, 8e-4], abs=1e-5)
