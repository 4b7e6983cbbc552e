"""Compiled kernels of the collapsed problem, shared by ML and the likelihood.

Notation: for positions r the stacked accelerometers are G(r) (w, phi) with the 12
columns of `imuarray.model.structure`; K = G' Lambda G (12, 12); eliminating phi leaves
C = B' S B (6, 6) and b_t = B' S y_t (6), so the quadratic form of (26a) is
const_t - 2 b_t . w + w' C w. Time is the last, contiguous axis everywhere.
"""

import numba as nb
import numpy as np

FAST = {"reassoc", "contract", "nsz"}


@nb.njit(cache=True, nogil=True, fastmath=FAST)
def weighted_moments(positions, z, moments):
    """moments[i] = sum_k r_ki z_k for i = 1..3; (4, 3, T) from z (A, 3, T). Row 0 is kept."""
    accelerometers, _, samples = z.shape
    moments[1:] = 0.0
    for k in range(accelerometers):
        x, y, h = positions[k]
        for c in range(3):
            for t in range(samples):
                value = z[k, c, t]
                moments[1, c, t] += x * value
                moments[2, c, t] += y * value
                moments[3, c, t] += h * value


@nb.njit(cache=True, nogil=True)
def information(positions, weights, pairs, values, out):
    """K = sum_k lambda_k G_k' G_k (12, 12) for isotropic triads with weights (A,).

    ``pairs`` (P, 4) and ``values`` (P,) are the non-zero terms (i, j, a, b) of G_i' G_j.
    """
    second = np.zeros((4, 4))
    row = np.empty(4)
    row[0] = 1.0
    for k in range(len(positions)):
        row[1:] = positions[k]
        for i in range(4):
            for j in range(i + 1):
                second[i, j] += weights[k] * row[i] * row[j]
    for i in range(4):
        for j in range(i):
            second[j, i] = second[i, j]
    out[:] = 0.0
    for p in range(len(values)):
        i, j, a, b = pairs[p]
        out[a, b] += second[i, j] * values[p]


@nb.njit(cache=True, nogil=True)
def information_general(positions, precision, tensor, out):
    """K = G' Lambda G for any precision (3A, 3A), cross-talk included."""
    count = len(positions)
    design = np.empty((3 * count, 12))
    for k in range(count):
        for c in range(3):
            for a in range(12):
                value = tensor[0, c, a]
                for i in range(3):
                    value += positions[k, i] * tensor[i + 1, c, a]
                design[3 * k + c, a] = value
    out[:] = design.T @ (precision @ design)


@nb.njit(cache=True, nogil=True)
def eliminate(K, C, X, inverse):
    """Schur complement of phi: fills C (6, 6), X = Kpp^-1 Kpw, Kpp^-1; returns log |Kpp|.

    A Cholesky factor by hand: calls into LAPACK would cost more than the 6 x 6 itself.
    """
    factor = np.zeros((6, 6))
    logdet = 0.0
    for j in range(6):
        pivot = K[6 + j, 6 + j]
        for m in range(j):
            pivot -= factor[j, m] ** 2
        if not pivot > 1e-14 * K[6 + j, 6 + j]:
            return np.nan
        factor[j, j] = np.sqrt(pivot)
        logdet += 2.0 * np.log(factor[j, j])
        for i in range(j + 1, 6):
            value = K[6 + i, 6 + j]
            for m in range(j):
                value -= factor[i, m] * factor[j, m]
            factor[i, j] = value / factor[j, j]
    half = np.empty((6, 12))  # factor^-1 [Kpw, I]
    for col in range(12):
        for i in range(6):
            value = K[6 + i, col] if col < 6 else (1.0 if i == col - 6 else 0.0)
            for m in range(i):
                value -= factor[i, m] * half[m, col]
            half[i, col] = value / factor[i, i]
    for a in range(6):
        for b in range(6):
            joint, cross, inv = 0.0, 0.0, 0.0
            for m in range(6):
                joint += half[m, a] * half[m, b]
                cross += half[m, 6 + a] * half[m, b]
                inv += half[m, 6 + a] * half[m, 6 + b]
            C[a, b] = K[a, b] - joint
            X[a, b] = cross
            inverse[a, b] = inv
    return logdet


