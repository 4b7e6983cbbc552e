"""A recording read part by part gives what one in memory gives."""

from itertools import pairwise

import numpy as np
import pytest
import xarray as xr

import imuarray
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.motion.state import hand_twisting
from imuarray.provenance import digest, is_damaged
from imuarray.recording import read_recording, validate, write_recording
from imuarray.recording import record as stored
from imuarray.recording.channels import repeated
from imuarray.simulation.recordings import measure
from tests.cases import model
from tests.recording.cases import make

SAMPLES, RAIL, SMALL = 700, 8.0, 64
COMMANDS = (
    ("calibrate", "{rec}", "--model", "papers", "--out", "cal.nc"),
    ("select", "{rec}", "--out", "few.nc"),
    ("apply", "cal.nc", "{rec}", "--out", "motion.nc"),
)


@pytest.fixture(scope="module")
def recording():
    """5 triads for 7 s, with a pose, and gyroscopes at their rail."""
    rng, own, time = np.random.default_rng(1), model(), 0.01 * np.arange(SAMPLES)
    motion, labels = hand_twisting(rng, 4.0, 5.0).at(time), tuple("12345")
    force, rate, _ = measure(own, motion, own.array.relative, rng, gyroscope_range=RAIL)
    return make(
        time=time, specific_force=force, angular_rate=rate, accelerometer_labels=labels,
        accelerometer_position=own.array.positions, gyroscope_labels=labels,
        accelerometer_noise_sd=0.04, gyroscope_noise_sd=0.02, accelerometer_range=1e3,
        gyroscope_range=RAIL, stationary=time < 0.5,
    )  # fmt: skip


def made(recording, folder, monkeypatch, capsys):
    """(datasets that the commands write, what they say)."""
    monkeypatch.chdir(folder)
    write_recording(recording, "rec.nc")
    status = [main([word.format(rec="rec.nc") for word in words]) for words in COMMANDS]
    names = "rec.nc", *(words[-1] for words in COMMANDS)
    assert not any(is_damaged(name) for name in names)
    return status, {name: xr.load_dataset(name) for name in names}, capsys.readouterr().out


def test_the_same_part_by_part(recording, tmp_path, monkeypatch, capsys):
    folders = [tmp_path / name for name in ("whole", "parts")]
    for folder in folders:
        folder.mkdir()
    whole = made(recording, folders[0], monkeypatch, capsys)
    monkeypatch.setattr(stored, "PART", SMALL)
    parts = made(recording, folders[1], monkeypatch, capsys)
    assert isinstance(read_recording("rec.nc", stored=True).angular_rate, stored.Stored)
    assert parts[0] == whole[0]
    for name, expected in whole[1].items():
        found = parts[1][name]
        assert set(found.variables) == set(expected.variables)
        assert found.attrs.get("selected") == expected.attrs.get("selected")
        assert found.attrs.get("reasons") == expected.attrs.get("reasons")
        for variable in expected.variables:
            one, other = found[variable], expected[variable]
            assert one.dims == other.dims and one.dtype == other.dtype
            assert one.attrs == other.attrs
            if one.dtype.kind == "f":
                scale = np.nanmax(np.abs(other), initial=0.0)
                np.testing.assert_allclose(one, other, atol=1e-9 * scale)
    assert parts[2].splitlines()[-1] == whole[2].splitlines()[-1]


def test_readings_left_in_the_file(recording, tmp_path, monkeypatch):
    write_recording(recording, tmp_path / "rec.nc")
    monkeypatch.setattr(stored, "PART", SMALL)
    found = read_recording(tmp_path / "rec.nc", stored=True)
    rate = recording.angular_rate
    assert digest(found.angular_rate) == digest(rate)
    for index in (slice(3, 90), rate[:, 0, 0] > 0, np.r_[1, 2, 600], slice(None, None, 3)):
        np.testing.assert_array_equal(found.select(index).in_memory().angular_rate, rate[index])
    half = found.select(rate[:, 0, 0] > 0).select(np.arange(0, 200, 2))
    np.testing.assert_array_equal(half.angular_rate, rate[rate[:, 0, 0] > 0][:200:2])
    assert half.selected == f"100 of {SAMPLES} samples"
    sizes = [len(part.time) for part in found.parts()]
    assert sum(sizes) == SAMPLES and all(a == SMALL for a, _ in pairwise(sizes))
    monkeypatch.setattr(stored, "MAX_VALUES", 100)
    with pytest.raises(InputError, match="expected at most 100 values to hold in memory"):
        imuarray.calibrate(found)


def test_faults_are_told_of_every_part(recording, tmp_path, monkeypatch):
    force, rate = recording.specific_force.copy(), recording.angular_rate.copy()
    force[300:, 2], rate[200:450, 3] = force[300:, 1], rate[200, 3]
    rate[600:640], force[600:640] = rate[500:540], force[500:540]
    wrong = make(**vars(recording) | {"specific_force": force, "angular_rate": rate})
    expected = repeated(wrong)
    assert len(expected) == 2  # held, and twice
    monkeypatch.setattr(stored, "PART", SMALL)
    assert repeated(wrong) == expected
    force[650, 1, 2] = np.nan
    with pytest.raises(InputError, match=r"found nan at time index 650, accelerometer '2', axis z"):
        validate.check_values(wrong, "here")
    force[650, 1, 2], rate[651, 0, 0] = 0.0, 2 * RAIL
    with pytest.raises(InputError, match="declared range of 8 rad s-1, found 16 at time index 651"):
        validate.check_values(wrong, "here")
