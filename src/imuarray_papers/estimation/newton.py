"""Joint Gauss-Newton of positions and motion for the papers' model, the motion eliminated.

The whole search is compiled: a step is a tenth of a millisecond's arithmetic, and calls from Python
would double it.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.linalg

from imuarray.errors import IdentifiabilityError, require_shape
from imuarray.linear import FLOOR, scaled_eigh, scaled_inverse
from imuarray.model import ArrayModel
from imuarray.threads import one_thread
from imuarray_papers.compiled import njit
from imuarray_papers.estimation.collapsed import Collapsed, motion_estimate
from imuarray_papers.estimation.identifiability import Calibration, arranged, require_rotation
from imuarray_papers.estimation.information import fisher, information_at, slope
from imuarray_papers.estimation.rates import Work, most_likely, workspace

FAR = 5.0  # length of the step before: the information is computed anew after a longer one
SLOW = 0.05  # of the step before: and where steps contract less than so
TRIES = 10  # halvings of a step that raises the cost
RATE, LIMIT = 1e-10, 50  # of the search for each sample's omega: tolerance, steps
ROUNDED = 1e-14  # of y' Lambda y: what a cost, a small difference of such, is good to
SINGULAR = 1e-12  # least pivot of the information, of its diagonal
BLOCK = 128  # samples whose costs are added first, or a long recording's sum loses digits
CONVERGED, ENDED, FLAT, WEAK = 1, 0, -1, -2  # how a search ends
WHY = {
    FLAT: "positions: expected triads from which omega_dot and s follow, found H'QH singular",
    WEAK: "calibration: expected informative motion, found a direction of the positions that the"
    " data do not determine",
}


def fisher_scoring(
    data: Collapsed, start, prior=None, tolerance: float = 1e-6, limit: int = 50,
    covariance: bool = True,
) -> Calibration:  # fmt: skip
    """The most likely positions from ``start`` (A, 3) m, and, if asked for, their covariance.

    ``prior`` is None or (mean (3 (A - 1),) m, precision (3 (A - 1),) squared, 1 / m^2). Each
    iteration finds every sample's motion and takes a step of Fisher's scoring on the profile
    likelihood, with the information with the motion eliminated; near the optimum that is computed
    again only where steps shrink slowly. Stops when the step's length in the information's metric
    is below ``tolerance``: no coordinate then moves by more of its own sd. IdentifiabilityError
    where the information is singular.
    """
    given = Problem(data, *_prior(prior, data))
    # one layout and one type each, or all would be compiled again
    start, tolerance, limit = np.array(start, float, order="C"), float(tolerance), max(limit, 0)
    require_shape("start", start, (len(data.force), 3))
    with one_thread():
        here, costs, steps, status = _search(given, start, tolerance, limit)
        width = _covariance(given, here) if covariance and status not in WHY else None
        if status in WHY or (covariance and width is None):
            raise IdentifiabilityError(WHY.get(status, WHY[WEAK]))
    work = here.work
    return Calibration(
        here.positions, motion_estimate(data, here.rate, work.state, here.costs, work.counts),
        costs, steps, status == CONVERGED, here.positions[None], width,
    )  # fmt: skip


def _covariance(given, here):
    """The information's inverse, None where it is singular."""
    factor = np.empty((here.slope.size,) * 2)
    if not _curvature(given, here, factor):
        return None
    # the transpose is LAPACK's order; it fills one half
    half = np.tril(scipy.linalg.lapack.dpotri(factor.T, lower=1, overwrite_c=1)[0])
    return half + np.tril(half, -1).T


def _prior(prior, data: Collapsed):
    """(mean, precision), copied; empty for none."""
    if prior is None:
        return np.empty(0), np.empty((0, 0))
    size = 3 * (len(data.force) - 1)
    mean, precision = (np.array(part, float, order="C") for part in prior)
    require_shape("position prior's mean", mean, (size,))
    require_shape("position prior's precision", precision, (size, size))
    return mean, precision


class Problem(NamedTuple):
    """Data and prior of a search."""

    data: Collapsed
    prior_mean: np.ndarray  # (3 (A - 1),), or (0,) for none
    prior_precision: np.ndarray  # its square


