"""The standard sensor model: what most boards need, each rung kept where held-out time gains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from imuarray.engine.estimate import Estimate, Recorded, estimate, places_of, tested
from imuarray.engine.heldout import gain_of
from imuarray.engine.parameters import POSITION, Columns, columns_of
from imuarray.engine.readings import Readings
from imuarray.errors import InputError
from imuarray.model.effects import EFFECTS

RUNGS = {
    "offsets": ("accelerometer_bias", "gyroscope_bias"),
    "gyroscope maps": ("gyroscope_scale", "gyroscope_misalignment"),
    "lag of the gyroscopes": ("gyroscope_delay",),
    "delay of each IMU": ("sensor_delay",),
    "lever arms of the axes": ("size_effect",),
}
LEAST_Z = 2.0  # standard errors of a gain on held-out time from which a rung is kept


class Rung(NamedTuple):
    """A rung and what it gains on held-out time: nats, their standard error; whether it is kept."""

    name: str
    gain: float
    error: float
    kept: bool


def with_effects(readings: Sequence[Readings], effects) -> Estimate:
    """Positions and all parameters of some effects; InputError where they are not a triad's own."""
    columns = columns_of(readings[0].array, tuple(effects), readings[0].position_prior_sd)
    if not columns.model.apart:
        raise InputError(
            f"effects: expected such as change their own triad's readings alone, found"
            f" {', '.join(effects)}"
        )
    active = mask_of(columns, [POSITION, *effects])
    return estimate([Recorded.of(one, columns) for one in readings], columns, active)


def climb(readings: Sequence[Readings]) -> tuple[Estimate, list[Rung]]:
    """The sensor model of a board from its recordings, rung by rung.

    InputError or LinAlgError where the readings do not determine positions or motion.
    """
    smooth = all(one.gapless for one in readings)
    names = [n for n, ids in RUNGS.items() if smooth or not any(map(_needs_neighbours, ids))]
    effects = [effect for name in names for effect in RUNGS[name]]
    columns = columns_of(readings[0].array, effects, readings[0].position_prior_sd)
    active = mask_of(columns, [POSITION])
    found = estimate([Recorded.of(one, columns) for one in readings], columns, active)
    rungs: dict[str, Rung] = {}
    while True:
        left = [name for name in names if name not in rungs or not rungs[name].kept]
        for rung in gains(found, {name: RUNGS[name] for name in left}):
            rungs[rung.name] = rung
        best = next((rungs[name] for name in left if rungs[name].kept), None)
        for name in left:
            if best is None or name != best.name:
                rungs[name] = rungs[name]._replace(kept=False)
        if best is None:
            return found, [rungs[name] for name in names]
        active = active | mask_of(columns, RUNGS[best.name])
        found = estimate(found.recorded, columns, active)


def _needs_neighbours(effect: str) -> bool:
    return EFFECTS[effect].derivatives


def mask_of(columns: Columns, effects) -> np.ndarray:
    """(N, m) bool of the parameters of some effects, or the positions."""
    return np.isin(columns.names, list(effects)) & columns.owner


def gains(found: Estimate, rungs: dict[str, tuple[str, ...]]) -> list[Rung]:
    """What each rung would gain on held-out time, by one linearisation with all of them."""
    active = found.active | mask_of(found.columns, [e for ids in rungs.values() for e in ids])
    blocks, precision, values = tested(found, active)
    places, out = places_of(found.columns, active, len(found.recorded)), []
    for name, effects in rungs.items():
        free = [mask_of(found.columns, effects)[active], found.active[active]]
        freed, used = (np.zeros(len(values), bool) for _ in range(2))
        for place in places:
            freed[place] |= free[0]
            used[place] |= free[0] | free[1]
        chosen = np.ix_(used, used)
        parts = [(inner[chosen], slope[used]) for inner, slope in blocks]
        nats, error = gain_of(parts, precision[chosen], values[used], freed[used])
        out.append(Rung(name, nats, error, bool(nats > LEAST_Z * error and nats > 0)))
    return out
