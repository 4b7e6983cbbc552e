"""The array as one sensor under a model with effects: motion with covariances."""

from __future__ import annotations

import numpy as np

from imuarray.estimation.blocks import (
    Problem,
    motion_equations,
    normal_equations,
    pack_motion,
    problem,
    unpack_motion,
)
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.fusion import Fused
from imuarray.estimation.motion_ml import MotionEstimate, motion_at, motion_from
from imuarray.estimation.rails import better, contradiction, turned
from imuarray.geometry.array import positions_of, require_planar_extent
from imuarray.model import ArrayModel
from imuarray.model.array_model import clock
from imuarray.motion import Motion


def fuse_extended(
    model: ArrayModel, specific_force, angular_rate, parameters, covariance=None, saturated=None,
    time=None, span: float | None = None, tolerance: float = 1e-6, limit: int = 50,
) -> Fused:  # fmt: skip
    """`fuse` for a model with effects, by Gauss-Newton in each sample's whole motion.

    Parameters
    ----------
    parameters : (P,), r_2 ... r_A in m, then the effects' parameters in their units
    covariance : (P, P) of them, or None: exactly known
    time, span : (T,) s and s
        Since the calibration's recording began, and its length, which drifts and clocks look at.
    tolerance : float
        Stop when no sample's motion moves by more than this many of its own sds.
    """
    parameters = np.asarray(parameters, float)
    positions = positions_of(parameters[: 3 * (model.array.accelerometers - 1)])
    require_planar_extent(positions, "positions")
    data = Collapsed.of(model, specific_force, angular_rate, saturated)
    given = problem(model, specific_force, angular_rate, saturated)
    if time is not None:
        given = given._replace(
            time=np.asarray(time, float), span=float(span) if span else clock(time)[1]
        )
    x, converged, counts = _searched(given, data, parameters, saturated, tolerance, limit)
    blocks = normal_equations(given, x, parameters)
    whole = np.linalg.inv(blocks.motion)
    spread = np.zeros((parameters.size,) * 2) if covariance is None else covariance
    moved = whole @ blocks.cross
    shared = (moved @ spread @ moved.swapaxes(1, 2))[:, :9, :9]
    motion = Motion(*map(np.asarray, unpack_motion(x)))
    found = MotionEstimate(motion, np.full(len(x), np.nan), counts, converged)
    return Fused(found, whole[:, :9, :9] + shared, shared)


def _searched(given, data, parameters, saturated, tolerance, limit):
    """(motion (T, n), converged (T,), steps (T,)).

    Specific force tells products of rates only, so where gyroscopes are lost there are several
    minima: those samples are searched from both sides of their readings, and contradicting a
    reading at its rail counts.
    """
    positions = positions_of(parameters[: 3 * (given.model.array.accelerometers - 1)])
    first = motion_from(data, positions).motion
    start = pack_motion(given.model, first)
    x, converged, counts, cost = _descend(given, start, parameters, tolerance, limit)
    if saturated is None or not np.any(saturated):
        return x, converged, counts
    lost = np.flatnonzero(np.any(saturated, axis=(1, 2)))
    part, flags = _rows(given, lost), np.asarray(saturated)[lost]
    cost[lost] += _contradiction(part, x[lost], parameters, flags)
    for rate in (first.angular_rate, x[:, :3]):
        rate = turned(np.asarray(rate), given.angular_rate, saturated)
        start = pack_motion(given.model, motion_at(data, positions, rate))[lost]
        other = _descend(part, start, parameters, tolerance, limit)
        price = other[3] + _contradiction(part, other[0], parameters, flags)
        take = better((cost[lost], converged[lost]), (price, other[1]))
        index = lost[take]
        x[index], converged[index], counts[index] = (field[take] for field in other[:3])
        cost[index] = price[take]
    return x, converged, counts


def _rows(given: Problem, index) -> Problem:
    """Some samples of a problem."""
    rate = given.whiten_rate[index] if len(given.whiten_rate) > 1 else given.whiten_rate
    force, angular = given.specific_force[index], given.angular_rate[index]
    return given._replace(
        specific_force=force, angular_rate=angular, keep=given.keep[index], time=given.time[index],
        whiten_rate=rate,
    )  # fmt: skip


def _contradiction(given: Problem, x, parameters, saturated) -> np.ndarray:
    size = 3 * (given.model.array.accelerometers - 1)
    foretold = given.model.predict_many(
        unpack_motion(x), positions_of(parameters[:size]), parameters[size:], given.time,
        span=given.span,
    ).angular_rate  # fmt: skip
    sd = np.sqrt(np.diag(given.model.noise.gyroscope)).reshape(-1, 3)
    return contradiction(np.asarray(foretold), given.angular_rate, saturated, sd)


def _descend(given, x, parameters, tolerance, limit):
    """(motion (T, n), converged (T,), steps (T,), cost (T,)), each sample by itself.

    Damped by halving: a step that raises its sample's cost is halved.
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
        known, slope, price = motion_equations(_rows(given, left), trial, parameters)
        lower = price <= cost[left] * (1 + 1e-12)
        index = left[lower]
        x[index], cost[index] = trial[lower], price[lower]
        information[index], gradient[index] = known[lower], slope[lower]
        length[left] = np.where(lower, 1.0, length[left] / 2)
        counts[left] += 1
    return x, converged, counts, cost