class Place(NamedTuple):
    """Positions, the most likely motion there, and how good both are."""

    positions: np.ndarray  # (A, 3)
    rate: np.ndarray  # (3, T)
    costs: np.ndarray  # (T,) of twice the negative log likelihood
    slope: np.ndarray  # (3 (A - 1),), half the cost's fall, the prior's included
    work: Work


@njit
def _place(given, positions):
    return Place(
        positions.copy(), given.data.mean.copy(), np.empty(given.data.energy.size),
        np.empty(3 * len(positions) - 3), workspace(given.data.energy.size),
    )  # fmt: skip


@njit
def _search(given, start, tolerance, limit):
    """(where it ends, costs and position steps (n,), how it ended)."""
    here, there = _place(given, start), _place(given, start)
    costs, steps = np.zeros(limit + 1), np.zeros(limit + 1)
    size, enough = here.slope.size, ROUNDED * given.data.energy.sum()
    factor, step, last, known = np.empty((size, size)), np.empty(size), np.inf, False
    costs[0], sound = _evaluate(given, here)
    if not sound:
        return here, costs[:1], steps[:1], FLAT
    for taken in range(limit):
        fresh = not known or last > FAR
        if fresh and not _curvature(given, here, factor):
            return here, costs[: taken + 1], steps[: taken + 1], WEAK
        known, length = True, _solve(factor, here.slope, step)
        if not fresh and length > max(SLOW * last, tolerance):
            if not _curvature(given, here, factor):
                return here, costs[: taken + 1], steps[: taken + 1], WEAK
            length = _solve(factor, here.slope, step)
        if length < tolerance:
            return here, costs[: taken + 1], steps[: taken + 1], CONVERGED
        share, cost, sound = _shortened(given, here, there, step, costs[taken] + enough)
        if not sound:
            return here, costs[: taken + 1], steps[: taken + 1], FLAT
        if share == 0.0:  # no shorter step lowers the cost: not converged, and said so
            return here, costs[: taken + 1], steps[: taken + 1], ENDED
        # places change hands: memory anew at each step would cost as much as the arithmetic
        here, there, last = there, here, length
        costs[taken + 1], steps[taken + 1] = cost, share * np.max(np.abs(step))
    return here, costs, steps, ENDED


@njit
def _evaluate(given, place):
    """(twice the negative log posterior at the place, whether H'QH is not singular).

    Fills the rest of it; the motion is searched from its rate.
    """
    work, data = place.work, given.data
    if np.isnan(most_likely(data, place.positions, place.rate, RATE, LIMIT, work)):
        return np.nan, False
    total = 0.0
    for first in range(0, place.costs.size, BLOCK):
        part = 0.0
        for t in range(first, min(first + BLOCK, place.costs.size)):
            place.costs[t] = work.cost[t] + work.reduced.const[t]
            part += place.costs[t]
        total += part
    by_triad = slope(place.positions, data, work.state, work.arms)
    flat = place.positions.reshape(-1)[3:]
    place.slope[:] = by_triad.reshape(-1)[3:]
    for i in range(given.prior_mean.size):
        pull = 0.0
        for j in range(given.prior_mean.size):
            pull += given.prior_precision[i, j] * (flat[j] - given.prior_mean[j])
        total += (flat[i] - given.prior_mean[i]) * pull
        place.slope[i] -= pull
    return total, True


@njit
def _shortened(given, here, there, step, enough):
    """(share of the step, cost, whether H'QH is not singular); fills ``there``.

    The step is halved until the cost is ``enough`` or less; the share is 0 where it never is.
    """
    share = 1.0
    for _ in range(TRIES):
        there.positions[:] = here.positions
        flat = there.positions.reshape(-1)
        for i in range(step.size):
            flat[3 + i] += share * step[i]
        there.rate[:] = here.rate
        cost, sound = _evaluate(given, there)
        if cost <= enough or not sound:
            return share, cost, sound
        share /= 2.0
    return 0.0, cost, True


