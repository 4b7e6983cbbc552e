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
from imuarray.estimation.bcd import Calibration
from imuarray.estimation.collapsed import Collapsed, tables
from imuarray.estimation.information import information, score
from imuarray.estimation.motion_ml import motion_estimate
from imuarray.estimation.rates import Work, most_likely, workspace

FAR = 5.0  # length of the step before: the information is computed anew after a longer one
SLOW = 0.05  # of the step before: and where steps contract less than so
TRIES = 10  # halvings of a step that raises the cost
RATE, LIMIT = 1e-10, 50  # of the search for each sample's omega: tolerance, steps
ROUNDED = 1e-14  # of y' Lambda y: what a cost, a small difference of such, is good to
SINGULAR = 1e-12  # least pivot of the information, of its diagonal


def descend(
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
    with _one_thread():
        return _descended(data, start, prior, tolerance, limit, covariance)


@cache
def _blas() -> list:
    return ThreadpoolController().select(user_api="blas").lib_controllers


_LOCK, _HELD = Lock(), []  # threads before, for each descent that runs; the last one restores them


@contextmanager
def _one_thread() -> Iterator[None]:
    """BLAS' products are small here: more threads only wait for each other, 5 times as long.

    The limit is the whole process': it stays until the last of several descents at a time ends.
    """
    with _LOCK:
        before = _HELD[0] if _HELD else [library.num_threads for library in _blas()]
        _HELD.append(before)
        _set_threads([1] * len(before))
    try:
        yield
    finally:
        with _LOCK:
            _HELD.pop()
            if not _HELD:
                _set_threads(before)


def _set_threads(counts) -> None:
    for library, count in zip(_blas(), counts, strict=True):
        library.set_num_threads(count)


def _descended(data, start, prior, tolerance, limit, covariance) -> Calibration:
    # two places, here and there: fresh memory at each step would cost as much as the arithmetic
    first, spare = (workspace(data.base) for _ in range(2))
    here = _at(data, np.array(start, float), data.mean, prior, first)
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
        there, length = _shortened(data, here, step, prior, spare)
        if there is None:
            break  # no shorter step lowers the cost: not converged, and said so
        here, spare, last = there, here.work, size
        costs.append(here.cost)
        steps.append(float(np.max(np.abs(length * step))))
    width = np.linalg.inv(_information(data, here, prior)) if covariance else None
    work = here.work
    return Calibration(
        here.positions, motion_estimate(data, here.rate, work.state, here.costs, work.counts),
        np.array(costs), np.array(steps), converged, here.positions[None], width, np.empty(0),
    )  # fmt: skip


class Point(NamedTuple):
    """Positions, the most likely motion there, and how good both are."""

    positions: np.ndarray  # (A, 3)
    rate: np.ndarray  # (3, T)
    work: Work  # the motion, and what led to it
    cost: float  # twice the negative log posterior
    costs: np.ndarray  # (T,) of it, each sample's
    slope: np.ndarray  # (3 (A - 1),), half the cost's fall


def _at(data: Collapsed, positions, rate, prior, work) -> Point:
    """The motion is searched from ``rate`` (3, T); fills ``work``."""
    rate = rate.copy()
    logdet = most_likely(
        positions, data.specific_force, data.energy, data.mean, data.gyroscope_information,
        data.weights, *tables(), rate, RATE, LIMIT, work,
    )  # fmt: skip
    if np.isnan(logdet):
        raise IdentifiabilityError(
            "positions: expected triads from which omega_dot and s follow, found H'QH singular"
        )
    cost = work.cost + work.const
    total = float(cost.sum())
    slope = score(data, positions, work.state, work.arms)[1:].ravel()
    if prior is not None:
        away = positions[1:].ravel() - prior[0]
        pull = prior[1] @ away
        total, slope = total + float(away @ pull), slope - pull
    return Point(positions, rate, work, total, cost, slope)


def _information(data: Collapsed, here: Point, prior) -> np.ndarray:
    work = here.work
    reduced = work.C, work.X, work.inverse
    known = information(data, here.positions, here.rate, work.arms, reduced)
    return known if prior is None else known + prior[1]


def _curvature(data: Collapsed, here: Point, prior) -> np.ndarray:
    """The Fisher information's lower Cholesky factor."""
    known = _information(data, here, prior)
    whole = known.diagonal().copy()
    # the transpose of what is symmetric: LAPACK's order, factored in place
    factor, failed = scipy.linalg.lapack.dpotrf(known.T, lower=1, overwrite_a=1)
    if failed or not np.min(factor.diagonal() ** 2 / whole) >= SINGULAR:  # NaN is none either
        raise IdentifiabilityError(
            "calibration: expected informative motion, found a direction of the positions that the"
            " data do not determine"
        )
    return factor


def _step(curvature, here: Point):
    """(step, its length in the information's metric: no coordinate moves by more sds)."""
    step = scipy.linalg.lapack.dpotrs(curvature, here.slope, lower=1)[0]
    return step, float(np.sqrt(max(step @ here.slope, 0.0)))


def _shortened(data: Collapsed, here: Point, step, prior, work):
    """(where the cost is no higher, share of the step), halved where need be; or (None, 0).

    Fills ``work``, which is not ``here``'s.
    """
    length = 1.0
    for _ in range(TRIES):
        moved = here.positions.copy()
        moved[1:] += length * step.reshape(-1, 3)
        there = _at(data, moved, here.rate, prior, work)
        if there.cost <= here.cost + ROUNDED * data.energy.sum():
            return there, length
        length /= 2
    return None, 0.0
