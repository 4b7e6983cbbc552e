"""Placebos: an adopted cause with its numbers given to other IMUs must gain nothing."""

from __future__ import annotations

import numpy as np

from imuarray.diagnosis.fit import flat_parameters
from imuarray.diagnosis.special import SPECIAL
from imuarray.diagnosis.state import Cause, Search


def placebo_gain(search: Search, cause: Cause) -> tuple[float, float]:
    """(nats the cause gains, nats it gains with each IMU's numbers given to the next).

    Against the same model with the cause's parameters at zero, all others refitted (quadratic).
    """
    special = SPECIAL.get(cause.effect)
    if special and special.placebo:
        return special.placebo(search)
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
