"""What is not a recording is refused with one clear line: a table of bad files."""

import h5py
import numpy as np
import pytest
import xarray as xr

from imuarray.errors import IdentifiabilityError, InputError
from imuarray.geometry.array import MAX_TRIADS
from imuarray.recording import read_recording, write_recording
from tests.recording.cases import make, one_line, save


def with_value(name, index, value):
    def change(dataset):
        dataset = dataset.copy(deep=True)
        dataset[name].values[index] = value
        return dataset

    return change


def with_units(name, units):
    def change(dataset):
        dataset[name].attrs.pop("units")
        if units is not None:
            dataset[name].attrs["units"] = units
        return dataset

    return change


def with_attribute(name, value):
    def change(dataset):
        dataset.attrs.pop(name)
        return dataset if value is None else dataset.assign_attrs({name: value})

    return change


def with_time(time):
    return lambda d: d.assign_coords(time=("time", time, {"units": "s"}))


def collinear(dataset):
    line = np.outer(np.arange(4), [0.01, 0.02, 0.03])
    return dataset.assign(accelerometer_position=dataset["accelerometer_position"].copy(data=line))


TIME = 0.01 * np.arange(20)

BAD = {
    "missing variable": (
        lambda d: d.drop_vars("angular_rate"),
        "expected a variable 'angular_rate'",
    ),
    "missing labels": (lambda d: d.drop_vars("gyroscope"), "expected a variable 'gyroscope'"),
    "missing axis": (lambda d: d.drop_vars("axis"), "expected a variable 'axis'"),
    "missing time": (lambda d: d.drop_vars("time"), "expected a variable 'time'"),
    "order of dimensions": (
        lambda d: d.assign(specific_force=d["specific_force"].transpose("axis", ...)),
        r"specific_force: expected dimensions \(time, accelerometer, axis\), found \(axis, time",
    ),
    "missing dimension": (
        lambda d: d.assign(angular_rate=d["angular_rate"][:, 0].drop_vars("gyroscope")),
        r"angular_rate: expected dimensions \(time, gyroscope, axis\), found \(time, axis\)",
    ),
    "two axes": (lambda d: d.isel(axis=[0, 1]), r"axis: expected .* found \['x', 'y'\]"),
    "axes named otherwise": (
        lambda d: d.assign_coords(axis=["u", "v", "w"]),
        r"axis: expected .* found \['u', 'v', 'w'\]",
    ),
    "no units": (with_units("angular_rate", None), "angular_rate: units: .* deg s-1, .*found none"),
    "unknown units": (with_units("angular_rate", "rpm"), "angular_rate: .* found 'rpm'"),
    "force in another quantity's unit": (
        with_units("specific_force", "deg/s"),
        r"a unit of m s-2, m/s\^2, .*found 'deg/s'",
    ),
    "units not text": (with_units("time", 3), "time: units: .* found "),
    "NaN": (
        with_value("specific_force", (7, 2, 1), np.nan),
        r"specific_force: expected finite numbers, .*found nan at time index 7, "
        r"accelerometer '3', axis y \(1 of 240 values\)",
    ),
    "infinite": (
        with_value("angular_rate", (0, 1, 0), -np.inf),
        "found -inf at time index 0, gyroscope 'g1', axis x",
    ),
    "NaN position": (
        with_value("accelerometer_position", (1, 2), np.nan),
        "accelerometer_position: .* at accelerometer '2', axis z",
    ),
    "text for numbers": (
        lambda d: d.assign(
            angular_rate=(d["angular_rate"].dims, np.full((20, 2, 3), "a"), {"units": "rad s-1"})
        ),
        "angular_rate: expected real numbers",
    ),
    "NaN time": (
        with_time(np.where(TIME == TIME[4], np.nan, TIME)),
        "time: expected finite numbers, .*found nan at time index 4",
    ),
    "time twice": (
        with_time(np.where(TIME == TIME[4], TIME[3], TIME)),
        "strictly increasing values, found 0.03 s and then 0.03 s at index 4",
    ),
    "time backwards": (with_time(TIME[::-1]), "strictly increasing .* at index 1"),
    "no samples": (lambda d: d.isel(time=slice(0)), "time: expected at least 1 sample, found 0"),
    "labels twice": (
        lambda d: d.assign_coords(accelerometer=["1", "2", "2", "4"]),
        "accelerometer: expected labels that are all different, found '2' 2 times",
    ),
    "labels are numbers": (
        lambda d: d.assign_coords(gyroscope=[1, 2]),
        "gyroscope: expected text as labels, found type int64",
    ),
    "stationary by sensor": (
        lambda d: d.assign(stationary=("gyroscope", [True, False])),
        r"stationary: expected dimensions \(time\), found \(gyroscope\)",
    ),
    "stationary not boolean": (
        lambda d: d.assign(stationary=("time", np.arange(20))),
        "stationary: expected true or false",
    ),
    "beyond the range": (
        with_value("angular_rate", (2, 0, 2), 2000.0),
        "declared range of 34.9 rad s-1, found 2000 at time index 2, gyroscope 'g0', axis z",
    ),
    "attribute missing": (with_attribute("gyroscope_noise_sd", None), "rad s-1, found none"),
    "attribute zero": (with_attribute("position_prior_sd", 0.0), "'position_prior_sd' .* found 0"),
    "attribute negative": (with_attribute("accelerometer_range", -1), "found -1"),
    "attribute NaN": (with_attribute("gyroscope_range", np.nan), "found nan"),
    "attribute infinite": (with_attribute("accelerometer_noise_sd", np.inf), "found inf"),
    "attribute text": (with_attribute("accelerometer_noise_sd", "much"), "found 'much'"),
    "attribute list": (with_attribute("accelerometer_noise_sd", [1.0, 2.0]), "found array"),
}

