"""The positions' score and Fisher information with the motion eliminated, in collapsed form.

For the papers' model with isotropic triads. A residual's derivative by r_k is Omega_t =
Omega(omega)^2 + Omega(omega_dot), the same at each triad; its derivatives by the motion are affine
in (1, r_k). So the information is Lambda (x) sum_t Omega_t' Omega_t less a matrix of rank 12, that
of what the motion takes up: sums over samples of 12 x 12, however many triads there are.
"""

import numpy as np

from imuarray.model import ArrayModel
from imuarray.model.structure import products
from imuarray_papers.compiled import njit
from imuarray_papers.estimation import kernels
from imuarray_papers.estimation.collapsed import Collapsed, tables
from imuarray_papers.estimation.rates import lower, precision_at, rate_information

TILE = 128  # samples at a time


def arms(state) -> np.ndarray:
    """`kernels.arms` of (w, phi) (12, T): (4, axis, T)."""
    out = np.empty((4, 3, state.shape[1]))
    kernels.arms(state, tables().rows, tables().values, out)
    return out


@njit
def slope(positions, data, state, made):
    """Half the cost's fall per metre of each position, (A, 3), at the motion ``state`` (12, T).

    At the most likely motion this is the score of the profile likelihood. Fills ``made``
    (4, 3, T), the state's `arms`.
    """
    kernels.arms(state, data.tables.rows, data.tables.values, made)
    right, square = np.zeros(positions.shape), np.zeros((4, 3))
    kernels.arm_products(made, data.force, right)
    kernels.arm_products(made, made, square)
    for k in range(len(positions)):
        for i in range(3):
            right[k, i] -= square[0, i]
            for j in range(3):
                right[k, i] -= positions[k, j] * square[1 + j, i]
            right[k, i] *= data.weights[k]
    return right


@njit(error_model="numpy")
def _whitened(rate, C, P, first, size, Z):
    """Z = dw/domega F'^-1 (6, 3, TILE) of ``size`` samples, F F' the information of omega_t.

    A tile's own memory tells the compiler that nothing overlaps: vectors, no branch in the loop.
    """
    c = lower(C)
    for i in range(size):
        t = np.uint64(first + i)  # a signed one would be looked up number by number
        x, y, z = rate[0, t], rate[1, t], rate[2, t]
        xx, xy, xz, yy, yz, zz = rate_information(x, y, z, c, precision_at(P, t))
        ix = 1.0 / np.sqrt(xx)
        fyx, fzx = xy * ix, xz * ix
        iy = 1.0 / np.sqrt(yy - fyx * fyx)
        fzy = (yz - fzx * fyx) * iy
        iz = 1.0 / np.sqrt(zz - fzx * fzx - fzy * fzy)
        # rows: of w_x^2, w_y^2, w_z^2, w_x w_y, w_x w_z, w_y w_z
        a0, b1, c2 = 2.0 * x * ix, 2.0 * y * iy, 2.0 * z * iz
        a1 = -fyx * a0 * iy
        d0, e0, f1 = y * ix, z * ix, z * iy
        d1, e1 = (x - fyx * d0) * iy, -fyx * e0 * iy
        Z[0, 0, i], Z[0, 1, i], Z[0, 2, i] = a0, a1, (-fzx * a0 - fzy * a1) * iz
        Z[1, 1, i], Z[1, 2, i] = b1, -fzy * b1 * iz
        Z[2, 2, i] = c2
        Z[3, 0, i], Z[3, 1, i], Z[3, 2, i] = d0, d1, (-fzx * d0 - fzy * d1) * iz
        Z[4, 0, i], Z[4, 1, i], Z[4, 2, i] = e0, e1, (x - fzx * e0 - fzy * e1) * iz
        Z[5, 1, i], Z[5, 2, i] = f1, (y - fzy * f1) * iz