@nb.njit(cache=True, nogil=True, fastmath=FAST)
def project(moments, rows, values, full):
    """full = G' Lambda y_t, (12, T), from the moments and the tensor's few entries."""
    full[:] = 0.0
    for e in range(len(values)):
        i, c, a = rows[e]
        value = values[e]
        for t in range(full.shape[1]):
            full[a, t] += value * moments[i, c, t]


@nb.njit(cache=True, nogil=True, fastmath=FAST)
def reduce_linear(full, X, inverse, b, phi, const, energy):
    """b = B' S y (6, T), phi = Kpp^-1 H' Lambda y (6, T), const = y' S' y (T,)."""
    samples = full.shape[1]
    const[:] = energy
    for a in range(6):
        b[a] = full[a]
        phi[a] = 0.0
        for m in range(6):
            x, inv = X[m, a], inverse[a, m]
            for t in range(samples):
                b[a, t] -= x * full[6 + m, t]
                phi[a, t] += inv * full[6 + m, t]
        for t in range(samples):
            const[t] -= phi[a, t] * full[6 + a, t]


@nb.njit(cache=True, nogil=True, inline="always")
def quadratic(x, y, z, C, b0, b1, b2, b3, b4, b5):
    """w' C w - 2 b . w at omega = (x, y, z)."""
    w0, w1, w2, w3, w4, w5 = x * x, y * y, z * z, x * y, x * z, y * z
    q = w0 * (C[0, 0] * w0 - 2.0 * b0)
    q += w1 * (C[1, 1] * w1 + 2.0 * (C[1, 0] * w0 - b1))
    q += w2 * (C[2, 2] * w2 + 2.0 * (C[2, 0] * w0 + C[2, 1] * w1 - b2))
    q += w3 * (C[3, 3] * w3 + 2.0 * (C[3, 0] * w0 + C[3, 1] * w1 + C[3, 2] * w2 - b3))
    q += w4 * (
        C[4, 4] * w4 + 2.0 * (C[4, 0] * w0 + C[4, 1] * w1 + C[4, 2] * w2 + C[4, 3] * w3 - b4)
    )
    q += w5 * (
        C[5, 5] * w5
        + 2.0 * (C[5, 0] * w0 + C[5, 1] * w1 + C[5, 2] * w2 + C[5, 3] * w3 + C[5, 4] * w4 - b5)
    )
    return q


@nb.njit(cache=True, nogil=True, inline="always")
def _gyroscope_cost(x, y, z, m, P):
    dx, dy, dz = x - m[0], y - m[1], z - m[2]
    return (
        P[0, 0] * dx * dx
        + P[1, 1] * dy * dy
        + P[2, 2] * dz * dz
        + 2.0 * (P[0, 1] * dx * dy + P[0, 2] * dx * dz + P[1, 2] * dy * dz)
    )


@nb.njit(cache=True, nogil=True, inline="always")
def _pulled(a, x, y, z, C):
    """Row a of C dw/domega."""
    return (
        2.0 * x * C[a, 0] + y * C[a, 3] + z * C[a, 4],
        2.0 * y * C[a, 1] + x * C[a, 3] + z * C[a, 5],
        2.0 * z * C[a, 2] + x * C[a, 4] + y * C[a, 5],
    )


@nb.njit(cache=True, nogil=True, inline="always")
def rate_information(x, y, z, C, P):
    """(dw/domega)' C dw/domega + P: entries xx, xy, xz, yy, yz, zz."""
    j0, j1, j2 = _pulled(0, x, y, z, C), _pulled(1, x, y, z, C), _pulled(2, x, y, z, C)
    j3, j4, j5 = _pulled(3, x, y, z, C), _pulled(4, x, y, z, C), _pulled(5, x, y, z, C)
    return (
        2.0 * x * j0[0] + y * j3[0] + z * j4[0] + P[0, 0],
        2.0 * x * j0[1] + y * j3[1] + z * j4[1] + P[0, 1],
        2.0 * x * j0[2] + y * j3[2] + z * j4[2] + P[0, 2],
        2.0 * y * j1[1] + x * j3[1] + z * j5[1] + P[1, 1],
        2.0 * y * j1[2] + x * j3[2] + z * j5[2] + P[1, 2],
        2.0 * z * j2[2] + x * j4[2] + y * j5[2] + P[2, 2],
    )


@nb.njit(cache=True, nogil=True, inline="always")
def _excess(a, x, y, z, C, b):
    """Component a of C w - b."""
    value = C[a, 0] * x * x + C[a, 1] * y * y + C[a, 2] * z * z
    return value + C[a, 3] * x * y + C[a, 4] * x * z + C[a, 5] * y * z - b[a]


