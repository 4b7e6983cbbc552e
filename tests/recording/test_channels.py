"""Channels that no live sensor reads are named; live ones, coarse and at rest, are not."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.recording import write_recording
from imuarray.recording.channels import dead, repeated, require_live
from tests.recording.cases import make


@pytest.fixture
def recording():
    """Coarse readings of four IMUs: 40 samples at rest, the same ones, then 160 of an array
    that turns."""
    found = make(200, 4, stationary=None)
    force = np.round(found.specific_force, 1)
    rate = np.round(found.angular_rate, 2)
    force[:40], rate[:40] = force[0], 0.0
    return replace(found, specific_force=force, angular_rate=rate)


def changed(recording, name, change):
    values = getattr(recording, name).copy()
    change(values)
    return replace(recording, **{name: values})


def assign(index, value):
    def change(values):
        values[index] = value(values) if callable(value) else value

    return change


ALL = slice(None)
TURN = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
DEAD = {
    "a constant axis": (
        "specific_force", assign((ALL, 1, 2), 9.8),
        ["accelerometer '2', axis z: 9.8 in all samples"],
    ),
    "an axis of zeros": (
        "angular_rate", assign((ALL, 3, 0), 0.0), ["gyroscope 'g3', axis x: 0 in all samples"],
    ),
    "a triad twice": (
        "specific_force", assign((ALL, 3), lambda x: x[:, 0]),
        ["accelerometer '4' reads what '1' reads"],
    ),
    "a triad twice, its axes named anew": (
        "specific_force", assign((ALL, 3), lambda x: x[:, 0][:, [1, 0, 2]] * [-1, -1, -1]),
        ["accelerometer '4' reads what '1' reads"],
    ),
    "a triad twice, turned and scaled": (
        "angular_rate", assign((ALL, 3), lambda x: x[:, 1] @ TURN * 1.01 + 0.1),
        ["gyroscope 'g3' reads what 'g1' reads"],
    ),
    "an axis with noise in its last digit only": (
        "angular_rate", assign((ALL, 2, 1), np.arange(200) % 5 * 0.01),
        ["gyroscope 'g2', axis y: 5 values in all samples"],
    ),
    "an axis twice": (
        "angular_rate", assign((ALL, 2, 1), lambda x: x[:, 0, 2]),
        ["gyroscope 'g2', axis y, reads what 'g0', axis z, reads"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", DEAD)
def test_dead_channels_are_named(recording, case):
    name, change, expected = DEAD[case]
    assert dead(changed(recording, name, change)) == expected


def test_a_channel_that_is_dead_while_the_array_turns(recording):
    """At rest a coarse reading may well be constant: `apply` takes such recordings."""
    name, change, expected = DEAD["an axis of zeros"]
    assert repeated(changed(recording, name, change)) == expected
    at_rest = recording.select(slice(0, 40))
    assert repeated(at_rest) == [] and dead(at_rest)


def test_live_channels_are_not_named(recording):
    assert dead(recording) == [] and repeated(recording) == []
    at_rail = changed(recording, "angular_rate", assign((ALL, 1, 1), recording.gyroscope_range))
    assert dead(at_rail) == []
    sides = np.where(recording.angular_rate[:, :1] > 0, 1.0, -1.0) * recording.gyroscope_range
    assert dead(changed(recording, "angular_rate", assign(ALL, sides))) == []
    require_live(recording)


@pytest.mark.parametrize("name", ["specific_force", "angular_rate"])
def test_a_triad_of_half_the_rate(recording, name):
    label = {"specific_force": "accelerometer '3'", "angular_rate": "gyroscope 'g2'"}[name]
    found = changed(recording, name, assign((slice(1, None, 2), 2), lambda x: x[::2, 2]))
    [said] = repeated(found)
    assert said.startswith(f"{label} repeats 5") and "slower than the log" in said


def test_a_triad_that_freezes(recording):
    [said] = repeated(changed(recording, "specific_force", assign((slice(100, 130), 1), 1.0)))
    assert "accelerometer '2' is frozen at 1 s, for 30 samples" in said


def test_a_log_that_is_there_twice(recording):
    parts = {
        name: np.concatenate([getattr(recording, name)] * 2)
        for name in ("specific_force", "angular_rate")
    }
    twice = replace(recording, time=0.01 * np.arange(400), **parts)
    [said] = repeated(twice)
    assert said.startswith("160 of 400 samples are copies of others, the first at 2.4 s of that at")
    for step in (imuarray.first_order, imuarray.select):
        with pytest.raises(InputError, match="once; 160 of 400 samples are copies"):
            step(twice)


def test_a_recording_given_twice(recording):
    with pytest.raises(InputError, match="found 160 samples of number 1 in number 2, too"):
        imuarray.calibrate([recording, recording])
    half = recording.select(slice(0, 120)), recording.select(slice(80, 200))
    with pytest.raises(InputError, match="found 40 samples of number 1"):
        imuarray.calibrate(half)
    with pytest.raises(InputError, match="expected at least one, found none"):
        imuarray.calibrate([])


def test_every_analysis_refuses_dead_channels(recording, tmp_path, capsys):
    wrong = changed(recording, *DEAD["a triad twice"][:2])
    said = "live sensors; accelerometer '4' reads what '1' reads"
    for analysis in (imuarray.calibrate, imuarray.sample, imuarray.diagnose, imuarray.first_order):
        with pytest.raises(InputError, match=said):
            analysis(wrong)
    write_recording(wrong, tmp_path / "rec.nc")
    assert main(["diagnose", str(tmp_path / "rec.nc"), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1 and not (tmp_path / "out").exists()
