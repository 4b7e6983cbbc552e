"""Low passes of the chips, filtered at their own rate: found by kind and by chip, or refused."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.signal import lfilter

import imuarray
from imuarray.engine import forward
from imuarray.engine.derivatives import derivatives
from imuarray.engine.estimate import estimate
from imuarray.engine.forward import BAND, FILTER, OWN, select_forward, with_effects
from imuarray.engine.readings import arrange
from imuarray.engine.start import is_smooth
from imuarray.geometry import sub_array
from imuarray.model import ArrayModel
from imuarray.motion import hand_twisting
from imuarray.simulation.recordings import simulate_samples
from imuarray.trust.reasons import _arms, _filters
from tests.engine.test_engine import errors, position_sds

CHIP = 2000  # Hz at which the chips filter
LOGGED = slice(CHIP // 2, None, 10)  # of their samples


def low_passed(x, corners):
    """First order and causal, along time; (T, n, 3) of n sensors with ``corners`` (n,) in Hz."""
    out = np.empty_like(x)
    for k, hz in enumerate(corners):
        a = 1 - np.exp(-2 * np.pi * hz / CHIP)
        out[:, k] = lfilter([a], [1, a - 1], x[:, k] - x[0, k], axis=0) + x[0, k]
    return out


def filtered(gyroscopes, accelerometers):
    """(recording, truth) of IMUs with low passes at so many Hz, (n,) each."""
    count = len(gyroscopes)
    model = ArrayModel.isotropic(sub_array(imuarray.mimu4444(), count), 0.04, 0.002)
    rng, places = np.random.default_rng(1), model.array.relative
    motion, time = hand_twisting(rng, np.radians(700), 3.0), np.arange(12 * CHIP) / CHIP
    recording, truth = simulate_samples(
        model, motion.at(time[LOGGED]), places, places, rng, time[LOGGED]
    )
    ideal = model.predict_many(motion.at(time), places)
    for clean, corners, read in zip(
        ideal, (accelerometers, gyroscopes),
        (recording.specific_force, recording.angular_rate), strict=True,
    ):  # fmt: skip
        read += (low_passed(clean, corners) - clean)[LOGGED]
    return recording, truth


def distance(found, truth):
    """Root mean square error, in sds and in m."""
    off = errors(found, truth)
    return [np.sqrt(np.mean(x**2)) for x in (off / position_sds(found), off)]


@pytest.mark.parametrize("gyroscopes", [[20] * 4, [98, 98, 25, 98]])
def test_a_low_pass_of_gyroscopes_is_found(gyroscopes, monkeypatch):
    recording, truth = filtered(gyroscopes, [98] * 4)
    readings = [arrange(recording, sparse=True)]
    found, groups = select_forward(readings)
    kept = {group.name for group in groups if group.kept}
    assert FILTER in kept and (BAND in kept or forward.LAG not in kept)
    z, off = distance(found, truth)
    assert z < 2.5 and off < 15e-6
    monkeypatch.setattr(forward, "groups_of", lambda readings: [*forward.ROUGH_GROUPS])
    assert distance(select_forward(readings)[0], truth)[1] > 5 * off


def test_runs_too_short_for_a_filter_have_the_derivatives_of_short_ones():
    readings = arrange(filtered([98] * 4, [98] * 4)[0], sparse=True)
    readings = replace(readings, run=np.arange(len(readings.time)) // 15)
    motion = np.concatenate([readings.values[:, 0, 3:], np.zeros((len(readings.time), 6))], axis=1)
    _, _, second, third, slow = derivatives(readings, motion, readings.array.relative)
    for one, other in zip((second, third), slow, strict=True):
        np.testing.assert_array_equal(one.angular_rate, other.angular_rate)
    assert np.abs(slow.second.angular_rate).max() > 0


@pytest.mark.parametrize(("accelerometers", "group"), [([20] * 4, BAND), ([98, 98, 20, 98], OWN)])
def test_a_low_pass_of_accelerometers_is_found(accelerometers, group, monkeypatch):
    """Of all, it makes a square of the rate that no filtered rate has; of one, an IMU's delay."""
    recording, truth = filtered([accelerometers[0]] * 4, accelerometers)
    readings = [arrange(recording, sparse=True)]
    found, groups = select_forward(readings)
    assert group in {one.name for one in groups if one.kept}
    z, off = distance(found, truth)
    assert z < 2 and off < 1e-5
    fewer = [name for name in forward.EFFECT_GROUPS if name != group]
    monkeypatch.setattr(forward, "groups_of", lambda readings: fewer)
    assert distance(select_forward(readings)[0], truth)[1] > 3 * off


def test_filters_of_two_imus_droop_where_they_lag():
    """Angular acceleration is the gyroscopes' own there, and no residual tells of their filter."""
    recording, truth = filtered([98] * 2, [44] * 2)
    found, groups = select_forward([arrange(recording, sparse=True)])
    assert {FILTER, BAND} <= {group.name for group in groups if group.kept}
    assert distance(found, truth)[0] < 2


