"""Compiled kernels of the collapsed problem, shared by ML and the likelihood.

Notation: for positions r the stacked accelerometers are G(r) (w, phi) with the 12
columns of `imuarray.model.structure`; K = G' Lambda G (12, 12); eliminating phi leaves
C = B' S B (6, 6) and b_t = B' S y_t (6), so the quadratic form of (26a) is
const_t - 2 b_t . w + w' C w. Time is the last, contiguous axis everywhere.
"""

from typing import NamedTuple

import numpy as np

from imuarray_papers.compiled import njit

# For sums over samples only: the compiler may then add in vectors. Elsewhere the order as written,
# or results would depend on whether a kernel was compiled or came from the cache.
FAST = {"reassoc", "contract", "nsz"}


@njit(fastmath=FAST)
def arrange(force, weights, centred, offset, energy, total):
    """force (T, A, 3) with time last and each sample's mean over triads taken out.

    Fills centred (A, 3, T), offset (3, T) that mean, energy (T,) = sum_k lambda_k |y_k|^2 and
    total (3, T) = sum_k lambda_k y_k.
    """
    samples, accelerometers, _ = force.shape
    for t in range(samples):
        x = y = z = 0.0
        for k in range(accelerometers):
            x += force[t, k, 0]
            y += force[t, k, 1]
            z += force[t, k, 2]
        x, y, z = x / accelerometers, y / accelerometers, z / accelerometers
        square = total_x = total_y = total_z = 0.0
        for k in range(accelerometers):
            a, b, c = force[t, k, 0] - x, force[t, k, 1] - y, force[t, k, 2] - z
            centred[k, 0, t], centred[k, 1, t], centred[k, 2, t] = a, b, c
            total_x += weights[k] * a
            total_y += weights[k] * b
            total_z += weights[k] * c
            square += weights[k] * (a * a + b * b + c * c)
        offset[0, t], offset[1, t], offset[2, t] = x, y, z
        total[0, t], total[1, t], total[2, t] = total_x, total_y, total_z
        energy[t] = square


@njit(inline="always")
def _row(matrix, a):
    """A row of six as a tuple: unpacking an array would make one of it first."""
    return matrix[a, 0], matrix[a, 1], matrix[a, 2], matrix[a, 3], matrix[a, 4], matrix[a, 5]


@njit(inline="always")
def _six(x, h0, h1, h2, h3, h4, h5):
    """The sum of six products."""
    a, b, c, d, e, f = x
    return (a * h0 + b * h1 + c * h2) + (d * h3 + e * h4 + f * h5)


@njit
def weighted_moments(positions, z, moments):
    """moments[i] = sum_k r_ki z_k for i = 1..3; (4, 3, T) from z (A, 3, T). Row 0 is kept.

    Four triads at a time: each sum is then loaded and stored a quarter as often.
    """
    accelerometers, _, samples = z.shape
    moments[1:] = 0.0
    fours = accelerometers - accelerometers % 4
    for k in range(0, fours, 4):
        (x0, y0, h0), (x1, y1, h1) = positions[k], positions[k + 1]
        (x2, y2, h2), (x3, y3, h3) = positions[k + 2], positions[k + 3]
        for c in range(3):
            for t in range(samples):
                z0, z1, z2, z3 = z[k, c, t], z[k + 1, c, t], z[k + 2, c, t], z[k + 3, c, t]
                moments[1, c, t] += x0 * z0 + x1 * z1 + x2 * z2 + x3 * z3
                moments[2, c, t] += y0 * z0 + y1 * z1 + y2 * z2 + y3 * z3
                moments[3, c, t] += h0 * z0 + h1 * z1 + h2 * z2 + h3 * z3
    for k in range(fours, accelerometers):
        x, y, h = positions[k]
        for c in range(3):
            for t in range(samples):
                value = z[k, c, t]
                moments[1, c, t] += x * value
                moments[2, c, t] += y * value
                moments[3, c, t] += h * value


@njit
def _second_moments(positions, weights):
    """sum_k lambda_k (1, r_k) (1, r_k)', (4, 4)."""
    total = x1 = y1 = z1 = xx = xy = xz = yy = yz = zz = 0.0
    for k in range(len(positions)):
        x, y, z = positions[k]
        weight = weights[k]
        wx, wy, wz = weight * x, weight * y, weight * z
        total, x1, y1, z1 = total + weight, x1 + wx, y1 + wy, z1 + wz
        xx, xy, xz = xx + wx * x, xy + wx * y, xz + wx * z
        yy, yz, zz = yy + wy * y, yz + wy * z, zz + wz * z
    return np.array(((total, x1, y1, z1), (x1, xx, xy, xz), (y1, xy, yy, yz), (z1, xz, yz, zz)))