UNIDENTIFIABLE = {
    "one accelerometer": (
        lambda d: d.isel(accelerometer=[0]),
        "two accelerometer triads at least.* found 1",
    ),
    "collinear": (collinear, "span a plane, found them collinear"),
    "no gyroscope": (lambda d: d.isel(gyroscope=[]), "at least 1 gyroscope triad, found 0"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_recordings_are_refused(tmp_path, case):
    change, message = BAD[case]
    path = save(change(make().to_dataset()), tmp_path / "rec.nc")
    with pytest.raises(InputError, match=message) as info:
        read_recording(path)
    assert one_line(info).startswith(str(path))


@pytest.mark.parametrize("case", UNIDENTIFIABLE)
def test_recordings_that_determine_nothing_are_refused(tmp_path, case):
    change, message = UNIDENTIFIABLE[case]
    path = save(change(make().to_dataset()), tmp_path / "rec.nc")
    with pytest.raises(IdentifiabilityError, match=message) as info:
        read_recording(path)
    one_line(info)


@pytest.mark.parametrize("kind", ["accelerometer", "gyroscope"])
def test_more_triads_than_the_limit(tmp_path, kind):
    dataset = make().to_dataset()
    count = MAX_TRIADS + 1
    dataset = dataset.isel({kind: np.arange(count) % dataset.sizes[kind]})
    dataset = dataset.assign_coords({kind: [str(k) for k in range(count)]})
    path = save(dataset, tmp_path / "rec.nc")
    with pytest.raises(InputError, match=f"at most {MAX_TRIADS} {kind} triads, found {count}"):
        read_recording(path)


def text_file(path):
    path.write_text("time,ax,ay,az\n0,1,2,3\n")


def truncated(path):
    save(make().to_dataset(), path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def plain_hdf5(path):
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(3.0)


def classic_netcdf(path):
    xr.Dataset({"time": ("time", TIME)}).to_netcdf(path, engine="scipy")


def absurd(path):
    """A few kilobytes that declare 8 TB."""
    with h5py.File(path, "w") as file:
        shape = (10**12,)
        file.create_dataset("time", shape, "f8", chunks=(1024,)).make_scale("time")


FILES = {
    "nothing": (lambda path: None, "found nothing there"),
    "folder": (lambda path: path.mkdir(), "found a folder there"),
    "empty": (lambda path: path.touch(), "expected a NetCDF-4 file"),
    "text": (text_file, "expected a NetCDF-4 file"),
    "truncated": (truncated, "expected a NetCDF-4 file"),
    "netcdf 3": (classic_netcdf, "expected a NetCDF-4 file"),
    "hdf5 only": (plain_hdf5, "expected"),
    "absurd size": (absurd, "time: expected at most 200000000 values, found shape"),
}


@pytest.mark.parametrize("case", FILES)
def test_files_that_are_no_recordings_are_refused(tmp_path, case):
    build, message = FILES[case]
    path = tmp_path / "rec.nc"
    build(path)
    with pytest.raises(InputError, match=message) as info:
        read_recording(path)
    assert one_line(info).startswith(str(path))


@pytest.mark.parametrize(
    "changes",
    [
        {"gyroscope_noise_sd": 0.0},
        {"specific_force": np.full((20, 4, 3), np.nan)},
        {"time": TIME[:5]},
        {"accelerometer_labels": ("1", "2", "3")},
        {"accelerometer_labels": ("1", "2", "3", 4)},
    ],
)
def test_a_bad_recording_is_not_written(tmp_path, changes):
    path = tmp_path / "rec.nc"
    path.write_text("what was there before")
    with pytest.raises(InputError) as info:
        write_recording(make(**changes), path)
    one_line(info)
    assert [p.name for p in tmp_path.iterdir()] == ["rec.nc"]
    assert path.read_text() == "what was there before"
