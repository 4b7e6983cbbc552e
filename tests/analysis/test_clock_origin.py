"""Effects that look at the time count it from where the calibrated recording began."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.provenance import write_netcdf
from imuarray.recording import load_dataset
from tests.cases import known, model


@pytest.fixture
def drifting(tmp_path):
    """(recording that begins at 100 s, path of a calibration that states its drifts)."""
    own = replace(model(), effects=("bias_drift",))
    recording, truth = imuarray.simulate(
        own.array, 4.0, 50.0, seed=3, effects=own.effects, angular_rate=15.0, position_error=1e-4
    )
    recording = replace(recording, time=recording.time + 100.0)
    noise = recording.accelerometer_noise_sd, recording.gyroscope_noise_sd
    values, span = truth["effect_parameter"].to_numpy(), float(recording.time[-1] - 100.0)
    places, path = recording.relative_positions(), tmp_path / "cal.nc"
    write_netcdf(known(recording, own, values, 0.0, places, noise, 100.0, span), path)
    return recording, path


def ratio(recording, path):
    """Residual over noise under the calibration, positions free."""
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
    own_clock = {"time_origin": float(part.time[0]), "span": float(np.ptp(part.time))}
    write_netcdf(load_dataset(path).assign_attrs(own_clock), path)
    assert ratio(part, path)[0] > 1.5
