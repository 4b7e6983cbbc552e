"""Recordings: what is written reads back. Refusals are in test_recording_refused.py."""

import dataclasses

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from imuarray.errors import InputError
from imuarray.recording import Recording, read_recording, read_truth, write_recording
from tests.recording.cases import CORNERS, make, save


def assert_same(one, other):
    for field in dataclasses.fields(Recording):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b)
            assert a.dtype == b.dtype
        else:
            np.testing.assert_equal(a, b, field.name)


floats = st.floats(-10, 10, allow_subnormal=False)
label = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=8)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data(), samples=st.integers(1, 6), gyroscopes=st.integers(1, 3))
def test_round_trip(tmp_path_factory, data, samples, gyroscopes):
    steps = data.draw(hnp.arrays(float, samples, elements=st.floats(0.01, 0.02)))
    labels = data.draw(st.lists(label, min_size=4, max_size=4, unique=True))
    still = data.draw(st.none() | hnp.arrays(bool, samples))
    recording = make(
        samples,
        gyroscopes,
        time=np.cumsum(steps),
        specific_force=data.draw(hnp.arrays(float, (samples, 4, 3), elements=floats)),
        angular_rate=data.draw(hnp.arrays(float, (samples, gyroscopes, 3), elements=floats)),
        accelerometer_labels=tuple(labels),
        accelerometer_noise_sd=data.draw(st.floats(1e-9, 1e3)),
        stationary=still,
        license=data.draw(st.just("") | label),
    )
    path = tmp_path_factory.mktemp("round") / "rec.nc"
    write_recording(recording, path)
    assert_same(recording, read_recording(path))


def test_truth_and_attributes(tmp_path):
    path = tmp_path / "rec.nc"
    recording = make()
    truth = xr.Dataset(
        {"angular_acceleration": (("time", "axis"), np.ones((20, 3)))}, attrs={"note": "t"}
    )
    write_recording(recording, path, truth, {"seed": 3, "title": "loses"})
    assert_same(recording, read_recording(path))
    assert read_truth(path).equals(truth) and read_truth(path).attrs == truth.attrs
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as dataset:
        assert dataset.attrs["seed"] == 3 and dataset.attrs["title"] == "a title"
    assert [p.name for p in tmp_path.iterdir()] == ["rec.nc"]


def test_no_truth_is_an_input_error(tmp_path):
    write_recording(make(), tmp_path / "rec.nc")
    with pytest.raises(InputError, match="expected a group 'truth'"):
        read_truth(tmp_path / "rec.nc")


SPELLINGS = {
    "angular_rate": {"rad/s": 1, "deg s-1": 180 / np.pi, "deg/s": 180 / np.pi},
    "specific_force": {"m/s^2": 1, "g": 1 / 9.80665},
    "accelerometer_position": {"mm": 1e3},
    "time": {"ms": 1e3},
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_units_are_obeyed(tmp_path, name):
    for unit, factor in SPELLINGS[name].items():
        dataset = make().to_dataset()
        dataset = dataset.assign({name: (factor * dataset[name]).assign_attrs(units=unit)})
        read = read_recording(save(dataset, tmp_path / "rec.nc"))
        np.testing.assert_allclose(getattr(read, name), getattr(make(), name), rtol=1e-14)


def test_a_file_of_another_program_reads(tmp_path):
    """Single precision, packed flags, character-array labels: all of them are usual in NetCDF."""
    dataset = make().to_dataset()
    dataset["specific_force"] = dataset["specific_force"].astype("f4")
    dataset["stationary"] = dataset["stationary"].astype("i1")
    dataset = dataset.assign_coords(accelerometer=np.array(["1", "2", "3", "4"], "S1"))
    read = read_recording(save(dataset, tmp_path / "rec.nc"))
    assert read.accelerometer_labels == ("1", "2", "3", "4")
    assert read.specific_force.dtype == float and read.stationary.dtype == bool


def test_methods():
    rail = make().angular_rate.copy()
    rail[3, 1, 2], rail[4, 0, 0] = -34.9, 34.9 * (1 - 1e-3)
    recording = make(angular_rate=rail)
    assert np.argwhere(recording.saturated_gyroscopes()).tolist() == [[3, 1, 2]]
    np.testing.assert_array_equal(recording.relative_positions(), CORNERS - CORNERS[0])
    assert not make(gyroscope_range=np.inf).saturated_gyroscopes().any()


@pytest.mark.parametrize("index", [slice(2, 9), np.arange(20) % 2 == 0, np.array([1, 4, 5])])
def test_select(index):
    part = make().select(index)
    np.testing.assert_array_equal(part.time, make().time[index])
    np.testing.assert_array_equal(part.specific_force, make().specific_force[index])
    np.testing.assert_array_equal(part.angular_rate, make().angular_rate[index])
    np.testing.assert_array_equal(part.stationary, make().stationary[index])
    assert make(stationary=None).select(index).stationary is None


def test_a_gap_is_a_warning_of_one_line(tmp_path):
    time = make().time + np.where(np.arange(20) < 10, 0.0, 3.0)
    path = save(make(time=time).to_dataset(), tmp_path / "rec.nc")
    with pytest.warns(UserWarning, match=r"1 gap\(s\) .* 3.01 s, comes after index 9") as seen:
        read_recording(path)
    assert len(seen) == 1 and "\n" not in str(seen[0].message)


def test_samples_that_were_chosen_are_no_gap(tmp_path, recwarn):
    """The file says that they are a part; a gap in what was recorded is a warning still."""
    whole = make(**{n: np.repeat(getattr(make(), n), 3, axis=0) for n in ("specific_force",
        "angular_rate", "stationary")}, time=np.arange(3.0 * len(make().time)))  # fmt: skip
    part = whole.select([0, 1, 2, 3, 9]).select(slice(1, None))
    assert part.selected == f"4 of {len(whole.time)} samples"
    write_recording(part, tmp_path / "rec.nc")
    assert read_recording(tmp_path / "rec.nc").selected == part.selected and not recwarn.list
    with pytest.warns(UserWarning, match="gap"):
        write_recording(dataclasses.replace(part, selected=""), tmp_path / "rec.nc")
