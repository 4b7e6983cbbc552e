"""Positions of the papers' model from more samples than memory holds, in passes over their parts.

The same search as `newton.fisher_scoring`: a pass sums the cost, its slope and the information of
all parts at some positions, each with its samples' most likely motion; nothing of it is kept.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from imuarray.errors import IdentifiabilityError
from imuarray.estimation import newton
from imuarray.estimation.bcd import Calibration, require_rotation
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.gauss_newton import apart
from imuarray.estimation.information import halves
from imuarray.estimation.motion_ml import MotionEstimate, motion_from
from imuarray.estimation.threads import one_thread
from imuarray.geometry.array import positions_of, require_planar_extent
from imuarray.linear import FLOOR, scaled_eigh, scaled_inverse
from imuarray.model import ArrayModel
from imuarray.motion import Motion


class Parts:
    """A recording's data (`Collapsed`), arranged part by part each time they are gone through.

    ``readings`` gives the parts: specific force (n, A, 3) m/s^2, angular rate (n, G, 3) rad/s and
    saturated gyroscope axes (n, G, 3).
    """

    def __init__(self, model: ArrayModel, readings: Callable[[], Iterator]):
        self.model, self.readings = model, readings

    def __iter__(self) -> Iterator[Collapsed]:
        return (Collapsed.of(self.model, *part) for part in self.readings())


def calibrate_parts(
    model: ArrayModel, readings: Callable[[], Iterator], tolerance: float = 1e-6, limit: int = 50
) -> Calibration:
    """As `calibrate_gauss_newton` from the nominal positions, in some five passes over `Parts`.

    IdentifiabilityError as there.
    """
    parts, positions = Parts(model, readings), model.array.relative
    require_planar_extent(positions, "positions")
    require_rotation(parts, positions)
    with one_thread():
        here, costs, steps = _pass(parts, positions), [], [0.0]
        for _ in range(limit + 1):
            covariance = _inverse(here.information)
            costs.append(here.cost)
            step = covariance @ here.slope
            converged = bool(np.sqrt(step @ here.slope) < tolerance)
            found = None if converged else _shortened(parts, positions, step, here)
            if found is None:
                break
            steps.append(float(np.max(np.abs(found[0] - positions))))
            positions, here = found
        require_rotation(parts, positions)
        motion, more = _motion(parts, positions)
    return Calibration(
        positions, motion, more + np.array(costs), np.array(steps), converged, positions[None],
        covariance,
    )  # fmt: skip


class Sums(NamedTuple):
    """Of all samples at some positions."""

    cost: float
    slope: np.ndarray  # (3 (A - 1),), half the cost's fall
    information: np.ndarray  # its square
    energy: float  # y' Lambda y, of which the cost is a small difference


def _pass(parts: Parts, positions) -> Sums:
    found = None
    for data in parts:
        given = newton.Given(data.arrays, np.empty(0), np.empty((0, 0)), halves())
        place = newton._place(given, positions)
        cost, sound = newton._evaluate(given, place)
        if not sound:
            raise IdentifiabilityError(newton.WHY[newton.FLAT])
        own = cost, place.slope, newton._information(given, place), data.energy.sum()
        found = own if found is None else [a + b for a, b in zip(found, own, strict=True)]
    return Sums(*found)


def _shortened(parts: Parts, positions, step, here: Sums):
    """(positions, their sums) a step on, halved until the cost falls; None where it never does."""
    for halvings in range(newton.TRIES):
        there = positions + positions_of(step / 2**halvings)
        found = _pass(parts, there)
        if found.cost <= here.cost + newton.ROUNDED * here.energy:
            return there, found
    return None


def _inverse(known) -> np.ndarray:
    if not scaled_eigh(known)[0][0] > FLOOR:
        raise IdentifiabilityError(newton.WHY[newton.WEAK])
    return scaled_inverse(known)


def _motion(parts: Parts, positions) -> tuple[MotionEstimate, float]:
    """Of all samples, and how their gyroscopes differ among themselves."""
    rows, more = [], 0.0
    for force, rate, saturated in parts.readings():
        data = Collapsed.of(parts.model, force, rate, saturated)
        one = motion_from(data, positions)
        # copies: the estimate's own fields keep all sums of a part
        rows.append((np.hstack(one.motion[:3]), one.cost, one.iterations, one.converged))
        more += apart(parts.model, data, rate, saturated)
    motion, *rest = (np.concatenate(field) for field in zip(*rows, strict=True))
    return MotionEstimate(Motion.of(*np.split(motion, 3, axis=1)), *rest), more
