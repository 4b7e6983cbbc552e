"""Where a calibration under the papers' model begins, and whether the motion determines it."""

from dataclasses import dataclass

import numpy as np

from imuarray.errors import IdentifiabilityError, InputError, require_shape
from imuarray.geometry.array import require_planar_extent
from imuarray.model import ArrayModel
from imuarray.motion import rotation
from imuarray.motion.state import MotionEstimate
from imuarray_papers.estimation.collapsed import Collapsed, motion_from


@dataclass(frozen=True)
class Calibration:
    """Estimated positions with how the iteration went.

    ``positions`` (A, 3) m relative to the reference triad; ``cost`` and ``step`` per
    iteration: twice the negative log likelihood before, and the largest position change
    (m) in, that iteration; ``snapshots`` (S, A, 3) after the iterations asked for.
    ``covariance`` (P, P) of r_2 ... r_A where the method gives it.
    """

    positions: np.ndarray
    motion: MotionEstimate
    cost: np.ndarray
    step: np.ndarray
    converged: bool
    snapshots: np.ndarray
    covariance: np.ndarray | None = None


def arranged(model: ArrayModel, specific_force, angular_rate, start=None, saturated=None):
    """(data, positions (A, 3) m relative to the reference) where a calibration begins.

    IdentifiabilityError for fewer than two samples (2017, section II) and for collinear triads;
    InputError for a model that is not the papers', with one noise sd for each accelerometer triad.
    """
    if model.effects or model.noise.triad_weights is None:
        raise InputError(
            "model: expected the papers', with one noise sd for each accelerometer triad, found"
            f" {', '.join(model.effects) or 'a covariance'}"
        )
    if len(specific_force) < 2:
        raise IdentifiabilityError(f"samples: expected at least 2, found {len(specific_force)}")
    positions = model.array.relative if start is None else np.array(start, float)
    require_shape("start", positions, model.array.positions.shape)
    positions = np.ascontiguousarray(positions - positions[0])
    require_planar_extent(positions, "positions")
    data = Collapsed.of(model, specific_force, angular_rate, saturated)
    require_rotation(data, positions)
    return data, positions


def explain(status: int) -> None:
    """Raise the IdentifiabilityError a kernel's negative status stands for."""
    if status == -1:
        raise IdentifiabilityError(rotation.ONE_AXIS)
    if status == -2:
        raise IdentifiabilityError("positions: expected at least 3 triads that span a plane")


def require_rotation(data: Collapsed, positions) -> None:
    """`imuarray.motion.rotation.require_rotation` of arranged data, at some positions."""
    informed = data.rate_information[[0, 1, 2], [0, 1, 2]]
    if not np.any(informed > 0.0):
        raise IdentifiabilityError(
            "gyroscopes: expected readings off their rails, found all of them at a rail throughout:"
            " the array's scale is then undetermined"
        )

    def turning():
        inverse = data.reduce(positions)[0].inverse
        turn = motion_from(data, positions).motion.angular_acceleration
        return turn, np.sqrt(np.max(np.diag(inverse)[:3]))

    noise = np.sqrt(1.0 / np.median(informed[informed > 0.0]))
    rotation.require_rotation(data.mean.T, noise, turning)
