"""The samples that a board is estimated from, and an estimate from where a calibration has it."""

from dataclasses import replace

import numpy as np
import xarray as xr

from imuarray.analysis.model import Say, silent
from imuarray.engine.estimate import Estimate
from imuarray.engine.forward import resumed
from imuarray.engine.parameters import POSITION, columns_of, model_of
from imuarray.engine.readings import Readings, arrange, determined, most_informative
from imuarray.engine.start import start
from imuarray.errors import require
from imuarray.recording import Recording
from imuarray.trust import effect_names, require_fit


def again(recording: Recording, calibration: xr.Dataset, say: Say = silent) -> Estimate:
    """The estimate of a recording from where a calibration has it.

    Of the effects' parameters those are free that the calibration has estimated. InputError for
    another dataset, or other IMUs.
    """
    require_fit(calibration, recording)
    for name in str(calibration.attrs.get("mended", "")).split():
        say(f"{name}: concerns readings, not the model; they are used as they are")
    require("effect_parameter" in calibration, "", "a calibration with effects", "one without")
    effects, readings = effect_names(calibration), used(recording)
    origin, span = calibration.attrs["time_origin"], calibration.attrs["span"]
    since = readings.time + readings.origin - origin
    readings = replace(readings, time=since, span=span, origin=origin)
    columns = columns_of(readings.array, effects, readings.position_prior_sd)
    model, positions = model_of(recording, effects), calibration["position"].to_numpy()
    values, free = (
        columns.model.join(model.split(calibration[name].to_numpy()))
        for name in ("effect_parameter", "effect_sd")
    )
    state = start(readings, columns)._replace(positions=positions, parameters=values)
    active = columns.flat(state._replace(parameters=(free > 0).astype(float))) > 0
    active[:, columns.of(POSITION)] = True
    return resumed(readings, columns, active & columns.owner, state)


def used(recording: Recording, say: Say = silent) -> Readings:
    """The moving samples that a board is estimated from; InputError where there are none."""
    readings = arrange(recording, sparse=True)
    found = most_informative(readings.select(determined(readings, 1)), say)
    rate = 1 / np.median(np.diff(recording.time)) if len(recording.time) > 1 else 0.0
    none = f"none, at {rate:.4g} samples a second; is the unit of time right?"
    require(len(found.time), "recording", "samples that determine the motion", none)
    return found