@njit
def _rate_gram(rate, C, P, entries, left):
    """sum_t U_t U_t' (12, 12), U_t = (Omega_t left_m dw/domega F'^-1) for m = 0 .. 3, (12, 3).

    ``entries`` (3, 3, T) are Omega_t by the position's and the force's axis; ``left`` (4, 3, 6).
    """
    Z, V, U = np.zeros((6, 3, TILE)), np.empty((3, 3, TILE)), np.zeros((12, 3, TILE))
    found = np.zeros((12, 12))
    for first in range(0, rate.shape[1], TILE):
        size = min(TILE, rate.shape[1] - first)
        if size < TILE:
            U[:] = 0.0
        _whitened(rate, C, P, first, size, Z)
        for m in range(4):
            for c in range(3):
                q0, q1, q2, q3, q4, q5 = left[m, c]
                for r in range(3):
                    for i in range(TILE):
                        total = q0 * Z[0, r, i] + q1 * Z[1, r, i] + q2 * Z[2, r, i]
                        V[c, r, i] = total + q3 * Z[3, r, i] + q4 * Z[4, r, i] + q5 * Z[5, r, i]
            for j in range(3):
                for r in range(3):
                    for i in range(size):
                        t = np.uint64(first + i)  # as above
                        total = entries[j, 0, t] * V[0, r, i]
                        total += entries[j, 1, t] * V[1, r, i]
                        U[3 * m + j, r, i] = total + entries[j, 2, t] * V[2, r, i]
        flat = U.reshape(12, 3 * TILE)
        found += flat @ flat.T
    return found


@njit
def _assemble(positions, weights, square, absorbed, out):
    """diag(weights) (x) square less U taken U', row k of U weights[k] (1, r_k) (x) I; k > 1."""
    row = np.empty((3, 12))
    for k in range(1, len(positions)):
        (x, y, z), weight = positions[k], weights[k]
        row[:] = absorbed[:3] + x * absorbed[3:6] + y * absorbed[6:9] + z * absorbed[9:]
        for m in range(1, k + 1):
            (x, y, z), both = positions[m], weight * weights[m]
            for i in range(3):
                for j in range(3):
                    value = row[i, j] + x * row[i, 3 + j] + y * row[i, 6 + j] + z * row[i, 9 + j]
                    a, b = 3 * k - 3 + i, 3 * m - 3 + j
                    out[a, b] = out[b, a] = -both * value
        for i in range(3):
            for j in range(3):
                out[3 * k - 3 + i, 3 * k - 3 + j] += weight * square[i, j]


@njit
def _moments(entries, linear, inverse, square, absorbed):
    """Fills square (3, 3) = sum_t Omega_t Omega_t', and taken (12, 12) by omega_dot and s.

    ``entries`` (3, 3, T) are Omega_t, ``linear`` (12, 6) = G_phi, by the arm and axis.
    """
    flat = entries.reshape(9, entries.shape[2])
    products = flat @ flat.T
    seen = linear @ inverse @ linear.T
    for i in range(3):
        for j in range(3):
            square[i, j] = 0.0
            for c in range(3):
                square[i, j] += products[3 * i + c, 3 * j + c]
            for m in range(4):
                for n in range(4):
                    total = 0.0
                    for c in range(3):
                        for d in range(3):
                            total += seen[3 * m + c, 3 * n + d] * products[3 * i + c, 3 * j + d]
                    absorbed[3 * m + i, 3 * n + j] = total


@njit
def fisher(positions, data, rate, made, found):
    """Fisher information (3 (A - 1), 3 (A - 1)) of r_2 ... r_A, 1 / m^2, the motion unknown.

    ``rate`` (3, T) and ``made`` (4, 3, T), its `arms`, are the motion, ``found`` the data's
    `kernels.Reduced` at ``positions`` (A, 3). Its inverse is the Cramer-Rao bound of the positions.
    """
    square, absorbed, known, entries = np.empty((3, 3)), np.empty((12, 12)), data.tables, made[1:]
    # what omega_dot and s take up, then what omega does
    _moments(entries, known.linear, found.inverse, square, absorbed)
    left = (known.square - known.linear @ found.X).reshape(4, 3, 6)
    absorbed += _rate_gram(rate, found.C, data.rate_information, entries, left)
    size = 3 * len(positions) - 3
    out = np.empty((size, size))
    _assemble(positions, data.weights, square, absorbed, out)
    return out


def information_at(model: ArrayModel, motion, positions, saturated=None) -> np.ndarray:
    """`fisher` information (3 (A - 1),) squared, 1 / m^2, of r_2 ... r_A at a true motion (T, 3).

    The motion is unknown to who estimates; ``saturated`` (T, G, 3) axes say nothing.
    """
    force, rate = model.predict_many(motion, positions)
    data = Collapsed.of(model, force, rate, saturated)
    turning = np.ascontiguousarray(np.asarray(motion.angular_rate).T)
    state = np.zeros((12, data.samples))
    state[:6], state[6:9] = products(turning.T).T, np.asarray(motion.angular_acceleration).T
    positions = np.ascontiguousarray(positions, float)
    return fisher(positions, data, turning, arms(state), data.reduce(positions)[0])
