"""The standard sensor model: what most boards need, each rung kept where held-out time gains."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from imuarray.engine.estimate import Estimate, Recorded, estimate, places_of, tested
from imuarray.engine.fit import flat_parameters, from_flat
from imuarray.engine.heldout import gain_of
from imuarray.engine.parameters import POSITION, Columns, columns_of
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS
from imuarray.engine.widths import MAPS
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

    Each sweep tests the rungs in order, beside those that it has kept before; what is kept is
    fitted, then the others are tested again. At last each must still gain beside all others.
    InputError or LinAlgError where the readings do not determine positions or motion.
    """
    smooth = all(one.gapless for one in readings)
    names = [n for n, ids in RUNGS.items() if smooth or not any(map(_needs_neighbours, ids))]
    effects = [effect for name in names for effect in RUNGS[name]]
    if any(left is not None for one in readings for left in one.left):
        effects += [name for name in MAPS if name not in effects]
    columns = columns_of(readings[0].array, effects, readings[0].position_prior_sd)
    bare = mask_of(columns, [POSITION])
    found = estimate(
        [Recorded.of(one, columns) for one in readings], columns, bare, steps=SETTINGS.rung_steps
    )
    kept: set[str] = set()
    for _ in names:
        rungs = gains(found, names, kept)
        new = {rung.name for rung in rungs if rung.kept} - kept
        if not new:
            break
        kept |= new
        active = bare | mask_of(columns, [e for name in kept for e in RUNGS[name]])
        found = estimate(found.recorded, columns, active, steps=SETTINGS.rung_steps)
    kept = {rung.name for rung in rungs if rung.kept}
    active = bare | mask_of(columns, [e for name in kept for e in RUNGS[name]])
    return estimate(without(found, active), columns, active), rungs


def without(found: Estimate, active) -> list[Recorded]:
    """The recordings of an estimate, what is not ``active`` back at zero."""
    out = []
    for one in found.recorded:
        whole = flat_parameters(found.columns, one.state)
        dropped = found.active & ~active
        whole[dropped] = 0.0
        out.append(replace(one, state=from_flat(found.columns, one.state, whole)))
    return out


def _needs_neighbours(effect: str) -> bool:
    return EFFECTS[effect].derivatives


def mask_of(columns: Columns, effects) -> np.ndarray:
    """(N, m) bool of the parameters of some effects, or the positions."""
    return np.isin(columns.names, list(effects)) & columns.owner


def gains(found: Estimate, names: Sequence[str], kept: Container[str] = ()) -> list[Rung]:
    """What each rung gains on held-out time beside those kept, and those before it that gain.

    By one linearisation with all of them.
    """
    every = [name for name in RUNGS if name in names or name in kept]
    masks = {name: mask_of(found.columns, RUNGS[name]) for name in every}
    active = found.active | np.any(list(masks.values()), axis=0)
    blocks, precision, values = tested(found, active)
    places, out = places_of(found.columns, active, len(found.recorded)), []
    beside = found.active | np.any([masks[n] for n in every if n in kept] or [False], axis=0)
    for name in names:
        freed, used = (np.zeros(len(values), bool) for _ in range(2))
        for place in places:
            freed[place] |= masks[name][active]
            used[place] |= (beside | masks[name])[active]
        chosen = np.ix_(used, used)
        parts = [(inner[chosen], slope[used]) for inner, slope in blocks]
        nats, error = gain_of(parts, precision[chosen], values[used], freed[used])
        good = bool(nats > max(LEAST_Z * error, 0.0))
        beside = beside | (masks[name] & good)
        out.append(Rung(name, nats, error, good))
    return out