@njit
def information(positions, data, out):
    """K = sum_k lambda_k G_k' G_k (12, 12), for isotropic triads with ``data.weights`` (A,).

    Where these are empty G' Lambda G for any ``data.precision`` (3A, 3A), cross-talk included.
    """
    known, out[:] = data.tables, 0.0
    if data.weights.size:
        second, pairs = _second_moments(positions, data.weights), known.pairs
        for p in range(len(pairs)):
            out[pairs[p, 2], pairs[p, 3]] += second[pairs[p, 0], pairs[p, 1]] * known.products[p]
        return
    design = np.empty((3 * len(positions), 12))
    for k in range(len(positions)):
        for c in range(3):
            for a in range(12):
                value = known.tensor[0, c, a]
                for i in range(3):
                    value += positions[k, i] * known.tensor[i + 1, c, a]
                design[3 * k + c, a] = value
    out[:] = design.T @ (data.precision @ design)


@njit
def _factored(K, factor, pivots):
    """Cholesky's factor of Kpp below its diagonal, that one's reciprocals; log |Kpp|, or NaN."""
    logdet = 0.0
    for j in range(6):
        pivot = K[6 + j, 6 + j]
        for m in range(j):
            pivot -= factor[j, m] ** 2
        if not pivot > 1e-14 * K[6 + j, 6 + j]:
            return np.nan
        logdet += np.log(pivot)
        pivots[j] = 1.0 / np.sqrt(pivot)
        for i in range(j + 1, 6):
            value = K[6 + i, 6 + j]
            for m in range(j):
                value -= factor[i, m] * factor[j, m]
            factor[i, j] = value * pivots[j]
    return logdet


@njit
def eliminate(K, C, X, inverse):
    """Schur complement of phi: fills C (6, 6), X = Kpp^-1 Kpw, Kpp^-1; returns log |Kpp|.

    A Cholesky factor by hand: calls into LAPACK would cost more than the 6 x 6 itself.
    """
    factor, pivots, half = np.empty((6, 6)), np.empty(6), np.empty((6, 12))
    logdet = _factored(K, factor, pivots)
    if np.isnan(logdet):
        return logdet
    for i in range(6):  # half = factor^-1 [Kpw, I]
        for col in range(7 + i):
            value = K[6 + i, col] if col < 6 else (1.0 if i == col - 6 else 0.0)
            for m in range(max(0, col - 6), i):
                value -= factor[i, m] * half[m, col]
            half[i, col] = value * pivots[i]
    for a in range(6):
        for b in range(6):
            joint, cross, inv = 0.0, 0.0, 0.0
            for m in range(6):
                joint += half[m, a] * half[m, b]
            for m in range(a, 6):
                cross += half[m, 6 + a] * half[m, b]
            for m in range(max(a, b), 6):
                inv += half[m, 6 + a] * half[m, 6 + b]
            C[a, b] = K[a, b] - joint
            X[a, b] = cross
            inverse[a, b] = inv
    return logdet


@njit
def project(moments, rows, values, full):
    """full = G' Lambda y_t, (12, T), from the moments and the tensor's few entries."""
    full[:] = 0.0
    for e in range(len(values)):
        value, source, target = values[e], moments[rows[e, 0], rows[e, 1]], full[rows[e, 2]]
        for t in range(target.size):
            target[t] += value * source[t]


@njit
def reduce_linear(full, X, inverse, b, phi, const, energy):
    """b = B' S y (6, T), phi = Kpp^-1 H' Lambda y (6, T), const = y' S' y (T,)."""
    const[:] = energy
    for a in range(6):
        across, along = _row(X.T, a), _row(inverse, a)
        for t in range(energy.size):
            h0, h1, h2 = full[6, t], full[7, t], full[8, t]
            h3, h4, h5 = full[9, t], full[10, t], full[11, t]
            b[a, t] = full[a, t] - _six(across, h0, h1, h2, h3, h4, h5)
            phi[a, t] = _six(along, h0, h1, h2, h3, h4, h5)
        for t in range(energy.size):
            const[t] -= phi[a, t] * full[6 + a, t]


class Reduced(NamedTuple):
    """A recording at some positions with phi eliminated, and the memory to get there."""

    K: np.ndarray  # (12, 12)
    C: np.ndarray  # (6, 6)
    X: np.ndarray  # (6, 6)
    inverse: np.ndarray  # (6, 6) Kpp^-1
    b: np.ndarray  # (6, T)
    phi: np.ndarray  # (6, T) the most likely at omega = 0
    const: np.ndarray  # (T,)
    moments: np.ndarray  # (4, 3, T)
    full: np.ndarray  # (12, T)


