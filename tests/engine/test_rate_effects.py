"""What grows with the rate is found, and not taken for lever arms or a larger array."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.engine import estimate
from imuarray.engine.forward import CURVE, GYROSCOPES, SQUARE, select_forward
from imuarray.engine.readings import arrange
from imuarray.geometry import sub_array
from imuarray.model import ArrayModel
from imuarray.motion import hand_twisting
from imuarray.provenance import write_netcdf
from imuarray.simulation.recordings import simulate_samples
from imuarray.words import sentences
from tests.engine.test_engine import errors, position_sds


def grown(recording, motion):
    """Accelerometer 2 reads 0.03 m/s^2 more along y at 700 deg/s."""
    force = recording.specific_force.copy()
    force[:, 2, 1] += 0.03 * np.sum(motion.angular_rate**2, axis=1) / np.radians(700) ** 2
    return replace(recording, specific_force=force)


def curved(recording, motion):
    """All gyroscopes read 0.4 % more at 1000 deg/s."""
    rate = recording.angular_rate
    return replace(recording, angular_rate=rate * (1 + 0.004 * np.abs(rate) / np.radians(1000)))


@pytest.mark.parametrize(("change", "group"), [(grown, SQUARE), (curved, CURVE), (None, "")])
def test_what_grows_with_the_rate_is_found(change, group):
    model = ArrayModel.isotropic(sub_array(imuarray.mimu4444(), 4), 0.04, 0.002)
    rng, places = np.random.default_rng(1), model.array.relative
    motion, time = hand_twisting(rng, np.radians(700), 3.0), np.arange(0, 12, 0.005)
    recording, truth = simulate_samples(model, motion.at(time), places, places, rng, time)
    if change is not None:
        recording = change(recording, motion.at(time))
    found, groups = select_forward([arrange(recording, sparse=True)])
    # what grows with the rate looks like offsets until it is found
    assert {one.name for one in groups if one.kept} - {"offsets"} == {group} - {""}
    off = errors(found, truth)
    assert np.sqrt(np.mean((off / position_sds(found)) ** 2)) < 2 and np.abs(off).max() < 3e-5


@pytest.mark.parametrize(("common", "differ"), [(1.006, [-0.006, 0.0, 0.006]), (1.01, 0.0005)])
def test_a_scale_of_all_gyroscopes_that_no_pose_tells_is_the_slopes(common, differ, monkeypatch):
    """Angular acceleration goes with the rate, centrifugal force with its square."""
    model = ArrayModel.isotropic(sub_array(imuarray.mimu4444(), 4), 0.04, 0.002)
    rng, places = np.random.default_rng(1), model.array.relative
    motion, time = hand_twisting(rng, np.radians(700), 3.0), np.arange(0, 12, 0.005)
    recording, truth = simulate_samples(model, motion.at(time), places, places, rng, time)
    if np.ndim(differ) == 0:
        differ = differ * rng.standard_normal((4, 3))
    read = recording.angular_rate * (common + np.array(differ))
    readings = [arrange(replace(recording, angular_rate=read), sparse=True)]
    found, groups = select_forward(readings)
    assert GYROSCOPES in {group.name for group in groups if group.kept}
    off, sds = errors(found, truth), position_sds(found)
    assert np.sqrt(np.mean((off / sds) ** 2)) < 2 and np.abs(off).max() < 3e-5
    monkeypatch.setattr(estimate, "shown", lambda recorded: False)
    assert np.abs(errors(select_forward(readings)[0], truth)).max() > 3 * np.abs(off).max()


def test_a_scale_that_slopes_have_shown_stays_where_a_calibration_is_the_model(tmp_path):
    model = ArrayModel.isotropic(sub_array(imuarray.mimu4444(), 4), 0.04, 0.002)
    rng, places = np.random.default_rng(1), model.array.relative
    motion, time = hand_twisting(rng, np.radians(700), 3.0), np.arange(0, 12, 0.005)
    recording, _ = simulate_samples(model, motion.at(time), places, places, rng, time)
    differ = 0.0005 * rng.standard_normal((4, 3))
    recording = replace(recording, angular_rate=recording.angular_rate * (1.01 + differ))
    found = imuarray.calibrate(recording)
    write_netcdf(found, tmp_path / "cal.nc")
    again = imuarray.calibrate(recording, tmp_path / "cal.nc")
    # pinned, the array would be 2 % larger or smaller: 0.4 mm
    np.testing.assert_allclose(again["position"], found["position"], atol=5e-6)


def test_a_curve_is_not_asked_of_motion_too_fast_for_slopes():
    """At 50 Hz a polynomial knows nothing of motion up to 12 Hz; a curve took up its misfit."""
    model = ArrayModel.isotropic(sub_array(imuarray.mimu4444(), 4), 0.04, 0.002)
    rng, places = np.random.default_rng(1), model.array.relative
    motion, time = hand_twisting(rng, np.radians(500), 4.0, 12.0), np.arange(0, 12, 0.02)
    recording, _ = simulate_samples(model, motion.at(time), places, places, rng, time)
    _, groups = select_forward([arrange(recording, sparse=True)])
    assert CURVE not in {group.name for group in groups}


def test_it_is_said_at_1000_deg_per_s():
    rate = np.radians(1000)
    found = {f"{axis}_{k}": (0.1 / rate**2 * (k == 2 and axis == "y"), 1e-6) for k in (1, 2, 3)
             for axis in "xyz"}  # fmt: skip
    (said,) = sentences("accelerometer_rate_square", found, ["1", "2", "3"])
    assert "accelerometer 2 is off by" in said and "y 0.10000" in said
    less = {f"{what}_{k}": (-0.0005 / rate**power, 1e-6) for k in (1, 2)
            for power, what in ((1, "curve"), (2, "cubic"))}  # fmt: skip
    (said,) = sentences("gyroscope_curve", less, ["1", "2"])
    assert said.startswith("at 1000 deg/s the gyroscopes show 0.1") and "less" in said
