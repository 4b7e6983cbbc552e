"""Calibrations that were damaged, edited or are another board's: one line, status 2.

Where `apply` takes one all the same, what it writes are numbers.
"""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import imuarray
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.provenance import write_netcdf
from imuarray.recording import read_recording, write_recording
from tests.cases import model

ALTERED = 20  # files of each kind
VALUES = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1e300, -1e300, 1e-300, 1e11, 5.0]


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """(folder with rec.nc, calibration with effects, one without)."""
    folder, own = tmp_path_factory.mktemp("foreign"), model()
    recording, truth = imuarray.simulate(own.array, 0.3, 100.0, seed=3, angular_rate=15.0)
    write_recording(recording, folder / "rec.nc")
    plain = imuarray.calibrate(recording, "papers")
    extended = imuarray.calibrate(recording, effects=("gyroscope_bias",))
    return folder, extended, plain


def applied(folder, calibration, capsys):
    """The exit status of `apply`; the line it ends with, and the numbers it writes, are checked."""
    out = folder / "motion.nc"
    out.unlink(missing_ok=True)
    status = main(["apply", str(calibration), str(folder / "rec.nc"), "--out", str(out), "--quiet"])
    err = capsys.readouterr().err
    if status == 0:
        with xr.open_dataset(out) as found:
            for name in ("angular_rate", "angular_acceleration", "specific_force"):
                assert np.isfinite(found[name]).all() and (found[f"{name}_sd"] > 0).all()
    else:
        assert status in (2, 3) and err.count("\n") == 1, (status, err)
        assert status == 3 or not out.exists()
    return status, err


def altered(rng, dataset: xr.Dataset) -> xr.Dataset:
    """A variable gone, cut, turned, of another type, or with a wrong value; an attribute gone."""
    found = dataset.copy(deep=True)
    name = str(rng.choice(list(found.variables)))
    kind = rng.integers(6)
    if kind == 0:
        return found.drop_vars(name)
    if kind == 1 and found[name].dims:
        return found.isel({found[name].dims[0]: slice(1, None)})
    if kind == 2 and name in found.data_vars:
        return found.assign({name: found[name].rename({found[name].dims[0]: "other"})})
    if kind == 3 and found.attrs:
        attribute = str(rng.choice(list(found.attrs)))
        value = [None, "text", np.nan, [1, 2], -1.0, 1e300, "{}", "[]", "{"][rng.integers(9)]
        found.attrs.pop(attribute)
        return found if value is None else found.assign_attrs({attribute: value})
    if kind == 4 and name in found.data_vars:
        return found.assign({name: found[name].astype(str)})
    if found[name].dtype.kind == "f":
        values = found[name].to_numpy().copy()
        place = tuple(int(rng.integers(n)) for n in values.shape)
        values[place] = -values[place] if rng.integers(3) == 0 else rng.choice(VALUES)
        found = found.assign({name: found[name].copy(data=values)})
    return found


def test_altered_calibrations(board, capsys):
    folder, *calibrations = board
    rng, statuses = np.random.default_rng(7), []
    for number in range(ALTERED):
        path = folder / "cal.nc"
        write_netcdf(altered(rng, calibrations[number % 2]), path)
        statuses.append(applied(folder, path, capsys)[0])
    assert {0, 2} <= set(statuses)


def with_value(calibration, name, value):
    return calibration.assign({name: calibration[name].copy(data=value)})


def test_a_matrix_that_is_no_covariance(board):
    folder, extended, plain = board
    recording = read_recording(folder / "rec.nc")
    for calibration, name in ((plain, "position_covariance"), (extended, "whole_covariance")):
        wrong = with_value(calibration, name, -calibration[name].to_numpy())
        with pytest.raises(InputError, match=f"{name}: expected a covariance"):
            imuarray.apply(wrong, recording)


def test_another_boards_calibration(board, capsys):
    """The same labels, another drawing."""
    folder, _, plain = board
    recording = read_recording(folder / "rec.nc")
    places = recording.accelerometer_position.copy()
    places[2, 1] += 0.02
    with pytest.raises(InputError, match="of another: accelerometer 3 is 20 mm off in its drawing"):
        imuarray.apply(plain, replace(recording, accelerometer_position=places))
    places[2, 1] -= 0.02 - recording.position_prior_sd  # the drawing mended
    imuarray.apply(plain, replace(recording, accelerometer_position=places))


def test_samples_in_which_every_accelerometer_is_at_its_rail(board):
    """A knock: they say nothing, and the others still do."""
    recording = read_recording(board[0] / "rec.nc")
    force, limit = recording.specific_force.copy(), 1.1 * np.abs(recording.specific_force).max()
    force[20:22] = np.where(force[20:22] > 0, limit, -limit)
    knocked = replace(recording, specific_force=force, accelerometer_range=limit)
    found = imuarray.calibrate(knocked, effects=("gyroscope_bias",))
    assert np.isin(recording.time[20:22], found["time"]).sum() == 0 and found.sizes["time"] > 15
    force[:] = limit * np.sign(force)
    with pytest.raises(InputError, match="at least 1 .* whose readings determine the motion"):
        imuarray.calibrate(replace(knocked, specific_force=force), effects=("gyroscope_bias",))
