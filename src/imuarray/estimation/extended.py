"""The array as one sensor under a model with effects: motion with covariances."""

from __future__ import annotations

import numpy as np

from imuarray.estimation.blocks import normal_equations, problem, unpack_motion
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.fusion import Fused
from imuarray.estimation.motion_ml import MotionEstimate, motion_from
from imuarray.estimation.samplewise import search
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
    saturated : (T, G, 3) bool or None
        As for `fuse`.
    tolerance : float
        Stop when no sample's motion moves by more than this many of its own sds.

    Raises
    ------
    IdentifiabilityError
        For fewer than three or collinear triads.
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
    first = motion_from(data, positions).motion
    x, converged, counts, cost = search(
        given, data, positions, first, saturated, parameters, tolerance, limit
    )
    blocks = normal_equations(given, x, parameters)
    whole = np.linalg.inv(blocks.motion)
    spread = np.zeros((parameters.size,) * 2) if covariance is None else covariance
    moved = whole @ blocks.cross
    shared = (moved @ spread @ moved.swapaxes(1, 2))[:, :9, :9]
    motion = Motion(*map(np.asarray, unpack_motion(x)))
    found = MotionEstimate(motion, cost, counts, converged)
    return Fused(found, whole[:, :9, :9] + shared, shared)
