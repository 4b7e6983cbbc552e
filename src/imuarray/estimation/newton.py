"""Joint Gauss-Newton of positions and motion for the papers' model, the motion eliminated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import NamedTuple

import numpy as np
import scipy.linalg
from threadpoolctl import ThreadpoolController

from imuarray.errors import IdentifiabilityError
from imuarray.estimation import kernels
from imuarray.estimation.bcd import Calibration
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.information import information, score
from imuarray.estimation.motion_ml import motion_estimate

FAR = 1.0  # sds of the step before: the information is computed anew after a longer one
SLOW = 0.05  # of the step before: and where steps contract less than so
TRIES = 10  # halvings of a step that raises the cost
RATE, LIMIT = 1e-10, 50  # of the search for each sample's omega: tolerance, steps
ROUNDED = 1e-14  # of y' Lambda y: what a cost, a small difference of such, is good to
SINGULAR = 1e-12  # least pivot of the information, scaled to a unit diagonal


def descend(
    data: Collapsed, start, prior=None, tolerance: float = 1e-6, limit: int = 50,
    covariance: bool = True,
) -> Calibration:  # fmt: skip
    """The most likely positions from ``start`` (A, 3) m, and, if asked for, their covariance.

    ``prior`` is None or (mean (3 (A - 1),) m, precision (3 (A - 1),) squared, 1 / m^2). Each
    iteration finds every sample's motion and takes a step of Fisher's scoring on the profile
    likelihood, with the information with the motion eliminated; near the optimum that is computed
    again only where steps shrink slowly. Stops when no coordinate moves by more than
    ``tolerance`` of its own sd. IdentifiabilityError where the information is singular.
    """
    with _one_thread():
        return _descended(data, start, prior, tolerance, limit, covariance)


@cache
def _blas() -> ThreadpoolController:
    return ThreadpoolController()


_LOCK, _HELD = Lock(), []  # a limit for each descent that runs; the first one's is put back


@contextmanager
def _one_thread() -> Iterator[None]:
    """BLAS' products are small here: more threads only wait for each other, 5 times as long.

    The limit is the whole process': it stays until the last of several descents at a time ends.
    """
    with _LOCK:
        limit = _HELD[0] if _HELD else _blas().limit(limits=1, user_api="blas")
        _HELD.append(limit)
    try:
        yield
    finally:
        with _LOCK:
            _HELD.pop()
            if not _HELD:
                limit.restore_original_limits()


def _descended(data, start, prior, tolerance, limit, covariance) -> Calibration:
    here = _at(data, np.array(start, float), data.mean.copy(), prior)
    curvature, costs, steps, converged, last = None, [here.cost], [0.0], False, np.inf
    for _ in range(limit):
        fresh = curvature is None or last > FAR
        curvature = _curvature(data, here, prior) if fresh else curvature
        step, size = _step(curvature, here)
        if not fresh and max(SLOW * last, tolerance) < size:
            curvature = _curvature(data, here, prior)
            step, size = _step(curvature, here)
        if size < tolerance:
            converged = True
            break
        there, length = _shortened(data, here, step, prior)
        if there is None:
            break  # no shorter step lowers the cost: not converged, and said so
        here, last = there, size
        costs.append(here.cost)
        steps.append(float(np.max(np.abs(length * step))))
    width = np.linalg.inv(_information(data, here, prior)) if covariance else None
    return Calibration(
        here.positions, motion_estimate(data, here.rate, here.state, here.costs, here.counts),
        np.array(costs), np.array(steps), converged, here.positions[None], width, np.empty(0),
    )  # fmt: skip


class Point(NamedTuple):
    """Positions, the most likely motion there, and how good both are."""

    positions: np.ndarray  # (A, 3)
    rate: np.ndarray  # (3, T)
    state: np.ndarray  # (w, phi) (12, T)
    reduced: tuple
    cost: float  # twice the negative log posterior
    costs: np.ndarray  # (T,) of it, each sample's
    counts: np.ndarray  # (T,) steps of the search for omega, negative where it did not end
    slope: np.ndarray  # (3 (A - 1),), half the cost's fall


class Curvature(NamedTuple):
    """Fisher information, factored, and the sds it implies."""

    factor: np.ndarray  # lower triangular
    sd: np.ndarray


def _at(data: Collapsed, positions, rate, prior) -> Point:
    """The motion is searched from ``rate`` (3, T)."""
    reduced = data.reduce(positions)
    C, b, X, phi, const, logdet, _ = reduced
    if np.isnan(logdet):
        raise IdentifiabilityError(
            "positions: expected triads from which omega_dot and s follow, found H'QH singular"
        )
    rate, counts = rate.copy(), np.empty(data.samples, np.int64)
    cost, state = np.empty(data.samples), np.empty((12, data.samples))
    kernels.angular_rates(
        rate, C, b, data.mean, data.gyroscope_information, RATE, LIMIT, cost, counts
    )
    kernels.linear_motion(rate, X, phi, state)
    cost += const
    total = float(cost.sum())
    slope = score(data, positions, state)[1:].ravel()
    if prior is not None:
        away = positions[1:].ravel() - prior[0]
        pull = prior[1] @ away
        total, slope = total + float(away @ pull), slope - pull
    return Point(positions, rate, state, reduced, total, cost, counts, slope)


def _information(data: Collapsed, here: Point, prior) -> np.ndarray:
    known = information(data, here.positions, here.rate, here.state, here.reduced)
    return known if prior is None else known + prior[1]


def _curvature(data: Collapsed, here: Point, prior) -> Curvature:
    known = _information(data, here, prior)
    scale = np.sqrt(np.maximum(np.diag(known), 1e-300))
    factor, failed = scipy.linalg.lapack.dpotrf(known / np.outer(scale, scale), lower=1)
    if failed or np.min(np.diag(factor)) ** 2 < SINGULAR:
        raise IdentifiabilityError(
            "calibration: expected informative motion, found a direction of the positions that the"
            " data do not determine"
        )
    half = scipy.linalg.lapack.dtrtri(factor, lower=1)[0]
    sd = np.sqrt(np.einsum("ij,ij->j", half, half)) / scale
    return Curvature(scale[:, None] * factor, sd)


def _step(curvature: Curvature, here: Point):
    """(step, its largest component in sds)."""
    step = scipy.linalg.lapack.dpotrs(curvature.factor, here.slope, lower=1)[0]
    return step, float(np.max(np.abs(step) / curvature.sd))


def _shortened(data: Collapsed, here: Point, step, prior):
    """(where the cost is no higher, share of the step), halved where need be; or (None, 0)."""
    length = 1.0
    for _ in range(TRIES):
        moved = here.positions.copy()
        moved[1:] += length * step.reshape(-1, 3)
        there = _at(data, moved, here.rate, prior)
        if there.cost <= here.cost + ROUNDED * data.energy.sum():
            return there, length
        length /= 2
    return None, 0.0
