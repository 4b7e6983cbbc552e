"""The calibrated array as one sensor: each sample's motion with its covariance, under any model.

A gyroscope's reading at its rail says that the rate is there or beyond, on that side: it counts as
long as the rate falls short, and not beyond. Specific force determines products of rates only, so
there may be several minima where gyroscopes are lost; one of them agrees with the readings' sides.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from imuarray.engine.derivatives import no_derivatives
from imuarray.engine.linearise import CHUNK, RoughPrior, State, chunk_at, motion_equations, padded
from imuarray.engine.normal import pick
from imuarray.engine.parameters import Columns, columns_of
from imuarray.engine.readings import Readings, by_imu, measured
from imuarray.engine.settings import SETTINGS
from imuarray.engine.start import is_smooth, linear_motion, start, with_derivatives
from imuarray.engine.start import turned as with_slope
from imuarray.geometry.array import positions_of, require_planar_extent
from imuarray.model import ArrayModel
from imuarray.model.array_model import clock
from imuarray.motion.state import Motion, MotionEstimate

COMPONENTS = tuple(f"{name}_{axis}" for name in ("omega", "omega_dot", "s") for axis in "xyz")


class Fused(NamedTuple):
    """Motion at each sample; the covariance is of (omega, omega_dot, s) in that order."""

    estimate: MotionEstimate
    covariance: np.ndarray  # (T, 9, 9) rad/s, rad/s^2, m/s^2: noise and parameters
    from_calibration: np.ndarray  # (T, 9, 9), the parameters' part of it


class Motions(NamedTuple):
    """Searched motion (T, D), whether it was found (T,), steps (T,) and cost (T,)."""

    motion: np.ndarray
    converged: np.ndarray
    steps: np.ndarray
    cost: np.ndarray


def fuse(
    model: ArrayModel, specific_force, angular_rate, parameters=None, covariance=None,
    saturated=None, time=None, span: float | None = None,
) -> Fused:  # fmt: skip
    """Each sample's motion by maximum likelihood (2017, eq. 5) and how well it is known.

    Parameters
    ----------
    specific_force : (T, A, 3) m/s^2
    angular_rate : (T, G, 3) rad/s
    parameters : (P,) or None for the nominal ones
        r_2 ... r_A in m, then the effects' parameters in their units.
    covariance : (P, P) of them, or None: exactly known
        Their errors are the same at all samples, so they do not average out over time.
    saturated : (T, G, 3) bool or None
        Gyroscope axes at the rail. Their readings give the side and the least size of the rate,
        and nothing to the covariances.
    time, span : (T,) s and s
        Since the calibration's recording began, and its length, which drifts and clocks look at;
        of two IMUs the rate's change with time is a prior of the angular acceleration.

    Raises
    ------
    IdentifiabilityError
        For collinear triads.
    InputError
        For noise that is not one sd for each triad, for two IMUs' samples that do not follow each
        other.
    """
    parameters = model.array.parameters if parameters is None else np.asarray(parameters, float)
    split = 3 * (model.array.accelerometers - 1)
    positions = positions_of(parameters[:split])
    readings = measured(model, specific_force, angular_rate, saturated)
    if time is not None:
        since = np.asarray(time, float)
        readings = replace(readings, time=since, span=float(span) if span else clock(since)[1])
    if readings.pair:
        return _of_two(readings, model, positions, parameters[split:], covariance)
    require_planar_extent(positions, "positions")
    rails, every = one_sided(readings, saturated), np.arange(len(readings.time))
    mean, _ = model.noise.angular_rate_given_gyroscopes(np.asarray(angular_rate, float), saturated)
    state = _state(readings, model, mean, positions, parameters[split:])
    found = descend(readings, model, state, every, rails)
    beyond = turned(mean := found.motion[:, :3], angular_rate, saturated)
    other = np.flatnonzero(np.any(beyond != mean, axis=1))
    if other.size:
        begin = _state(readings, model, beyond, positions, parameters[split:])
        again = descend(readings, model, begin, other, rails)
        one = found.cost[other], found.converged[other]
        take = better(one, (again.cost, again.converged))
        _put(found, other[take], Motions(*(part[take] for part in again)))
    state = state._replace(motion=found.motion)
    timed = any(item.shifts_time for item in model.chain)
    if timed and _followed(readings) and is_smooth(readings, found.motion):
        found, state = _with_neighbours(readings, model, state, rails)
    return Fused(_estimate(found), *covariances(readings, model, state, covariance))


def _followed(readings: Readings) -> bool:
    """True where samples follow each other closely enough for neighbours to tell derivatives."""
    step = np.median(np.diff(readings.time)) if len(readings.time) > 1 else 0.0
    close = 0.0 < step < SETTINGS.longest_step
    return bool(close and np.bincount(readings.run).max() >= readings.window)


def _with_neighbours(readings: Readings, model: ArrayModel, state: State, rails):
    """(`Motions`, state) with the higher derivatives from the neighbours, as an estimate has them.

    A delay then counts to second order, and of gyroscopes to third.
    """
    readings = replace(readings, gapless=True)
    nothing = no_derivatives(len(state.motion), len(state.positions))
    first = State(state.motion[:, :9], state.positions, state.parameters, nothing)
    return _in_turns(readings, model, first, rails)


def _in_turns(readings: Readings, model: ArrayModel, state: State, rails=None):
    """(`Motions`, state): the motion and the derivatives of its own course, in turns."""
    every = np.arange(len(readings.time))
    for _ in range(SETTINGS.pair_turns):
        state = with_derivatives(readings, state, True)
        found = descend(readings, model, state, every, rails)
        state = state._replace(motion=found.motion)
    return found, state


def _of_two(readings: Readings, model: ArrayModel, positions, effects, covariance) -> Fused:
    """The motion that two IMUs see, their rate's change a prior of omega_dot.

    NaN where an axis has no gyroscope off its rail.
    """
    samples = len(readings.time)
    used = np.flatnonzero(readings.keep[..., 3:].any(axis=1).all(axis=1))
    part = readings.select(used)
    part = replace(part, gapless=_followed(part))
    state = start(part, columns_of(model.array, model.effects, np.inf))
    state = state._replace(positions=positions, parameters=np.asarray(effects))
    own, state = _in_turns(part, model, state)
    nowhere = np.full((samples, 9), np.nan)
    found = Motions(nowhere, np.zeros(samples, bool), np.zeros(samples, int), nowhere[:, 0].copy())
    _put(found, used, own)
    spreads = np.full((2, samples, 9, 9), np.nan)
    # the parameters' share: the prior's mean moves with them
    spreads[:, used] = covariances(part, model, with_slope(part, state, follows=True), covariance)
    return Fused(_estimate(found), *spreads)


def _estimate(found: Motions) -> MotionEstimate:
    parts = np.split(found.motion, found.motion.shape[1] // 3, axis=1)
    motion = Motion(*parts) if len(parts) == 5 else Motion.of(*parts)
    return MotionEstimate(motion, found.cost, found.steps, found.converged)


def _state(readings: Readings, model: ArrayModel, rate, positions, effects) -> State:
    """Where a search begins, at ``rate`` (T, 3); higher derivatives that effects need have a prior.

    omega_dot and s are the most likely ones of that rate without effects.
    """
    x, prior = np.hstack([rate, linear_motion(readings, positions, rate)]), None
    if model.needs_derivatives:
        mean = np.zeros((len(x), 6))
        x = np.hstack([x, mean])
        prior = RoughPrior(mean, mean + np.repeat(model.derivative_sd, 3), mean[:, :3])
    nothing = no_derivatives(len(x), len(positions))
    return State(x, positions, np.asarray(effects), nothing, prior)


def one_sided(readings: Readings, saturated) -> np.ndarray | None:
    """Weights (T, N, 6) of readings at a rail, or None where there are none."""
    if saturated is None or not np.any(saturated):
        return None
    lost = by_imu(np.zeros((*np.shape(saturated)[:1], 0, 3)), np.asarray(saturated, float))
    rails = np.zeros(readings.values.shape)
    rails[:, : lost.shape[1]] = lost
    return rails / np.repeat(readings.sd, 3, axis=1)


def turned(rate, angular_rate, saturated) -> np.ndarray:
    """``rate`` (T, 3) rad/s, its lost axes on the side of their readings and not below them."""
    if saturated is None:
        return rate
    saturated = np.asarray(saturated)
    count = np.maximum(saturated.sum(axis=1), 1)
    rail = np.where(saturated, angular_rate, 0.0).sum(axis=1) / count
    beyond = np.sign(rail) * np.maximum(np.abs(rate), np.abs(rail))
    agrees = (rate * np.sign(rail) >= np.abs(rail)) | ~saturated.any(axis=1)
    return np.where(agrees, rate, beyond)


def better(one, other) -> np.ndarray:
    """(T,) bool: which samples of ``one`` to replace by ``other``, both (cost (T,), found (T,)).

    One that was found goes before one that was not, then the lower cost.
    """
    return np.where(one[1] == other[1], other[0] < one[0], other[1])


def _put(found: Motions, index, part: Motions) -> None:
    for target, new in zip(found, part, strict=True):
        target[index] = new


def descend(
    readings: Readings, model: ArrayModel, state: State, index, rails=None,
    tolerance=SETTINGS.fusion_tolerance,
) -> Motions:  # fmt: skip
    """The motion of the samples ``index`` (n,), each by itself, by Gauss-Newton from a state.

    Damped by halving: a step that raises its sample's cost is halved. Converged is a sample whose
    motion moves by less than ``tolerance`` of its own sds.
    """
    x = state.motion.copy()
    found = Motions(x[index], *(np.zeros(len(index), t) for t in (bool, int, float)))
    information, slope, cost = equations(readings, model, state, index, rails)
    length, left = np.ones(len(index)), np.arange(len(index))
    for _ in range(SETTINGS.fusion_steps):
        step = np.linalg.solve(information[left], slope[left][..., None])[..., 0]
        # in units of the step's own sds: its length in the metric of the information
        size = np.einsum("ti,tij,tj->t", step, information[left], step)
        found.converged[left] = size < tolerance**2
        left, step = left[~found.converged[left]], step[~found.converged[left]]
        if not left.size:
            break
        trial = found.motion[left] + length[left, None] * step
        x[index[left]] = trial
        tried = equations(readings, model, state._replace(motion=x), index[left], rails)
        lower = tried[2] <= cost[left] * (1 + 1e-12)
        for target, new in zip(
            (found.motion, information, slope, cost), (trial, *tried), strict=True
        ):
            target[left[lower]] = new[lower]
        length[left] = np.where(lower, 1.0, length[left] / 2)
        found.steps[left] += 1
    return found._replace(cost=cost)


def equations(readings: Readings, model: ArrayModel, state: State, index, rails=None):
    """`motion_equations` of any number of samples, a chunk after the other."""
    parts = []
    for first in range(0, len(index), CHUNK):
        rows = index[padded(first, len(index))]
        parts.append(motion_equations(readings, model, state, rows, rails))
    return [np.concatenate(part)[: len(index)] for part in zip(*parts, strict=True)]


def covariances(readings: Readings, model: ArrayModel, state: State, spread):
    """Covariances of each sample's motion: the whole (T, 9, 9), and the parameters' share of it."""
    columns = columns_of(model.array, model.effects, np.inf)
    noise, shared = np.empty((2, len(readings.time), 9, 9))
    active, place = _places(columns, 3 * (model.array.accelerometers - 1), model.effect_size)
    directions = np.arange(columns.size)
    for first in range(0, len(noise), CHUNK):
        part = slice(first, first + CHUNK)
        linearised = chunk_at(readings, columns, state, directions, first)
        turned = np.swapaxes(linearised.inverse, 1, 2)
        noise[part] = (turned @ np.swapaxes(turned, 1, 2))[:, :9, :9]
        if spread is not None:
            # the estimate's derivative by the parameters, with its sign turned
            moved = (turned @ pick(linearised.projected, active)[1])[:, :9]
            shared[part] = moved @ np.asarray(spread)[np.ix_(place, place)] @ moved.mT
        else:
            shared[part] = 0.0
    return noise + shared, shared


def _places(columns: Columns, positions: int, effects: int) -> tuple[np.ndarray, np.ndarray]:
    """The parameters as a mask (N, m), and where (P,) each of them is in the flat order."""
    numbers = 1.0 + np.arange(positions + effects)
    relative = np.vstack([np.zeros((1, 3)), numbers[:positions].reshape(-1, 3)])
    state = State(np.empty((0, 9)), relative, numbers[positions:], ())
    whole = columns.flat(state)
    return whole > 0, whole[whole > 0].astype(int) - 1
