"""Readings that are withheld from the estimate and compared with it."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.analysis.beside import fused
from imuarray.analysis.density import posterior_beyond, traced
from imuarray.analysis.sensors import fitted
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.provenance import write_netcdf
from imuarray_papers.figures.board import figure_past_rail, table_past_rail
from imuarray_papers.measured.left_out import _choose, _hidden, past_rail
from tests.cases import known, model


@pytest.fixture(scope="module")
def withheld():
    """(recording with scaled gyroscopes, its truth): 5 triads, 300 samples."""
    effects = ("gyroscope_scale",)
    recording, truth = imuarray.simulate(
        model().array, 3.0, 100.0, seed=2, effects=effects, angular_rate=15.0,
        gyroscope_noise=0.005, position_error=1e-4,
    )  # fmt: skip
    return recording, truth


@pytest.fixture(scope="module")
def found(withheld):
    """The calibration that knows the truth."""
    recording, truth = withheld
    values, places = (truth[name].to_numpy() for name in ("effect_parameter", "position"))
    own = replace(model(), effects=("gyroscope_scale",))
    return known(recording, own, values, 1e-4, places, (0.04, 0.005), 0.0, 2.99)


def test_the_right_model_predicts_what_is_withheld(withheld, found):
    recording, _ = withheld
    table = past_rail(recording, found, bins=(300, 800, 2000), per_bin=30)
    errors = table.pivot(index="rate_dps", columns="model", values="median_dps")
    assert np.all(errors.board < 0.7 * errors.calibrated)
    assert np.all(errors.calibrated < errors.clipped)
    board = table[table.model == "board"]
    assert np.all(np.abs(board.within_95 - 0.95) < 0.05)
    figure = figure_past_rail(300, ["a footer"])(table)
    assert all(len(axes.lines) == 7 for axes in figure.axes)
    rows, words = table_past_rail([table, table], ["a", "b"], "board")
    assert len(rows) == 4 and words == {"group": "board"}


def test_effects_beside_a_calibration_s_model_are_refused(withheld, found, tmp_path, capsys):
    recording, _ = withheld
    path, log = tmp_path / "cal.nc", tmp_path / "rec.nc"
    write_netcdf(found, path)
    with pytest.raises(InputError, match="expected none with the model of a calibration"):
        imuarray.calibrate(recording, path, effects=["gyroscope_scale"])
    imuarray.write_recording(recording, log)
    command = ["sample", str(log), "--out", str(tmp_path / "chains.nc"), "--model", str(path)]
    assert main([*command, "--effects", "gyroscope_scale"]) == 2
    assert "expected none with the model of a calibration" in capsys.readouterr().err
    write_netcdf(found.assign_attrs(corrected_readings="axis_swap"), path)
    with pytest.raises(InputError, match="right axes, found axis_swap"):
        imuarray.calibrate(recording, path)
    bare = found.drop_vars(["effect_parameter", "effect_sd", "whole_covariance", "parameter"])
    write_netcdf(bare, path)
    with pytest.raises(InputError, match="a calibration with effects, found one without"):
        imuarray.calibrate(recording, path)


def test_the_withheld_readings_are_not_used(withheld, found):
    """Other readings in their place: the predictions are the same, so the errors differ by that."""
    recording, _ = withheld
    index = _choose(recording, np.radians((300, 2000)), 20)
    hidden = np.zeros(recording.angular_rate.shape, bool)
    hidden[index] = (np.abs(recording.angular_rate[index]) > np.radians(300)).any(1, keepdims=True)
    rate = recording.angular_rate * np.where(hidden, 1.02, 1.0)
    predicted = [
        fused(_hidden(one, index, hidden[index], np.radians(300)), found, hidden.any(axis=(1, 2)))
        for one in (recording, replace(recording, angular_rate=rate))
    ]
    np.testing.assert_array_equal(*(one.predictions()[0] for one in predicted))


def test_what_is_never_fast_is_refused(withheld, found):
    recording, _ = withheld
    with pytest.raises(InputError, match="beyond 9000 deg/s, found none"):
        past_rail(recording, found, bins=(9000, 9500))


def test_a_calibration_is_a_model_to_sample(withheld, found, tmp_path):
    """The density stands at the estimate from its effects: all coordinates within 5 sds."""
    recording, truth = withheld
    write_netcdf(found, tmp_path / "cal.nc")
    estimate, _ = fitted([recording], str(tmp_path / "cal.nc"), (), print, plain=False)
    posterior = posterior_beyond(recording, estimate)
    assert posterior.model.effects == ("gyroscope_scale",)
    off = posterior.mode[:12] - truth["position"].to_numpy()[1:].ravel()
    assert np.abs(off / np.sqrt(np.diag(posterior.covariance))[:12]).max() < 5
    density, data = traced(posterior)
    assert np.isfinite(float(density(posterior.mode, *data)))