@njit
def _curvature(given, place, factor):
    """Cholesky's factor of the information, the prior's included, above the diagonal.

    Returns False where it is singular.
    By hand, for LAPACK's is not there in compiled code but as an exception: each row in turn is
    taken off those below, in vectors.
    """
    factor[:] = fisher(place.positions, given.data, place.rate, place.work.arms, place.work.reduced)
    for i in range(given.prior_mean.size):
        factor[i] += given.prior_precision[i]
    size = len(factor)
    whole, row = np.diag(factor).copy(), np.empty(size)
    for k in range(size):
        if not factor[k, k] > SINGULAR * whole[k]:  # NaN is not, and zero not more than zero
            return False
        scale = 1.0 / np.sqrt(factor[k, k])
        for i in range(k, size):
            row[i] = factor[k, i] * scale
            factor[k, i] = row[i]
        for j in range(k + 1, size):
            scale, target, source = row[j], factor[j, j:], row[j:]
            for i in range(target.size):
                target[i] -= scale * source[i]
    return True


@njit
def _solve(factor, slope, step):
    """Fills ``step``; returns its length in the information's metric: no coordinate moves by
    more sds."""
    size = step.size
    step[:] = slope
    for k in range(size):
        step[k] /= factor[k, k]
        for i in range(k + 1, size):
            step[i] -= factor[k, i] * step[k]
    length = np.sqrt(np.sum(step * step))
    for k in range(size - 1, -1, -1):
        for i in range(k + 1, size):
            step[k] -= factor[k, i] * step[i]
        step[k] /= factor[k, k]
    return length


def calibrate_gauss_newton(
    model: ArrayModel, specific_force, angular_rate, start=None, saturated=None,
    position_prior=None, rate_covariance=None, tolerance: float = 1e-6, limit: int = 50,
) -> Calibration:  # fmt: skip
    """ML (or MAP) positions of the papers' model, with their covariance (`newton.fisher_scoring`).

    Parameters
    ----------
    start : (A, 3) m or None for the nominal positions
    position_prior : None, or (mean (3 (A - 1),), sd) in metres
    rate_covariance : None, or (T, 3, 3) (rad/s)^2
        Of an array's one gyroscope, instead of the model's noise; say that of (30b).
    tolerance : float
        Stop when no position moves by more than this many of its own sds.

    Raises
    ------
    IdentifiabilityError, InputError
        As `calibrate_bcd`, and where the information of the positions is singular.
    """
    data, positions = arranged(model, specific_force, angular_rate, start, saturated)
    if position_prior is not None:
        mean, sd = np.asarray(position_prior[0], float), position_prior[1]
        position_prior = mean, np.diag(np.broadcast_to(sd, mean.shape) ** -2.0)
    found = fisher_scoring(
        data if rate_covariance is None else data.with_rates(rate_covariance), positions,
        position_prior, tolerance, limit,
    )  # fmt: skip
    require_rotation(data, found.positions)
    return replace(found, cost=found.cost + apart(model, data, angular_rate, saturated))


def apart(model: ArrayModel, data: Collapsed, angular_rate, saturated=None) -> float:
    """Cost of the gyroscopes' differences among themselves, which the collapsed cost leaves out."""
    spread = angular_rate - data.mean.T[:, None]
    nothing = np.zeros((len(spread), 3 * model.array.accelerometers))
    return model.noise.misfit(nothing, spread, saturated)


def parameter_covariance(model: ArrayModel, found: Calibration, saturated=None) -> np.ndarray:
    """Covariance (P, P) of r_2 ... r_A at an ML estimate: the Fisher information's inverse.

    IdentifiabilityError where that information is singular.
    """
    known = information_at(model, found.motion.motion, found.positions, saturated)
    values, vectors, _ = scaled_eigh(known)
    if not values[0] > FLOOR:
        weak = np.flatnonzero(np.abs(vectors[:, 0]) > 0.3)
        raise IdentifiabilityError(
            "calibration: expected informative motion, found a direction of the positions"
            f" (components {weak.tolist()}) that the data do not determine; the motion is too poor"
        )
    return scaled_inverse(known)
