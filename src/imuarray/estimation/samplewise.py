"""Each sample's whole motion by damped Gauss-Newton, readings at a rail used from one side.

A reading at its rail says that the rate is there or beyond, on that side: its residual counts as
long as the rate falls short, and not beyond. Specific force determines products of rates
only, so there may be several minima where gyroscopes are lost; one of them agrees with the
readings' sides.
"""

from __future__ import annotations

import numpy as np

from imuarray.estimation.blocks import ONE_SIDED, Problem, motion_equations, pack_motion
from imuarray.estimation.motion_ml import motion_at


def one_sided(given: Problem, saturated) -> Problem:
    """The problem with its readings at a rail, ``saturated`` (T, G, 3) bool, used from one side."""
    lost = np.asarray(saturated).reshape(given.keep.shape)
    return given._replace(keep=np.where(lost, ONE_SIDED, given.keep))


def turned(rate, angular_rate, saturated) -> np.ndarray:
    """``rate`` (T, 3) rad/s, its lost axes on the side of their readings and not below them."""
    count = np.maximum(saturated.sum(axis=1), 1)
    rail = np.where(saturated, angular_rate, 0.0).sum(axis=1) / count
    beyond = np.sign(rail) * np.maximum(np.abs(rate), np.abs(rail))
    agrees = (rate * np.sign(rail) >= np.abs(rail)) | ~saturated.any(axis=1)
    return np.where(agrees, rate, beyond)


def search(given: Problem, data, positions, first, saturated, parameters, tolerance, limit):
    """(motion (T, n), converged (T,), steps (T,), cost (T,)) of the lower minimum.

    From the motion ``first`` (fields (T, 3)), and where that falls short of readings at a rail
    from beyond them as well. ``data`` is the recording's `Collapsed`.
    """
    start = pack_motion(given.model, first)
    if saturated is None or not np.any(saturated):
        return descend(given, start, parameters, tolerance, limit)
    given = one_sided(given, saturated)
    found = descend(given, start, parameters, tolerance, limit)
    rate = np.asarray(first.angular_rate)
    beyond = turned(rate, given.angular_rate, np.asarray(saturated))
    index = np.flatnonzero(np.any(beyond != rate, axis=1))
    if index.size:
        start = pack_motion(given.model, motion_at(data, positions, beyond))[index]
        other = descend(rows(given, index), start, parameters, tolerance, limit)
        take = better((found[3][index], found[1][index]), (other[3], other[1]))
        for old, new in zip(found, other, strict=True):
            old[index[take]] = new[take]
    return found


def better(one, other) -> np.ndarray:
    """(T,) bool: which samples of ``one`` to replace by ``other``, both (cost (T,), found (T,)).

    One that was found goes before one that was not, then the lower cost.
    """
    return np.where(one[1] == other[1], other[0] < one[0], other[1])


def rows(given: Problem, index) -> Problem:
    """Some samples of a problem."""
    rate = given.whiten_rate[index] if len(given.whiten_rate) > 1 else given.whiten_rate
    force, angular = given.specific_force[index], given.angular_rate[index]
    return given._replace(
        specific_force=force, angular_rate=angular, keep=given.keep[index], time=given.time[index],
        whiten_rate=rate,
    )  # fmt: skip


def descend(given: Problem, x, parameters, tolerance, limit):
    """(motion (T, n), converged (T,), steps (T,), cost (T,)) from x (T, n), each sample by itself.

    Damped by halving: a step that raises its sample's cost is halved. Converged is a sample whose
    motion moves by less than ``tolerance`` of its own sds.
    """
    x, converged, counts = x.copy(), np.zeros(len(x), bool), np.zeros(len(x), int)
    information, gradient, cost = motion_equations(given, x, parameters)
    length, left = np.ones(len(x)), np.arange(len(x))
    for _ in range(limit):
        step = -np.linalg.solve(information[left], gradient[left][..., None])[..., 0]
        # in units of the step's own sds: its length in the metric of the information
        size = np.einsum("ti,tij,tj->t", step, information[left], step)
        converged[left] = size < tolerance**2
        left, step = left[~converged[left]], step[~converged[left]]
        if not left.size:
            break
        trial = x[left] + length[left, None] * step
        known, slope, price = motion_equations(rows(given, left), trial, parameters)
        lower = price <= cost[left] * (1 + 1e-12)
        index = left[lower]
        x[index], cost[index] = trial[lower], price[lower]
        information[index], gradient[index] = known[lower], slope[lower]
        length[left] = np.where(lower, 1.0, length[left] / 2)
        counts[left] += 1
    return x, converged, counts, cost
