"""Effects that look at the time count it from where the diagnosed recording began."""

import json
from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.errors import InputError
from imuarray.model.array_model import parameter_names
from tests.cases import diagnosis
from tests.test_bound import model


@pytest.fixture
def drifting(tmp_path):
    """(recording that begins at 100 s, path of a diagnosis that states its drifts)."""
    own = replace(model(), effects=("bias_drift",))
    recording, truth = imuarray.simulate(
        own.array, 4.0, 50.0, seed=3, effects=own.effects, angular_rate=15.0, position_error=1e-4
    )
    recording = replace(recording, time=recording.time + 100.0)
    labels = recording.accelerometer_labels, recording.gyroscope_labels
    names = [name.split(" ")[1] for name in parameter_names(own, labels)]
    values = truth["effect_parameter"].to_numpy()
    parameters = {name: (value, None) for name, value in zip(names, values, strict=True)}
    noise = recording.accelerometer_noise_sd, recording.gyroscope_noise_sd
    span = float(recording.time[-1] - 100.0)
    places = recording.relative_positions()
    document = diagnosis("bias_drift", parameters, places, noise, span, origin=100.0)
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(document))
    return recording, path


def ratio(recording, path):
    """Residual over noise under the diagnosis, positions free."""
    found = imuarray.calibrate(recording, model=path)
    return found.attrs["residual_ratio"], found.attrs["time_origin"], found.attrs["span"]


def test_a_part_is_corrected_as_the_whole(drifting):
    recording, path = drifting
    whole, *clock = ratio(recording, path)
    assert abs(whole - 1) < 0.1 and clock[0] == 100.0
    part = recording.select(np.arange(100, 200))
    half, *same = ratio(part, path)
    assert abs(half - 1) < 0.1 and same == clock
    # what went wrong where time was counted from a part's own beginning
    document = json.loads(path.read_text())
    document["clock"] = {"origin_s": float(part.time[0]), "span_s": float(np.ptp(part.time))}
    path.write_text(json.dumps(document))
    assert ratio(part, path)[0] > 1.5


def test_a_diagnosis_without_its_clock_is_refused(drifting):
    recording, path = drifting
    document = json.loads(path.read_text())
    del document["clock"]
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="no 'clock'"):
        ratio(recording, path)
