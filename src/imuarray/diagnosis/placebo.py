"""Placebos: an adopted cause with its numbers given to other IMUs must gain nothing."""

from __future__ import annotations

import numpy as np

from imuarray.diagnosis.fit import flat_parameters
from imuarray.diagnosis.scans import delay_score
from imuarray.diagnosis.state import Cause, Search
from imuarray.model.timing import clock_turns


def placebo_gain(search: Search, cause: Cause) -> tuple[float, float]:
    """(nats the cause gains, nats it gains with each IMU's numbers given to the next).

    Against the same model with the cause's parameters at zero, all others refitted (quadratic).
    A clock's ages pass to the next IMU as they are.
    """
    if cause.effect == "sensor_clock":
        return _of_ages(search)
    given, columns = search.given, search.columns
    every = np.zeros(search.active.shape, bool)
    every[:, columns.of(cause.effect)] = search.active[:, columns.of(cause.effect)].any(axis=0)
    every &= columns.owner
    flat = flat_parameters(columns, search.fit.state)
    rows = np.flatnonzero(every.any(axis=1))
    moved = flat.copy()
    moved[rows] = flat[np.roll(rows, 1)]
    places = given.places(every)
    active = np.setdiff1d(given.places(search.active), places)
    information, score, _ = given.conditional(active)
    block, slope = information[np.ix_(places, places)], score[places]

    def nats(values):
        step = values - flat[every]
        return slope @ step - step @ block @ step / 2

    nothing = nats(np.zeros(len(places)))
    return float(-nothing), float(nats(moved[every]) - nothing)


def _of_ages(search: Search) -> tuple[float, float]:
    """All IMUs' ages at once: what they have in common the motion takes up."""
    fit, column = search.fit, search.columns.of("sensor_delay")[0]
    along, through = fit.whitened[..., column], fit.through[..., column]
    score, _ = delay_score(fit)
    clocks = search.columns.model.split(np.asarray(fit.state.parameters))["sensor_clock"]
    readings = search.readings
    turns = clock_turns(clocks.T, readings.time[:, None], readings.span)
    delay = -(clocks[:, 3] + clocks[:, 0] * (turns - np.floor(turns) - 0.5))

    def informed(values):
        common = np.einsum("tkd,tk->td", through, values)
        own = np.sum(along**2, axis=2) * values
        return own - np.einsum("tkd,td->tk", through, common)

    imus = list(search.clocks)
    own, moved = np.zeros_like(delay), np.zeros_like(delay)
    own[:, imus] = delay[:, imus]
    moved[:, imus] = np.roll(delay[:, imus], 1, axis=1)
    bare = score + informed(own)

    def nats(values):
        return float(np.sum(values * (bare - informed(values) / 2)))

    return nats(own), nats(moved) if len(imus) > 1 else 0.0
