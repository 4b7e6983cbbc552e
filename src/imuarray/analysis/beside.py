"""A recording beside a calibration of its board, whichever recordings that is from."""

from dataclasses import replace

import numpy as np
import xarray as xr

from imuarray.analysis.sensors import used
from imuarray.engine.clocks import CLOCK, refined, shown_clocks, timed, with_clocks
from imuarray.engine.estimate import Estimate, Recorded, estimate
from imuarray.engine.linearise import State
from imuarray.engine.parameters import columns_of, model_of
from imuarray.engine.readings import Readings, measured
from imuarray.engine.rough_fusion import Rough, roughly
from imuarray.engine.settings import SETTINGS
from imuarray.model.effects import EFFECTS
from imuarray.recording import Recording
from imuarray.trust import effect_names


def with_board(recording: Recording, calibration: xr.Dataset) -> tuple[Readings, Estimate]:
    """A recording's samples, and its own parameters beside a calibration's, which stay.

    Clocks are looked for where they are among the calibration's effects.
    """
    readings, effects = used(recording), effect_names(calibration)
    own = [name for name in effects if EFFECTS[name].own]
    timing = ["sensor_delay"] * (CLOCK in own and "sensor_delay" not in effects)
    columns = columns_of(readings.array, [*effects, *timing], readings.position_prior_sd)
    values = model_of(recording, effects).split(calibration["effect_parameter"].to_numpy())
    kept = {name: value for name, value in values.items() if name not in own}
    positions = calibration["position"].to_numpy()
    state = State(np.empty((0, 9)), positions, columns.model.join(kept), ())
    one = Recorded.of(readings, columns, state)
    fitted = [name for name in own if name != CLOCK]
    free = columns.mask(fitted)
    if CLOCK not in own:
        return readings, estimate([one], columns, free)
    one = estimate([one], columns, free, steps=SETTINGS.group_steps).recorded[0]
    clocks, keep = shown_clocks(one, columns), readings.keep
    imus = sorted(clocks)
    one = with_clocks(one, columns, clocks)
    one = timed(refined(one, keep, columns, imus), keep, columns, imus)
    found = columns.model.split(one.state.parameters)
    columns = columns_of(readings.array, effects, readings.position_prior_sd)
    joined = columns.model.join({name: found[name] for name in effects})
    one = replace(one, state=one.state._replace(parameters=joined))
    return readings, estimate([one], columns, columns.mask(fitted) | columns.mask([CLOCK], imus))


def fused(recording: Recording, calibration: xr.Dataset, chosen) -> Rough:
    """The motion of the samples ``chosen`` (T,) bool, the recording's own parameters fitted anew.

    Moving samples before and after them say how rough it is.
    """
    _, own = with_board(recording, calibration)
    moving = chosen | ~recording.still()
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
