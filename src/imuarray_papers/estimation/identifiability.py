"""Where a calibration under the papers' model begins, and whether the motion determines it."""

from dataclasses import dataclass

import numpy as np

from imuarray.errors import IdentifiabilityError, InputError, require_shape
from imuarray.geometry.array import require_planar_extent
from imuarray.model import ArrayModel
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
        raise IdentifiabilityError(
            "motion: expected rotation about more than one axis (or angular acceleration off the"
            " axis), found angular rate and angular acceleration parallel to one axis throughout"
            " (Lemma 1 of paper 2017)"
        )
    if status == -2:
        raise IdentifiabilityError("positions: expected at least 3 triads that span a plane")


def require_rotation(data: Collapsed, positions) -> None:
    """Raise IdentifiabilityError where omega and omega_dot stay on one axis throughout.

    Every A_n = Omega(omega)^2 + Omega(omega_dot) is then blind along that axis (Lemma 1).
    The same where there is no angular rate: omega_dot alone leaves the scale free. Noise
    and the start's wrong positions would hide this from a plain rank test, so the motion
    off the common axis is compared with what they can feign: 5 sigma of noise, and a tenth
    of the centrifugal and Euler terms (positions wrong by a tenth of the array).
    """
    values, axes = np.linalg.eigh(data.mean @ data.mean.T / data.samples)
    spread = np.sqrt(np.maximum(values[::-1], 0.0))
    informed = data.rate_information[[0, 1, 2], [0, 1, 2]]
    if not np.any(informed > 0.0):
        raise IdentifiabilityError(
            "gyroscopes: expected readings off their rails, found all of them at a rail throughout:"
            " the array's scale is then undetermined"
        )
    noise = np.sqrt(1.0 / np.median(informed[informed > 0.0]))
    if spread[0] <= 5 * noise:
        raise IdentifiabilityError(
            "motion: expected rotation, found no angular rate above the gyroscopes' noise: the"
            " array's scale is then undetermined"
        )
    if spread[1] > max(1e-3 * spread[0], 5 * noise):
        return
    turn = motion_from(data, positions).motion.angular_acceleration
    whole, along, fast = np.sum(turn**2), np.sum((turn @ axes[:, 2]) ** 2), np.sum(data.mean**2)
    across, along, fast = np.array([whole - along, along, fast]) / data.samples
    inverse = data.reduce(positions)[0].inverse
    if np.sqrt(across) <= max(
        0.1 * np.hypot(np.sqrt(along), fast), 5 * np.sqrt(2 * np.max(np.diag(inverse)[:3]))
    ):
        explain(-1)
