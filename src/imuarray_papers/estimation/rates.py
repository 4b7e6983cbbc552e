"""Each sample's most likely omega given positions: the quartic of (26a), concentrated (2017, (5)).

The cost of a sample is w' C w - 2 b . w + (omega - m)' P (omega - m), w the products of omega's
components. C is the same at each sample: a step of all samples is one loop without branches,
which compilers turn into vector instructions; the few samples that want more go one by one.
"""

from typing import NamedTuple

import numpy as np

from imuarray_papers.compiled import njit
from imuarray_papers.estimation.kernels import Reduced, collapse, linear_motion, quadratic, reduced

TOGETHER = 4  # steps of all samples at once, before what is left goes one by one


@njit(inline="always")
def lower(C):
    """The lower triangle of C (6, 6), row by row."""
    return (
        C[0, 0],
        C[1, 0], C[1, 1],
        C[2, 0], C[2, 1], C[2, 2],
        C[3, 0], C[3, 1], C[3, 2], C[3, 3],
        C[4, 0], C[4, 1], C[4, 2], C[4, 3], C[4, 4],
        C[5, 0], C[5, 1], C[5, 2], C[5, 3], C[5, 4], C[5, 5],
    )  # fmt: skip


@njit(inline="always")
def precision_at(P, t):
    """Entries xx, xy, xz, yy, yz, zz of sample t's (3, 3) of P (3, 3, T)."""
    return P[0, 0, t], P[0, 1, t], P[0, 2, t], P[1, 1, t], P[1, 2, t], P[2, 2, t]


@njit(inline="always")
def rate_information(x, y, z, c, p):
    """(dw/domega)' C dw/domega + P: entries xx, xy, xz, yy, yz, zz; ``c`` is `lower` of C."""
    (c00, c10, c11, c20, c21, c22, c30, c31, c32, c33, c40, c41, c42, c43, c44,
     c50, c51, c52, c53, c54, c55) = c  # fmt: skip
    u, v, w = 2.0 * x, 2.0 * y, 2.0 * z
    # C times dw/domega_x at rows 0 to 5, dw/domega_y at 1 to 5, dw/domega_z at 2, 4, 5
    x0, x1 = u * c00 + y * c30 + z * c40, u * c10 + y * c31 + z * c41
    x2, x3 = u * c20 + y * c32 + z * c42, u * c30 + y * c33 + z * c43
    x4, x5 = u * c40 + y * c43 + z * c44, u * c50 + y * c53 + z * c54
    y1, y2 = v * c11 + x * c31 + z * c51, v * c21 + x * c32 + z * c52
    y3, y4, y5 = (
        v * c31 + x * c33 + z * c53, v * c41 + x * c43 + z * c54, v * c51 + x * c53 + z * c55
    )  # fmt: skip
    z2, z4, z5 = (
        w * c22 + x * c42 + y * c52, w * c42 + x * c44 + y * c54, w * c52 + x * c54 + y * c55
    )  # fmt: skip
    return (
        u * x0 + y * x3 + z * x4 + p[0], v * x1 + x * x3 + z * x5 + p[1],
        w * x2 + x * x4 + y * x5 + p[2], v * y1 + x * y3 + z * y5 + p[3],
        w * y2 + x * y4 + y * y5 + p[4], w * z2 + x * z4 + y * z5 + p[5],
    )  # fmt: skip


@njit(inline="always")
def _gradient(x, y, z, c, b, dx, dy, dz, p):
    """Half the cost's gradient by omega."""
    (c00, c10, c11, c20, c21, c22, c30, c31, c32, c33, c40, c41, c42, c43, c44,
     c50, c51, c52, c53, c54, c55) = c  # fmt: skip
    w0, w1, w2, w3, w4, w5 = x * x, y * y, z * z, x * y, x * z, y * z
    g0 = c00 * w0 + c10 * w1 + c20 * w2 + c30 * w3 + c40 * w4 + c50 * w5 - b[0]
    g1 = c10 * w0 + c11 * w1 + c21 * w2 + c31 * w3 + c41 * w4 + c51 * w5 - b[1]
    g2 = c20 * w0 + c21 * w1 + c22 * w2 + c32 * w3 + c42 * w4 + c52 * w5 - b[2]
    g3 = c30 * w0 + c31 * w1 + c32 * w2 + c33 * w3 + c43 * w4 + c53 * w5 - b[3]
    g4 = c40 * w0 + c41 * w1 + c42 * w2 + c43 * w3 + c44 * w4 + c54 * w5 - b[4]
    g5 = c50 * w0 + c51 * w1 + c52 * w2 + c53 * w3 + c54 * w4 + c55 * w5 - b[5]
    return (
        2.0 * x * g0 + y * g3 + z * g4 + p[0] * dx + p[1] * dy + p[2] * dz,
        2.0 * y * g1 + x * g3 + z * g5 + p[1] * dx + p[3] * dy + p[4] * dz,
        2.0 * z * g2 + x * g4 + y * g5 + p[2] * dx + p[4] * dy + p[5] * dz,
    )