@njit
def reduced(samples):
    """Memory of a `Reduced` of T = ``samples``."""
    return Reduced(
        np.empty((12, 12)), np.empty((6, 6)), np.empty((6, 6)), np.empty((6, 6)),
        np.empty((6, samples)), np.empty((6, samples)), np.empty(samples),
        np.empty((4, 3, samples)), np.empty((12, samples)),
    )  # fmt: skip


@njit
def reduce(arms, force, data, out):
    """Fill ``out`` from its K on; returns log |H' Lambda H|, NaN (and stops) where singular.

    ``arms`` (A, 3) and ``force`` (A, 3, T) are the positions and Lambda y, or the positions times
    the triads' weights and y; ``data.base`` (3, T) = sum_k (Lambda y)_k, ``data.energy`` (T,) =
    y' Lambda y.
    """
    known, logdet = data.tables, eliminate(out.K, out.C, out.X, out.inverse)
    if np.isnan(logdet):
        return logdet
    out.moments[0] = data.base
    weighted_moments(arms, force, out.moments)
    project(out.moments, known.rows, known.values, out.full)
    reduce_linear(out.full, out.X, out.inverse, out.b, out.phi, out.const, data.energy)
    return logdet


@njit
def collapse(positions, data, out):
    """`reduce` of a `Collapsed` recording at ``positions`` (A, 3), K included."""
    information(positions, data, out.K)
    arms = positions.copy()
    for k in range(data.weights.size):
        for i in range(3):
            arms[k, i] *= data.weights[k]
    return reduce(arms, data.force, data, out)


@njit(inline="always")
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


@njit
def linear_motion(rate, X, phi, state):
    """state (12, T) = (w, phi_hat) with phi_hat = Kpp^-1 H' Lambda y - X w."""
    for t in range(rate.shape[1]):
        x, y, z = rate[0, t], rate[1, t], rate[2, t]
        state[0, t], state[1, t], state[2, t] = x * x, y * y, z * z
        state[3, t], state[4, t], state[5, t] = x * y, x * z, y * z
    for a in range(6):
        across = _row(X, a)
        for t in range(rate.shape[1]):
            w0, w1, w2 = state[0, t], state[1, t], state[2, t]
            w3, w4, w5 = state[3, t], state[4, t], state[5, t]
            state[6 + a, t] = phi[a, t] - _six(across, w0, w1, w2, w3, w4, w5)


@njit
def arms(state, rows, values, out):
    """The predicted force is out[0] + sum_i r_i out[i + 1]: (4, axis, T) from (w, phi) (12, T).

    The last three are Omega_t by the position's axis.
    """
    out[:] = 0.0
    for e in range(len(values)):
        value, source, target = values[e], state[rows[e, 2]], out[rows[e, 0], rows[e, 1]]
        for t in range(target.size):
            target[t] += value * source[t]


@njit(fastmath=FAST)
def arm_products(arms, force, out):
    """out[k, i] += sum over c and t of arms[i + 1, c, t] force[k, c, t], for i = 0 .. 2.

    (A, 3) from arms (4, 3, T) and force (A, 3, T), four triads at a time.
    """
    accelerometers, _, samples = force.shape
    fours = accelerometers - accelerometers % 4
    for k in range(0, fours, 4):
        for c in range(3):
            x0 = x1 = x2 = x3 = y0 = y1 = y2 = y3 = h0 = h1 = h2 = h3 = 0.0
            for t in range(samples):
                x, y, h = arms[1, c, t], arms[2, c, t], arms[3, c, t]
                f0, f1 = force[k, c, t], force[k + 1, c, t]
                f2, f3 = force[k + 2, c, t], force[k + 3, c, t]
                x0, y0, h0 = x0 + x * f0, y0 + y * f0, h0 + h * f0
                x1, y1, h1 = x1 + x * f1, y1 + y * f1, h1 + h * f1
                x2, y2, h2 = x2 + x * f2, y2 + y * f2, h2 + h * f2
                x3, y3, h3 = x3 + x * f3, y3 + y * f3, h3 + h * f3
            for m, (p, q, r) in enumerate(((x0, y0, h0), (x1, y1, h1), (x2, y2, h2), (x3, y3, h3))):
                out[k + m, 0] += p
                out[k + m, 1] += q
                out[k + m, 2] += r
    for k in range(fours, accelerometers):
        for c in range(3):
            x0 = y0 = h0 = 0.0
            for t in range(samples):
                f0 = force[k, c, t]
                x0 += arms[1, c, t] * f0
                y0 += arms[2, c, t] * f0
                h0 += arms[3, c, t] * f0
            out[k, 0] += x0
            out[k, 1] += y0
            out[k, 2] += h0
