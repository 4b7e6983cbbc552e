"""ML-BCD: positions and motion by block coordinate descent (2017, Algorithm 1)."""

import numpy as np

from imuarray.model import ArrayModel
from imuarray_papers.compiled import njit
from imuarray_papers.estimation import kernels
from imuarray_papers.estimation.collapsed import motion_from
from imuarray_papers.estimation.identifiability import (
    Calibration,
    arranged,
    explain,
    require_rotation,
)
from imuarray_papers.estimation.rates import most_likely, workspace


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
def block_descent(data, positions, tolerance, limit, marks):
    """Algorithm 1 on a `Collapsed` recording; ``positions`` (A, 3) is start and result.

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
        flat = done > 0 and fallen <= 0.0
        done += 1
        while mark < len(marks) and marks[mark] == done:
            snapshots[mark] = positions
            mark += 1
        if step <= tolerance or flat:
            status = 1
    snapshots[mark:] = positions
    return status, cost[:done], moved[:done], snapshots


def calibrate_bcd(
    model: ArrayModel, specific_force, angular_rate, start=None, saturated=None,
    tolerance: float = 1e-10, limit: int = 5000, marks=(),
) -> Calibration:  # fmt: skip
    """Positions by ML-BCD for the papers' model with isotropic triads.

    Parameters
    ----------
    start : (A, 3) m or None for the nominal positions
    tolerance : float, m
        Stop when no position moved by more in one iteration, or when the cost no longer fell.
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
    status, *path = block_descent(data, positions, float(tolerance), limit, marks)
    explain(status)
    require_rotation(data, positions)  # again: the start's errors no longer blur the motion
    motion = motion_from(data, positions)
    cost, step, snapshots = path
    return Calibration(positions, motion, cost, step, status == 1, snapshots)