@njit(inline="always")
def _step(x, y, z, c, b, dx, dy, dz, p, damping):
    """(a damped Gauss-Newton step in omega (3), the determinant of what it solved)."""
    gx, gy, gz = _gradient(x, y, z, c, b, dx, dy, dz, p)
    hxx, hxy, hxz, hyy, hyz, hzz = rate_information(x, y, z, c, p)
    hxx, hyy, hzz = hxx + damping, hyy + damping, hzz + damping
    cxx, cxy, cxz = hyy * hzz - hyz * hyz, hxz * hyz - hxy * hzz, hxy * hyz - hxz * hyy
    cyy, cyz, czz = hxx * hzz - hxz * hxz, hxy * hxz - hxx * hyz, hxx * hyy - hxy * hxy
    determinant = hxx * cxx + hxy * cxy + hxz * cxz
    scale = -1.0 / determinant
    return (
        scale * (cxx * gx + cxy * gy + cxz * gz), scale * (cxy * gx + cyy * gy + cyz * gz),
        scale * (cxz * gx + cyz * gy + czz * gz), determinant,
    )  # fmt: skip


@njit(inline="always")
def _cost(x, y, z, C, b, dx, dy, dz, p):
    gyroscopes = p[0] * dx * dx + p[3] * dy * dy + p[5] * dz * dz
    gyroscopes += 2.0 * (p[1] * dx * dy + p[2] * dx * dz + p[4] * dy * dz)
    return quadratic(x, y, z, C, b[0], b[1], b[2], b[3], b[4], b[5]) + gyroscopes


@njit(error_model="numpy")
def _costs(rate, C, b, mean, P, cost):
    """cost (T,) of the rates (3, T)."""
    for t in range(rate.shape[1]):
        x, y, z = rate[0, t], rate[1, t], rate[2, t]
        bt = b[0, t], b[1, t], b[2, t], b[3, t], b[4, t], b[5, t]
        dx, dy, dz = x - mean[0, t], y - mean[1, t], z - mean[2, t]
        cost[t] = _cost(x, y, z, C, bt, dx, dy, dz, precision_at(P, t))


@njit(error_model="numpy")
def _steps(rate, C, b, mean, P, trial, determinant):
    """An undamped step of every sample: where it leads, trial (3, T); no branch in the loop."""
    c = lower(C)
    for t in range(rate.shape[1]):
        x, y, z = rate[0, t], rate[1, t], rate[2, t]
        bt = b[0, t], b[1, t], b[2, t], b[3, t], b[4, t], b[5, t]
        dx, dy, dz = x - mean[0, t], y - mean[1, t], z - mean[2, t]
        sx, sy, sz, determinant[t] = _step(x, y, z, c, bt, dx, dy, dz, precision_at(P, t), 0.0)
        trial[0, t], trial[1, t], trial[2, t] = x + sx, y + sy, z + sz


@njit
def _accept(rate, trial, cost, new, determinant, tolerance, step, iterations):
    """Take the steps that are small or lower the cost; returns how many samples go on so.

    ``iterations`` is 0 where a search goes on so, its number of steps where it has ended, and less
    that of the first step to be refused where it is to go on by itself.
    """
    left = 0
    for t in range(rate.shape[1]):
        if iterations[t] != 0:
            continue
        moved = abs(trial[0, t] - rate[0, t]) + abs(trial[1, t] - rate[1, t])
        moved += abs(trial[2, t] - rate[2, t])
        size = 1.0 + abs(trial[0, t]) + abs(trial[1, t]) + abs(trial[2, t])
        small = moved <= tolerance * size and size < np.inf
        if determinant[t] > 0.0 and (small or new[t] <= cost[t]):
            rate[0, t], rate[1, t], rate[2, t] = trial[0, t], trial[1, t], trial[2, t]
            cost[t] = new[t]
            if small:
                iterations[t] = step
            else:
                left += 1
        else:
            iterations[t] = -step
    return left


