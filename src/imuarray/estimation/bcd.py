"""ML-BCD: positions and motion by block coordinate descent (2017, Algorithm 1)."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from imuarray.compiled import njit
from imuarray.errors import IdentifiabilityError, InputError, require_shape
from imuarray.estimation import kernels
from imuarray.estimation.collapsed import Collapsed, MotionEstimate, motion_from
from imuarray.estimation.rates import most_likely, workspace
from imuarray.geometry.array import require_planar_extent
from imuarray.model import ArrayModel


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


@njit
def _position_block(force, state, rows, values, A, positions):
    """Line 10-13 of Algorithm 1: least squares for r_2 ... r_K; returns the largest step.

    Returns -1 where sum_n A_n' A_n is singular (a common axis of rotation).
    """
    accelerometers = len(force)
    kernels.arms(state, rows, values, A)
    N = np.zeros((3, 3))
    kernels.arm_products(A, A[1:], N)
    inverse = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            p, q = (i + 1) % 3, (i + 2) % 3
            u, v = (j + 1) % 3, (j + 2) % 3
            inverse[i, j] = N[p, u] * N[q, v] - N[p, v] * N[q, u]
    determinant = N[0, 0] * inverse[0, 0] + N[0, 1] * inverse[0, 1] + N[0, 2] * inverse[0, 2]
    if not determinant > 1e-12 * (N[0, 0] + N[1, 1] + N[2, 2]) ** 3:
        return -1.0
    inverse /= determinant
    right = np.zeros((accelerometers + 1, 3))
    kernels.arm_products(A, force, right)
    kernels.arm_products(A, A[:1], right[accelerometers:])  # what s and omega make at the origin
    x0, y0, z0 = right[accelerometers]
    largest = 0.0
    for k in range(1, accelerometers):
        x, y, z = right[k, 0] - x0, right[k, 1] - y0, right[k, 2] - z0
        for i in range(3):
            new = inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] * z
            largest = max(largest, abs(new - positions[k, i]))
            positions[k, i] = new
    return largest


@njit
def block_descent(data, positions, tolerance, cost_tolerance, limit, marks):
    """Algorithm 1 on a recording's `Arrays`; ``positions`` (A, 3) is start and result.

    Returns (status, cost (n,), step (n,), snapshots (S, A, 3)) as `Calibration` has them after n
    iterations: status 1 converged, 0 stopped at the limit, -1 sum A'A singular, -2 H' Lambda H
    singular.
    """
    work, rate, known = workspace(data.energy.size), data.mean.copy(), data.tables
    cost, moved = np.empty(limit), np.empty(limit)
    snapshots = np.empty((len(marks), *positions.shape))
    mark, done, status = 0, 0, 0
    while done < limit and status == 0:
        if np.isnan(most_likely(data, positions, rate, 1e-7, 50, work)):
            status = -2
            break
        step = _position_block(
            data.force, work.state, known.rows, known.values, work.arms, positions
        )
        if step < 0.0:
            status = -1
            break
        cost[done] = work.cost.sum() + work.reduced.const.sum()
        moved[done] = step
        fallen = cost[max(done - 1, 0)] - cost[done]
        flat = done > 0 and fallen <= cost_tolerance * abs(cost[done])
        done += 1
        while mark < len(marks) and marks[mark] == done:
            snapshots[mark] = positions
            mark += 1
        if step <= tolerance or flat:
            status = 1
    snapshots[mark:] = positions
    return status, cost[:done], moved[:done], snapshots


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
    require_rotation([data], positions)
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


def calibrate_bcd(
    model: ArrayModel,
    specific_force,
    angular_rate,
    start=None,
    saturated=None,
    tolerance: float = 1e-10,
    cost_tolerance: float = 0.0,
    limit: int = 5000,
    marks=(),
) -> Calibration:
    """Positions by ML-BCD for the papers' model with isotropic triads.

    Parameters
    ----------
    start : (A, 3) m or None for the nominal positions
    tolerance : float, m
        Stop when no position moved by more in one iteration.
    cost_tolerance : float
        ... or when the cost fell by less than this, relatively.
    limit : int
        Largest number of iterations; ``converged`` says whether it was hit.
    marks : sequence of int
        Iterations after which positions are kept in ``snapshots``.

    Raises
    ------
    IdentifiabilityError
        Fewer than 2 samples, fewer than 3 or collinear triads, or omega and omega_dot
        along one axis throughout (Lemma 1).
    InputError
        For effects, which `imuarray.calibrate` takes, and for noise that is not one sd for each
        accelerometer triad.
    """
    data, positions = arranged(model, specific_force, angular_rate, start, saturated)
    marks = np.asarray(sorted(marks), np.int64)
    status, *path = block_descent(
        data.arrays, positions, float(tolerance), float(cost_tolerance), limit, marks
    )
    explain(status)
    require_rotation([data], positions)  # again: the start's errors no longer blur the motion
    motion = motion_from(data, positions)
    cost, step, snapshots = path
    return Calibration(positions, motion, cost, step, status == 1, snapshots)


def require_rotation(parts: Iterable[Collapsed], positions) -> None:
    """Raise IdentifiabilityError where omega and omega_dot stay on one axis throughout.

    Every A_n = Omega(omega)^2 + Omega(omega_dot) is then blind along that axis (Lemma 1).
    The same where there is no angular rate: omega_dot alone leaves the scale free. Noise
    and the start's wrong positions would hide this from a plain rank test, so the motion
    off the common axis is compared with what they can feign: 5 sigma of noise, and a tenth
    of the centrifugal and Euler terms (positions wrong by a tenth of the array). ``parts``: the
    samples, which are gone through twice.
    """
    sums = [(one.samples, one.mean @ one.mean.T, _informed(one)) for one in parts]
    samples, gram = sum(one[0] for one in sums), sum(one[1] for one in sums)
    values, axes = np.linalg.eigh(gram / samples)
    spread = np.sqrt(np.maximum(values[::-1], 0.0))
    informed = np.array([one[2] for one in sums if one[2] > 0.0])
    if not informed.size:
        raise IdentifiabilityError(
            "gyroscopes: expected readings off their rails, found all of them at a rail throughout:"
            " the array's scale is then undetermined"
        )
    noise = np.sqrt(1.0 / np.median(informed))
    if spread[0] <= 5 * noise:
        raise IdentifiabilityError(
            "motion: expected rotation, found no angular rate above the gyroscopes' noise: the"
            " array's scale is then undetermined"
        )
    if spread[1] > max(1e-3 * spread[0], 5 * noise):
        return
    whole = along = fast = 0.0
    for one in parts:
        turn = motion_from(one, positions).motion.angular_acceleration
        whole, along = whole + np.sum(turn**2), along + np.sum((turn @ axes[:, 2]) ** 2)
        fast += np.sum(one.mean**2)
        inverse = one.reduce(positions)[0].inverse
    across, along, fast = np.sqrt((whole - along) / samples), along / samples, fast / samples
    if across <= max(
        0.1 * np.hypot(np.sqrt(along), fast), 5 * np.sqrt(2 * np.max(np.diag(inverse)[:3]))
    ):
        explain(-1)


def _informed(data: Collapsed) -> float:
    """Median information of an axis' rate where there is any, 0 where there is none."""
    informed = data.gyroscope_information[[0, 1, 2], [0, 1, 2]]
    return float(np.median(informed[informed > 0.0])) if np.any(informed > 0.0) else 0.0