@pytest.mark.parametrize("every", [1, 2, 700])
def test_lost_readings_leave_rough_motion_rough(every):
    """The worst accelerometer is left out to look again, where others have readings at rails."""
    readings = arrange(filtered([98] * 4, [98] * 4)[0], sparse=True)
    keep, motion = readings.keep.copy(), np.random.default_rng(0).standard_normal((2300, 9))
    keep[::every, 2, :3] = False
    for imu in (1, 3):
        values = readings.values.copy()
        values[:, imu, :3] += 50 * np.random.default_rng(1).standard_normal((2300, 3))
        assert not is_smooth(replace(readings, keep=keep, values=values), 100 * motion)


def test_filters_alike_are_none():
    readings = [arrange(filtered([98] * 4, [98] * 4)[0], sparse=True)]
    kept = {group.name for group in select_forward(readings)[1] if group.kept}
    assert not kept & {FILTER, OWN}


def test_an_accelerometers_low_pass_is_found():
    recording, truth = filtered([98] * 4, [98, 98, 40, 98])
    effects = "gyroscope_delay", "accelerometer_filter"
    found = with_effects([arrange(recording, sparse=True)], effects)
    assert distance(found, truth)[0] < 2 and found.residual_ratio() < 1.02
    shape = found.columns.flat(found.recorded[0].state)
    lag, droop, _ = shape[:, found.columns.of("accelerometer_filter")].T
    times = 1 / (2 * np.pi * np.array([40.0, 98.0]))
    late, wide = (each[2] - np.mean(each[[0, 1, 3]]) for each in (lag, droop - lag**2 / 2))
    assert late == pytest.approx(times[1] - times[0], rel=0.02)
    assert wide == pytest.approx((times[0] ** 2 - times[1] ** 2) / 2, rel=0.4)


def test_one_slow_chip_among_fast_ones_is_no_late_one():
    """Delays go into lags: tested beside each other all had seemed to gain nothing."""
    recording, truth = filtered([98, 98, 98, 30], [98, 98, 98, 30])
    found, groups = select_forward([arrange(recording, sparse=True)])
    kept = {group.name for group in groups if group.kept}
    assert {forward.LAG, FILTER, OWN} <= kept and forward.DELAYS not in kept
    z, off = distance(found, truth)
    assert z < 2 and off < 6e-6 and found.residual_ratio() < 1.4


def test_delays_of_an_imu_and_of_both_its_sensors_are_two_numbers():
    """A third leaves the fit a valley: it went to and fro in one, to a status of 3."""
    readings = arrange(filtered([98, 98, 20, 98], [98, 98, 98, 40])[0], sparse=True)
    names = [forward.DELAYS, forward.LAG, FILTER, OWN]
    columns, begun = forward._begun([readings], names)
    found = estimate(begun, columns, columns.mask(["position"]), steps=1)
    start = forward.Selected(found, (readings.keep,), {})
    found = start.with_kept([OWN, forward.LAG]).fitted(2).with_kept(names).fitted().found
    delay = columns.flat(found.recorded[0].state)[:, columns.of("sensor_delay")]
    scale = 1 / np.sqrt(np.diag(found.information))
    assert found.converged and not delay.any()
    assert np.linalg.cond(found.information * np.outer(scale, scale)) < 5e7


LAG, DROOP = "gyroscope_delay delay", "gyroscope_filter droop"


@pytest.mark.parametrize("values, word", [
    ({}, ""), ({LAG: -5e-3, DROOP: 3e-5}, ""),
    ({LAG: -9e-3, DROOP: 9e-5}, "the gyroscopes' low pass, of some 12 Hz"),
    ({LAG: 9e-3, DROOP: -9e-5}, "the accelerometers' low pass, of some 12 Hz"),
    ({"accelerometer_band spread": 2e-4}, "the low pass of all sensors, of some 11 Hz"),
])  # fmt: skip
def test_filters_too_far_apart_are_said(values, word):
    names = [f"{name}_{k} s" for name in values for k in "ab"]
    numbers = np.repeat([*values.values()], 2)
    file = xr.Dataset({"effect_parameter": ("parameter", numbers)}, {"parameter": names})
    assert word in " ".join(_filters(file)) and bool(word) == bool(_filters(file))
    assert not _filters(xr.Dataset())


def test_one_accelerometers_low_pass_is_said():
    names = [
        f"accelerometer_filter {what}_{k} s"
        for what in ("lag", "droop")
        for k in ("a", "b", "c", "d 1")
    ]
    file = xr.Dataset(
        {"effect_parameter": ("parameter", [2e-3] * 3 + [-4e-3] + [-2e-5] * 3 + [6e-5])},
        {"parameter": names},
    )
    (said,) = _filters(file)
    assert "accelerometer d 1, of some 13 Hz" in said


def test_a_lever_arm_that_no_chip_has_room_for_is_said():
    names = [f"size_effect {axes}_{k} m" for axes in ("xx", "zy") for k in ("a", "b 1")]
    arms = np.array([1e-4, 2e-4, 0.0, 1.0])
    file, sound = (
        xr.Dataset({"effect_parameter": ("parameter", size * arms)}, {"parameter": names})
        for size in (-3e-3, 2e-3)
    )
    (said,) = _arms(file)
    assert said.startswith("axis z of accelerometer b 1 comes out 3 mm")
    assert not _arms(sound) and not _arms(xr.Dataset())