@njit(error_model="numpy")
def _alone(t, rate, C, b, mean, P, tolerance, first, limit, cost, iterations):
    """Steps ``first`` ... ``limit`` of sample t, damped where one would raise the cost."""
    x, y, z, now = rate[0, t], rate[1, t], rate[2, t], cost[t]
    c, p = lower(C), precision_at(P, t)
    bt = b[0, t], b[1, t], b[2, t], b[3, t], b[4, t], b[5, t]
    mx, my, mz = mean[0, t], mean[1, t], mean[2, t]
    damping, done = 0.0, -limit
    for step in range(first, limit + 1):
        sx, sy, sz, determinant = _step(x, y, z, c, bt, x - mx, y - my, z - mz, p, damping)
        if determinant > 0.0:
            nx, ny, nz = x + sx, y + sy, z + sz
            new = _cost(nx, ny, nz, C, bt, nx - mx, ny - my, nz - mz, p)
            size = 1.0 + abs(nx) + abs(ny) + abs(nz)
            small = abs(sx) + abs(sy) + abs(sz) <= tolerance * size and size < np.inf
            if small or new <= now:
                x, y, z, now = nx, ny, nz, new
                damping *= 0.1
                if small:
                    done = step
                    break
                continue
        damping = max(10.0 * damping, 1e-3 * (C[0, 0] * (x * x + y * y + z * z) + 1e-12))
    rate[0, t], rate[1, t], rate[2, t] = x, y, z
    cost[t], iterations[t] = now, done


@njit
def angular_rates(rate, C, b, mean, P, tolerance, limit, cost, iterations):
    """Concentrated ML of omega_t for every sample by damped Gauss-Newton.

    ``rate`` (3, T) is the start and the result; ``cost`` (T,) gets the collapsed cost
    without its constant; ``iterations`` (T,) the steps taken, negative where the step
    never fell below ``tolerance`` (relative).
    """
    trial, new, determinant = np.empty_like(rate), np.empty_like(cost), np.empty_like(cost)
    iterations[:] = 0
    _costs(rate, C, b, mean, P, cost)
    first, left = 1, cost.size
    while left and first <= min(TOGETHER, limit):
        _steps(rate, C, b, mean, P, trial, determinant)
        _costs(trial, C, b, mean, P, new)
        left = _accept(rate, trial, cost, new, determinant, tolerance, first, iterations)
        first += 1
    for t in range(cost.size):
        if iterations[t] <= 0:
            start = first if iterations[t] == 0 else -iterations[t]
            _alone(t, rate, C, b, mean, P, tolerance, start, limit, cost, iterations)


class Work(NamedTuple):
    """Arrays that `most_likely` fills, ``arms`` excepted: the motion, and what led to it."""

    reduced: Reduced
    cost: np.ndarray  # (T,) of omega, without the reduction's const
    counts: np.ndarray  # (T,) steps, negative where the search did not end
    state: np.ndarray  # (w, phi) (12, T)
    arms: np.ndarray  # (4, 3, T), filled by who called: `kernels.arms` of the state


@njit
def workspace(samples):
    """`Work` for T = ``samples``."""
    return Work(
        reduced(samples), np.empty(samples), np.empty(samples, np.int64), np.empty((12, samples)),
        np.empty((4, 3, samples)),
    )  # fmt: skip


@njit
def most_likely(data, positions, rate, tolerance, limit, work):
    """The most likely motion at ``positions`` (A, 3) of a `Collapsed` recording.

    The search for omega starts at ``rate`` (3, T). Fills ``rate`` and ``work``; returns
    log |H' Lambda H|, NaN where that is singular.
    """
    found = work.reduced
    logdet = collapse(positions, data, found)
    if np.isnan(logdet):
        return logdet
    angular_rates(
        rate, found.C, found.b, data.mean, data.rate_information, tolerance, limit, work.cost,
        work.counts,
    )  # fmt: skip
    linear_motion(rate, found.X, found.phi, work.state)
    return logdet
