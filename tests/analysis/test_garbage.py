"""A few bad readings of a log do not condemn it."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.analysis.garbage import without_garbage, without_garbage_of
from imuarray.recording.rig import Log
from tests.cases import model


@pytest.fixture(scope="module")
def recording():
    return imuarray.simulate(model().array, 5.0, 200.0, seed=4, angular_rate=10.0)[0]


def test_a_clean_log_stays_as_it_is(recording):
    found, lines = without_garbage(recording)
    assert found is recording and not lines


def test_rows_of_zeros_are_left_out(recording):
    force, rate = recording.specific_force.copy(), recording.angular_rate.copy()
    force[[7, 300]] = rate[[7, 300]] = 0
    found, lines = without_garbage(replace(recording, specific_force=force, angular_rate=rate))
    assert lines == ["2 rows of zeros left out"] and len(found.time) == len(recording.time) - 2


@pytest.mark.parametrize("kind", ["accelerometer", "gyroscope"])
def test_spikes_are_bridged_and_lost(recording, kind):
    name = {"accelerometer": "specific_force", "gyroscope": "angular_rate"}[kind]
    values = getattr(recording, name).copy()
    for row, axis in ((50, 0), (120, 2), (400, 1)):
        values[row, 1, axis] += 50.0
    found, lines = without_garbage(replace(recording, **{name: values}))
    lost = getattr(found, f"saturated_{kind}s")()
    before = getattr(recording, f"saturated_{kind}s")()
    assert lost[[50, 120, 400], 1].all() and (lost & ~before).sum() == 9
    label = getattr(recording, f"{kind}_labels")[1]
    assert lines == [f"{kind} {label}: 3 spikes left out"]
    assert np.abs(getattr(found, name) - getattr(recording, name)).max() < 5.0


def test_bursts_of_garbage_are_lost_with_their_neighbours(recording):
    rng, values = np.random.default_rng(5), recording.specific_force.copy()
    for row, count in ((50, 2), (300, 5), (700, 20)):
        values[row : row + count, 2] = rng.uniform(-150, 150, (count, 3))
    found, lines = without_garbage(replace(recording, specific_force=values))
    lost = found.saturated_accelerometers() & ~recording.saturated_accelerometers()
    assert lost[:, 2].all(axis=1).sum() == 2 + 5 + 20 + 6 == lost.sum() / 3
    label = recording.accelerometer_labels[2]
    assert lines == [f"accelerometer {label}: 33 readings of bursts of garbage left out"]


@pytest.mark.parametrize("kind", ["accelerometer", "gyroscope"])
def test_a_triad_that_freezes_is_lost_while_it_does(recording, kind):
    name = {"accelerometer": "specific_force", "gyroscope": "angular_rate"}[kind]
    values = getattr(recording, name).copy()
    values[400:440, 1], values[600:610, 1] = values[400, 1], values[600, 1]
    found, lines = without_garbage(replace(recording, **{name: values}))
    lost = getattr(found, f"saturated_{kind}s")() & ~getattr(recording, f"saturated_{kind}s")()
    assert lost[400:440, 1].all() and lost.sum() == 3 * 40
    label = getattr(recording, f"{kind}_labels")[1]
    assert lines == [f"{kind} {label}: 40 frozen readings left out"]


def test_a_triad_frozen_for_long_is_left_and_spikes_are_not(recording):
    values = recording.specific_force.copy()
    values[400:500, 1], values[50, 2, 0] = values[400, 1], values[50, 2, 0] + 50.0
    lines = without_garbage(replace(recording, specific_force=values))[1]
    assert lines == [f"accelerometer {recording.accelerometer_labels[2]}: 1 spikes left out"]


def test_what_all_repeat_is_no_frozen_triad(recording):
    values = recording.specific_force.copy()
    values[400:440] = values[400]
    assert not without_garbage(replace(recording, specific_force=values))[1]


def test_a_knock_is_no_garbage(recording):
    """All triads read it, each by its place; one far out reads most."""
    values = recording.specific_force.copy()
    share = np.linspace(0.5, 1.0, values.shape[1])[:, None]
    values[300:306] += 50.0 * np.array([1, -1, 1, -1, 1, -1.0])[:, None, None] * share
    assert not without_garbage(replace(recording, specific_force=values))[1]


def test_a_step_of_one_triad_is_no_spike(recording):
    values = recording.specific_force.copy()
    values[300:, 1] += 50.0
    assert not without_garbage(replace(recording, specific_force=values))[1]


def test_what_is_often_so_is_no_garbage(recording):
    values = recording.specific_force.copy()
    values[::10, 1] += 50.0
    assert not without_garbage(replace(recording, specific_force=values))[1]


def log_of(recording, **changed):
    own = {"specific_force": recording.specific_force[:, 1],
           "angular_rate": recording.angular_rate[:, 1]} | changed  # fmt: skip
    return Log(
        "a", recording.time, own["specific_force"], recording.time, own["angular_rate"],
        np.zeros(3), None, 0.025, 157.0, 1.7e-3, 35.0,
    )  # fmt: skip


def test_a_log_alone_is_left_without_garbage(recording):
    """Spikes, a burst of random readings, and rows of zeros, in motion of some 600 deg/s."""
    rng, (force, rate) = np.random.default_rng(7), (
        getattr(recording, name)[:, 1].copy() for name in ("specific_force", "angular_rate")
    )  # fmt: skip
    rate[[200, 450], 2] += [5.0, -5.0]
    force[700:705] = rng.uniform(-150, 150, (5, 3))
    force[[30, 900]], rate[[30, 900]] = 0.0, 0.0
    found, lines = without_garbage_of(log_of(recording, specific_force=force, angular_rate=rate))
    bad = {"accelerometer": [30, 900, *range(700, 705)], "gyroscope": [30, 200, 450, 900]}
    for kind, rows in bad.items():
        left = getattr(found, f"{kind}_time")
        assert not np.isin(recording.time[rows], left).any()
        assert len(recording.time) - len(left) <= 3 * len(rows)
    assert [line.split(": ")[1] for line in lines] == ["accelerometer", "gyroscope"]


def test_a_clean_log_alone_stays_as_it_is(recording):
    log = log_of(recording)
    assert without_garbage_of(log) == (log, [])


def test_a_log_alone_is_left_without_frozen_readings(recording):
    force = recording.specific_force[:, 1].copy()
    force[400:440] = force[400]
    found, lines = without_garbage_of(log_of(recording, specific_force=force))
    assert not np.isin(recording.time[400:440], found.accelerometer_time).any()
    assert len(found.gyroscope_time) == len(recording.time)
    assert lines == ["a: accelerometer: 40 readings of garbage left out"]