@nb.njit(cache=True, nogil=True)
def _rate_step(x, y, z, C, b, m, P, damping):
    """One damped Gauss-Newton step in omega for the collapsed cost; returns the step."""
    g0, g1, g2 = _excess(0, x, y, z, C, b), _excess(1, x, y, z, C, b), _excess(2, x, y, z, C, b)
    g3, g4, g5 = _excess(3, x, y, z, C, b), _excess(4, x, y, z, C, b), _excess(5, x, y, z, C, b)
    dx, dy, dz = x - m[0], y - m[1], z - m[2]
    gx = 2.0 * x * g0 + y * g3 + z * g4 + P[0, 0] * dx + P[0, 1] * dy + P[0, 2] * dz
    gy = 2.0 * y * g1 + x * g3 + z * g5 + P[0, 1] * dx + P[1, 1] * dy + P[1, 2] * dz
    gz = 2.0 * z * g2 + x * g4 + y * g5 + P[0, 2] * dx + P[1, 2] * dy + P[2, 2] * dz
    hxx, hxy, hxz, hyy, hyz, hzz = rate_information(x, y, z, C, P)
    hxx, hyy, hzz = hxx + damping, hyy + damping, hzz + damping
    cxx, cxy, cxz = hyy * hzz - hyz * hyz, hxz * hyz - hxy * hzz, hxy * hyz - hxz * hyy
    cyy, cyz, czz = hxx * hzz - hxz * hxz, hxy * hxz - hxx * hyz, hxx * hyy - hxy * hxy
    det = hxx * cxx + hxy * cxy + hxz * cxz
    if not det > 0.0:
        return 0.0, 0.0, 0.0, False
    sx = -(cxx * gx + cxy * gy + cxz * gz) / det
    sy = -(cxy * gx + cyy * gy + cyz * gz) / det
    sz = -(cxz * gx + cyz * gy + czz * gz) / det
    return sx, sy, sz, True


@nb.njit(cache=True, nogil=True)
def angular_rates(rate, C, b, mean, P, tolerance, limit, cost, iterations):
    """Concentrated ML of omega_t for every sample by damped Gauss-Newton.

    ``rate`` (3, T) is the start and the result; ``cost`` (T,) gets the collapsed cost
    without its constant; ``iterations`` (T,) the steps taken, negative where the step
    never fell below ``tolerance`` (relative).
    """
    bt, m, p = np.empty(6), np.empty(3), np.empty((3, 3))
    for t in range(rate.shape[1]):
        for a in range(6):
            bt[a] = b[a, t]
        for a in range(3):
            m[a] = mean[a, t]
            for c in range(3):
                p[a, c] = P[a, c, t]
        x, y, z = rate[0, t], rate[1, t], rate[2, t]
        now = quadratic(x, y, z, C, bt[0], bt[1], bt[2], bt[3], bt[4], bt[5])
        now += _gyroscope_cost(x, y, z, m, p)
        damping, done = 0.0, -limit
        for step in range(1, limit + 1):
            dx, dy, dz, regular = _rate_step(x, y, z, C, bt, m, p, damping)
            if regular:
                nx, ny, nz = x + dx, y + dy, z + dz
                new = quadratic(nx, ny, nz, C, bt[0], bt[1], bt[2], bt[3], bt[4], bt[5])
                new += _gyroscope_cost(nx, ny, nz, m, p)
                small = abs(dx) + abs(dy) + abs(dz) <= tolerance * (
                    1.0 + abs(nx) + abs(ny) + abs(nz)
                )
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


@nb.njit(cache=True, nogil=True, fastmath=FAST)
def linear_motion(rate, X, phi, state):
    """state (12, T) = (w, phi_hat) with phi_hat = Kpp^-1 H' Lambda y - X w."""
    for t in range(rate.shape[1]):
        x, y, z = rate[0, t], rate[1, t], rate[2, t]
        state[0, t], state[1, t], state[2, t] = x * x, y * y, z * z
        state[3, t], state[4, t], state[5, t] = x * y, x * z, y * z
    for a in range(6):
        state[6 + a] = phi[a]
        for m in range(6):
            scale = X[a, m]
            for t in range(rate.shape[1]):
                state[6 + a, t] -= scale * state[m, t]
