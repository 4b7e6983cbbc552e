"""Readings that are withheld from the estimate and compared with it."""

import json
from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.analysis.beyond import posterior_beyond
from imuarray.analysis.calibration import fitted_beyond
from imuarray.analysis.density import traced
from imuarray.analysis.known import _choose, _hidden, fused, past_rail
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.figures.board import draw_past_rail, table_past_rail
from imuarray.model.array_model import parameter_names
from tests import cases
from tests.test_bound import model


@pytest.fixture(scope="module")
def withheld():
    """(recording with scaled gyroscopes, its truth): 5 triads, 300 samples."""
    effects = ("gyroscope_scale",)
    recording, truth = imuarray.simulate(
        model().array, 3.0, 100.0, seed=2, effects=effects, angular_rate=15.0,
        gyroscope_noise=0.005, position_error=1e-4,
    )  # fmt: skip
    return recording, truth


@pytest.fixture
def diagnosis(withheld, tmp_path):
    """What a diagnosis that found the truth would say."""
    recording, truth = withheld
    own = replace(model(), effects=("gyroscope_scale",))
    labels = recording.accelerometer_labels, recording.gyroscope_labels
    names = [name.split(" ")[1] for name in parameter_names(own, labels)]
    values = truth["effect_parameter"].to_numpy()
    parameters = {name: (value, 1e-4) for name, value in zip(names, values, strict=True)}
    places = truth["position"].to_numpy()
    document = cases.diagnosis("gyroscope_scale", parameters, places, (0.04, 0.005), 2.99, 1e-6)
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(document))
    return path


def test_the_right_model_predicts_what_is_withheld(withheld, diagnosis):
    recording, truth = withheld
    found = imuarray.diagnosed(diagnosis, recording)
    assert np.array_equal(found["effect_parameter"], truth["effect_parameter"])
    assert np.allclose(found["effect_sd"], 1e-4)
    table = past_rail(recording, found, bins=(300, 800, 2000), per_bin=30)
    errors = table.pivot(index="rate_dps", columns="model", values="median_dps")
    assert np.all(errors.board < 0.7 * errors.calibrated)
    assert np.all(errors.calibrated < errors.clipped)
    board = table[table.model == "board"]
    assert np.all(np.abs(board.within_95 - 0.95) < 0.05)
    figure = draw_past_rail(table, 300, ["a footer"])
    assert all(len(axes.lines) == 7 for axes in figure.axes)
    rows, _, _, notes = table_past_rail([table, table], ["a", "b"], "board")
    assert len(rows) == 4 and "without the withheld readings" in notes[0]


def test_what_a_diagnosis_doubts_goes_along(withheld, diagnosis, tmp_path, capsys):
    recording, _ = withheld
    document = json.loads(diagnosis.read_text())
    document["reasons"] = ["too slow"]
    begins, lasts = float(recording.time[0]), float(np.ptp(recording.time))
    document["clock"] = {"origin_s": begins, "span_s": lasts}
    diagnosis.write_text(json.dumps(document))
    found = imuarray.diagnosed(diagnosis, recording)
    assert json.loads(found.attrs["reasons"]) == ["too slow"] and found.attrs["of_diagnosed"]
    part = recording.select(slice(1, None))
    assert not imuarray.diagnosed(diagnosis, part).attrs["of_diagnosed"]
    document["causes"].append({"effect": "axis_swap", "sensors": ["2"], "parameters": {}})
    diagnosis.write_text(json.dumps(document))
    with pytest.raises(InputError, match="right axes, found axis_swap"):
        imuarray.diagnosed(diagnosis, recording)
    with pytest.raises(InputError, match="expected none with a diagnosis.json"):
        imuarray.calibrate(recording, diagnosis, effects=["gyroscope_scale"])
    imuarray.write_recording(recording, tmp_path / "rec.nc")
    command = ["sample", str(tmp_path / "rec.nc"), "--out", str(tmp_path / "chains.nc")]
    assert main([*command, "--model", str(diagnosis), "--effects", "gyroscope_scale"]) == 2
    assert "expected none with a diagnosis.json" in capsys.readouterr().err


def test_the_withheld_readings_are_not_used(withheld, diagnosis):
    """Other readings in their place: the predictions are the same, so the errors differ by that."""
    recording, _ = withheld
    found = imuarray.diagnosed(diagnosis, recording)
    index = _choose(recording, np.radians((300, 2000)), 20)
    hidden = np.zeros(recording.angular_rate.shape, bool)
    hidden[index] = (np.abs(recording.angular_rate[index]) > np.radians(300)).any(1, keepdims=True)
    rate = recording.angular_rate * np.where(hidden, 1.02, 1.0)
    predicted = [
        fused(_hidden(one, index, hidden[index], np.radians(300)), found, hidden.any(axis=(1, 2)))
        for one in (recording, replace(recording, angular_rate=rate))
    ]
    np.testing.assert_array_equal(*(one.predictions()[0] for one in predicted))


def test_what_is_never_fast_is_refused(withheld, diagnosis):
    recording, _ = withheld
    found = imuarray.diagnosed(diagnosis, recording)
    with pytest.raises(InputError, match="beyond 9000 deg/s, found none"):
        past_rail(recording, found, bins=(9000, 9500))


def test_a_diagnosis_is_a_model_to_sample(withheld, diagnosis):
    """The density stands at the estimate from its effects: all coordinates within 5 sds."""
    recording, truth = withheld
    found = fitted_beyond(recording, str(diagnosis), (), print)
    posterior = posterior_beyond(recording, found)
    assert posterior.model.effects == ("gyroscope_scale",)
    off = posterior.mode[:12] - truth["position"].to_numpy()[1:].ravel()
    assert np.abs(off / np.sqrt(np.diag(posterior.covariance))[:12]).max() < 5
    density, data = traced(posterior)
    assert np.isfinite(float(density(posterior.mode, *data)))
