"""Motion by maximum likelihood given the positions, sample by sample."""

from dataclasses import dataclass

import numpy as np

from imuarray.errors import IdentifiabilityError
from imuarray.estimation import kernels
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.rates import angular_rates
from imuarray.geometry.array import require_planar_extent
from imuarray.model import ArrayModel
from imuarray.motion import Motion


@dataclass(frozen=True)
class MotionEstimate:
    """Motion per sample with its convergence.

    ``motion`` fields (T, 3); ``cost`` (T,) twice the negative log likelihood up to a
    constant;
    ``iterations`` (T,) Gauss-Newton steps; ``converged`` (T,) bool.
    """

    motion: Motion
    cost: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray


def estimate_motion(
    model: ArrayModel,
    specific_force,
    angular_rate,
    positions=None,
    saturated=None,
    tolerance: float = 1e-10,
    limit: int = 50,
) -> MotionEstimate:
    """Concentrated Gauss-Newton of Skog et al. (2017, eq. 5): phi is eliminated exactly.

    Parameters
    ----------
    specific_force : (T, A, 3) m/s^2
    angular_rate : (T, G, 3) rad/s
    positions : (A, 3) m or None for the nominal ones (relative to the reference triad)
    saturated : (T, G, 3) bool or None
        Gyroscope axes at the rail; they are left out, and their reading only starts the
        iteration (which fixes the sign when every gyroscope is lost).

    Raises
    ------
    IdentifiabilityError
        For fewer than three or collinear triads.
    """
    positions = model.array.relative if positions is None else np.asarray(positions, float)
    require_planar_extent(positions, "positions")
    data = Collapsed.of(model, specific_force, angular_rate, saturated)
    return motion_from(data, positions, tolerance, limit)


def motion_from(
    data: Collapsed, positions, tolerance=1e-10, limit=50, start=None
) -> MotionEstimate:
    """`estimate_motion` for data already arranged, from ``start`` (T, 3) rad/s if given."""
    found, logdet = data.reduce(positions)
    if np.isnan(logdet):
        raise IdentifiabilityError(
            "positions: expected triads from which omega_dot and s follow, found H'QH singular"
        )
    rate = data.mean.copy() if start is None else np.array(start.T, order="C")
    cost, iterations = np.empty(data.samples), np.empty(data.samples, np.int64)
    angular_rates(
        rate, found.C, found.b, data.mean, data.gyroscope_information, tolerance, limit, cost,
        iterations,
    )  # fmt: skip
    state = np.empty((12, data.samples))
    kernels.linear_motion(rate, found.X, found.phi, state)
    return motion_estimate(data, rate, state, cost + found.const, iterations)


def motion_estimate(data: Collapsed, rate, state, cost, iterations) -> MotionEstimate:
    """From what the kernels found: omega (3, T), (w, phi) (12, T), cost and steps (T,)."""
    motion = _motion_of(data, rate.T, state)
    return MotionEstimate(motion, cost, np.abs(iterations), iterations > 0)


def motion_at(data: Collapsed, positions, rate) -> Motion:
    """The most likely rest of the motion where omega is ``rate`` (T, 3) rad/s."""
    found, _ = data.reduce(positions)
    state = np.empty((12, data.samples))
    kernels.linear_motion(np.array(np.asarray(rate).T, order="C"), found.X, found.phi, state)
    return _motion_of(data, rate, state)


def _motion_of(data: Collapsed, rate, state) -> Motion:
    return Motion.of(rate, state[6:9].T, (state[9:12] + data.offset).T)
