"""A recording of a board that is known: its biases, clocks, noise and motion, fitted anew."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from imuarray.engine.clock_scan import CLOCK
from imuarray.engine.clocks import refined, shown_clocks, timed, with_clocks
from imuarray.engine.estimate import Estimate, Recorded, estimate
from imuarray.engine.ladder import DELAYS, RUNGS, Climbed, mask_of
from imuarray.engine.linearise import State
from imuarray.engine.parameters import POSITION, Columns, columns_of
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS
from imuarray.model.effects import EFFECTS


def board_of(readings: Sequence[Readings]) -> Estimate:
    """All rungs of the sensor model but the IMUs' delays, from recordings of rough motion."""
    columns = columns_of(
        readings[0].array, [effect for ids in RUNGS.values() for effect in ids],
        readings[0].position_prior_sd,
    )  # fmt: skip
    begun = [Recorded.of(one, columns) for one in readings]
    found = estimate(begun, columns, mask_of(columns, [POSITION]), steps=SETTINGS.rung_steps)
    now, _ = Climbed(found, tuple(one.readings.keep for one in begun), {}).clocked()
    return now.with_kept([n for n in RUNGS if n not in (*now.kept, DELAYS)]).fitted().found


def with_own(readings: Readings, effects, positions, values: dict) -> Estimate:
    """The parameters of a recording's own beside those of its board, which stay.

    ``effects``: of the board's model; ``positions`` (A, 3) m; ``values`` {effect: parameters}, of
    which those of a recording's own are not looked at. Clocks are looked for where they are among
    the effects.
    """
    own = [name for name in effects if EFFECTS[name].own]
    timing = ["sensor_delay"] * (CLOCK in own and "sensor_delay" not in effects)
    columns = columns_of(readings.array, [*effects, *timing], readings.position_prior_sd)
    kept = {name: value for name, value in values.items() if name not in own}
    state = State(np.empty((0, 9)), positions, columns.model.join(kept), ())
    one = Recorded.of(readings, columns, state)
    free = mask_of(columns, [name for name in own if name != CLOCK])
    if CLOCK not in own:
        return estimate([one], columns, free)
    one = estimate([one], columns, free, steps=SETTINGS.rung_steps).recorded[0]
    clocks, keep = shown_clocks(one, columns), readings.keep
    imus = sorted(clocks)
    one = with_clocks(one, columns, clocks)
    one = timed(refined(one, keep, columns, imus), keep, columns, imus)
    return _finished(one, columns, tuple(effects), [name for name in own if name != CLOCK], imus)


def _finished(one: Recorded, columns: Columns, effects, own, imus) -> Estimate:
    """All ``own`` effects and the clocks of some IMUs, no more than ``effects`` in the model."""
    found = columns.model.split(one.state.parameters)
    columns = columns_of(one.readings.array, effects, one.readings.position_prior_sd)
    values = columns.model.join({name: found[name] for name in effects})
    mask = mask_of(columns, [CLOCK])
    mask[np.setdiff1d(np.arange(len(mask)), imus)] = False
    one = replace(one, state=one.state._replace(parameters=values))
    return estimate([one], columns, mask_of(columns, own) | mask)
