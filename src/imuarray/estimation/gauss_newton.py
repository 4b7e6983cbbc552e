"""Positions and effects by joint Gauss-Newton, the motion eliminated sample by sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imuarray.errors import IdentifiabilityError, require_shape
from imuarray.estimation.bcd import Calibration, require_rotation, require_samples
from imuarray.estimation.blocks import Blocks, normal_equations, pack_motion, problem
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.motion_ml import MotionEstimate, motion_from
from imuarray.estimation.newton import fisher_scoring
from imuarray.estimation.samplewise import descend as samplewise
from imuarray.geometry.array import positions_of, require_planar_extent
from imuarray.model import ArrayModel
from imuarray.motion import Motion

ENOUGH = 1e-3  # of a parameter's own sd, with effects
TOLERANCE, SEARCH = 1e-7, 30  # of a sample's motion: tolerance in its own sds, steps


def eliminate_motion(blocks: Blocks):
    """Schur complement: (information (P, P), gradient (P,), x-steps given p's step).

    Returns also a function from a shared step (P,) to the motion's (T, n).
    """
    right = np.concatenate([blocks.cross, blocks.motion_gradient[..., None]], axis=2)
    solved = np.linalg.solve(blocks.motion, right)
    size = blocks.cross.shape[-1]
    taken = blocks.cross.reshape(-1, size).T @ solved.reshape(-1, size + 1)

    def motion_step(step):
        return -solved[..., -1] - solved[..., :-1] @ step

    return blocks.shared - taken[:, :-1], blocks.shared_gradient - taken[:, -1], motion_step


def _checked_solve(information, gradient):
    """(step, covariance), solved in parameters scaled to a unit diagonal (metres beside seconds).

    IdentifiabilityError where the scaled information is singular.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    if not values[0] > 1e-12:
        weak = np.flatnonzero(np.abs(vectors[:, 0]) > 0.3)
        raise IdentifiabilityError(
            "calibration: expected informative motion, found a direction of the parameters"
            f" (components {weak.tolist()}) that the data do not determine; the motion is"
            " too poor, or an effect has a gauge that only a prior on the positions fixes"
        )
    inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
    return -inverse @ gradient, inverse


def calibrate_gauss_newton(
    model: ArrayModel,
    specific_force,
    angular_rate,
    start=None,
    saturated=None,
    position_prior=None,
    rate_covariance=None,
    time=None,
    tolerance: float | None = None,
    limit: int = 50,
) -> Calibration:
    """ML (or MAP) positions and effect parameters of any model, with their covariance.

    The papers' model with isotropic triads takes the collapsed form of `newton.fisher_scoring`, any
    other `calibrate_blocks`: the same optimum, far slower.

    Parameters
    ----------
    start : (A, 3) m or None for the nominal positions
    position_prior : None, or (mean (3 (A - 1),), sd) in metres
    rate_covariance : None, or (T, 3G, 3G) (rad/s)^2 instead of the model's gyroscope noise
    time : None, or (T,) s, which drifts, shifts and clocks look at
    tolerance : float or None
        Stop when no shared parameter moves by more than this many of its own sds; by default
        1e-6, with effects 1e-3, as misfit makes steps shrink slowly.

    Raises
    ------
    IdentifiabilityError
        As `calibrate_bcd`, and where the information of the parameters is singular.
    """
    if tolerance is None:
        tolerance = ENOUGH if model.effects else 1e-6
    require_samples(len(specific_force))
    positions = model.array.relative if start is None else np.asarray(start, float)
    require_shape("start", positions, model.array.positions.shape)
    positions = positions - positions[0]
    require_planar_extent(positions, "positions")
    data = Collapsed.of(model, specific_force, angular_rate, saturated)
    require_rotation(data, positions)
    if not model.effects and data.weights is not None and rate_covariance is None:
        if position_prior is not None:
            mean, sd = np.asarray(position_prior[0], float), position_prior[1]
            position_prior = mean, np.diag(np.broadcast_to(sd, mean.shape) ** -2.0)
        found = fisher_scoring(data, positions, position_prior, tolerance, limit)
        # the collapsed cost leaves out how the gyroscopes differ among themselves
        spread = angular_rate - data.mean.T[:, None]
        apart = model.noise.misfit(np.zeros((len(spread), 3 * len(positions))), spread, saturated)
        found = replace(found, cost=found.cost + apart)
    else:
        found = calibrate_blocks(
            model, specific_force, angular_rate, positions, saturated, position_prior,
            rate_covariance, time, tolerance, limit,
        )  # fmt: skip
    require_rotation(data, found.positions)
    return found


def calibrate_blocks(
    model: ArrayModel, specific_force, angular_rate, start, saturated=None, position_prior=None,
    rate_covariance=None, time=None, tolerance: float = 1e-6, limit: int = 50,
) -> Calibration:  # fmt: skip
    """`calibrate_gauss_newton` for any model, by automatic differentiation sample by sample."""
    positions = np.asarray(start, float)
    data = Collapsed.of(model, specific_force, angular_rate, saturated)
    first = motion_from(data, positions)
    given = problem(
        model, specific_force, angular_rate, saturated, position_prior, rate_covariance, time
    )
    x = pack_motion(model, first.motion)
    p = np.concatenate([positions[1:].ravel(), model.effect_start])
    x, p, costs, steps, converged, covariance = _iterate(given, x, p, tolerance, limit)
    size = 3 * (model.array.accelerometers - 1)
    found = positions_of(p[:size])
    motion = Motion.of(x[:, :3], x[:, 3:6], x[:, 6:9])
    flags = np.full(len(x), converged)
    estimate = MotionEstimate(motion, np.full(len(x), np.nan), np.full(len(x), len(costs)), flags)
    return Calibration(
        found, estimate, np.array(costs), np.array(steps), converged, found[None],
        covariance, p[size:],
    )  # fmt: skip


def _iterate(given, x, p, tolerance, limit):
    """Gauss-Newton on the profile: at each trial the motion is searched sample by sample.

    A step that raises the cost is halved, at most ten times. Steps of motion and parameters
    together would have to be halved for the worst sample's sake, again and again.
    """
    size = 3 * (given.model.array.accelerometers - 1)
    x, cost = _most_likely_motion(given, x, p)
    costs, steps, converged = [cost], [0.0], False
    for _ in range(limit):
        blocks = normal_equations(given, x, p)
        information, gradient, motion_step = eliminate_motion(blocks)
        step, covariance = _checked_solve(information, gradient)
        if np.max(np.abs(step) / np.sqrt(np.diag(covariance))) < tolerance:
            converged = True
            break
        length = 1.0
        for _ in range(10):
            trial_p = p + length * step
            trial_x, cost = _most_likely_motion(given, x + length * motion_step(step), trial_p)
            if cost <= costs[-1] * (1 + 1e-12):
                break
            length /= 2
        else:
            break  # no shorter step lowers the cost: not converged, and said so
        x, p = trial_x, trial_p
        costs.append(cost)
        steps.append(float(np.max(np.abs(length * step[:size]))))
    return x, p, costs, steps, converged, covariance


def _most_likely_motion(given, x, p):
    """(the most likely motion (T, n) from x on at p, the whole cost there, priors included)."""
    x, *_, cost = samplewise(given, x, p, TOLERANCE, SEARCH)
    offset = p - given.prior_mean
    return x, float(cost.sum() + np.sum((offset / given.prior_sd) ** 2))


def parameter_covariance(
    model: ArrayModel, specific_force, angular_rate, found: Calibration, saturated=None
) -> np.ndarray:
    """Covariance (P, P) of r_2 ... r_A at an ML estimate: the Fisher information's inverse.

    IdentifiabilityError where that information is singular.
    """
    given = problem(model, specific_force, angular_rate, saturated)
    x = pack_motion(model, found.motion.motion)
    blocks = normal_equations(given, x, found.positions[1:].ravel())
    information, gradient, _ = eliminate_motion(blocks)
    return _checked_solve(information, gradient)[1]
