"""Recordings whose IMUs sample on clocks of their own: found, and each reading in its own turn."""

from dataclasses import replace

import numpy as np

from imuarray.engine.clock_scan import (
    CLOCK,
    delay_of,
    estimated_again,
    sawtooths,
    without_jumps,
)
from imuarray.engine.estimate import Recorded
from imuarray.engine.fit import flat_parameters, from_flat, with_free_gyroscopes
from imuarray.engine.gyroscope_clocks import clocks_from_gyroscopes, enough_gyroscopes, with_phases
from imuarray.engine.parameters import Columns
from imuarray.engine.settings import SETTINGS


def shown_clocks(one: Recorded, columns: Columns) -> dict[int, np.ndarray]:
    """{imu: (P, f, phi, c, g)} of the IMUs whose delays are a sawtooth in time."""
    score, information = delay_of(one.readings, columns, one.state)
    imus = np.flatnonzero(one.readings.exists.any(axis=1))
    each = sawtooths(one.readings.time, score, information, imus, {})
    # in rough motion a first look sees a small part of an age, and so of the period
    least = SETTINGS.least_period if one.smooth else 0.0
    return {int(imu): values for imu, (_, values) in each.items() if values[0] > least}


def with_clocks(one: Recorded, columns: Columns, clocks: dict) -> Recorded:
    """The recording with clocks {imu: (P, f, phi, c, g)} in its parameters."""
    whole, chosen = flat_parameters(columns, one.state), columns.of(CLOCK)
    for imu, values in clocks.items():
        whole[imu, chosen] = values
    return replace(one, state=from_flat(columns, one.state, whole))


def clocks_in(one: Recorded, columns: Columns, imus) -> dict[int, np.ndarray]:
    """The inverse, of those of ``imus`` that turn."""
    values = flat_parameters(columns, one.state)[:, columns.of(CLOCK)]
    return {imu: values[imu] for imu in map(int, imus) if values[imu, 1] != 0.0}


def refined(one: Recorded, keep, columns: Columns, imus) -> Recorded:
    """Phases, rates and drifts again: by the ages, or once by the gyroscopes of rough motion.

    ``keep`` (T, N, 6) bool: the readings to use, those near jumps among them.
    """
    clocks, readings = clocks_in(one, columns, imus), replace(one.readings, keep=keep)
    if one.smooth or not enough_gyroscopes(readings, clocks):
        return replace(one, state=estimated_again(readings, columns, one.state, clocks))
    if one.state.gyroscopes_free:
        return one
    clocks = clocks_from_gyroscopes(readings, one.state.motion[:, 3:6], clocks)
    return with_clocks(one, columns, clocks)


def timed(one: Recorded, keep, columns: Columns, imus) -> Recorded:
    """Each reading in its own clock's turn, or without those near the jumps of clocks ``imus``.

    ``keep`` (T, N, 6) bool: the readings to use, those near jumps among them.
    """
    clocks, state = clocks_in(one, columns, imus), one.state
    readings = replace(one.readings, keep=keep)
    if one.smooth or not enough_gyroscopes(readings, clocks):
        readings, _ = without_jumps(readings, columns, state, clocks, SETTINGS.edge)
        return replace(one, readings=readings)
    if state.rough_prior.sd.shape[1] < 15:
        state = with_free_gyroscopes(readings, state)
    return replace(one, readings=with_phases(readings, state, clocks), state=state)
