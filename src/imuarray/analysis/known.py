"""A recording beside a calibration of its board, whichever recordings that is from."""

from dataclasses import replace

import numpy as np
import xarray as xr

from imuarray.analysis.model import model_of
from imuarray.engine.estimate import Estimate
from imuarray.engine.known_board import with_own
from imuarray.engine.readings import Readings, arrange, determined, measured, most_informative
from imuarray.engine.rough_fusion import Rough, roughly
from imuarray.recording import Recording


def used(recording: Recording) -> Readings:
    """The moving samples that a board is estimated from."""
    readings = arrange(recording, sparse=True)
    return most_informative(readings.select(determined(readings, 1)), lambda text: None)


def with_board(recording: Recording, calibration: xr.Dataset) -> tuple[Readings, Estimate]:
    """A recording's samples, and what is its own beside a calibration's positions and effects."""
    readings, effects = used(recording), calibration.attrs["effects"].split(",")
    values = model_of(recording, effects).split(calibration["effect_parameter"].to_numpy())
    return readings, with_own(readings, effects, calibration["position"].to_numpy(), values)


def fused(recording: Recording, calibration: xr.Dataset, chosen) -> Rough:
    """The motion of the samples ``chosen`` (T,) bool, the recording's own parameters fitted anew.

    Moving samples before and after them say how rough it is.
    """
    _, own = with_board(recording, calibration)
    still = recording.stationary
    moving = chosen | (np.ones(len(chosen), bool) if still is None else ~still)
    since, part = recording.time - recording.time[0], recording.select(moving)
    papers, rails = model_of(recording), part.saturated_gyroscopes()
    readings = measured(papers, part.specific_force, part.angular_rate, rails, since[moving])
    # from the recording's start, not from its first moving sample
    readings = replace(readings, time=since[moving], span=float(since[-1]))
    lost = part.saturated_accelerometers()
    railed = np.zeros(readings.keep.shape, bool)
    railed[:, : lost.shape[1], :3] = lost
    whole = roughly(readings.without(railed), own, papers, rails)
    return whole.select(np.flatnonzero(chosen[moving])).fused()
