"""The positions' score and Fisher information with the motion eliminated, in collapsed form.

For the papers' model with isotropic triads. The residual's derivative by r_k is Omega_t =
Omega(omega)^2 + Omega(omega_dot), the same at each triad; the motion's derivatives are B dw/domega
and H of (5a), whose B and H are the same at each sample. So the Schur complement over all samples
needs moments of Omega_t and dw/domega only: 45 x 21 numbers, however many triads there are.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.kernels import rate_information
from imuarray.model import structure_tensor
from imuarray.model.structure import design

CHUNK = 4096  # samples at a time: bounds memory


def arms(state) -> np.ndarray:
    """Omega_t as (3, 3, T): axis of the force, axis of the position, from (w, phi) (12, T)."""
    tensor = structure_tensor()[1:].transpose(1, 0, 2)
    return (tensor.reshape(9, 12) @ state).reshape(3, 3, -1)


def score(data: Collapsed, positions, state) -> np.ndarray:
    """Half the cost's fall per metre of each position, (A, 3), at the motion ``state`` (12, T).

    At the most likely motion this is the score of the profile likelihood.
    """
    omega = arms(state)
    force = data.specific_force.reshape(len(positions), -1)
    common = structure_tensor()[0] @ state
    stacked = omega.transpose(1, 0, 2).reshape(3, -1)
    right = force @ stacked.T - stacked @ common.ravel()
    return data.weights[:, None] * (right - positions @ (stacked @ stacked.T))


@nb.njit(cache=True, nogil=True)
def _taken(rate, C, P, out):
    """dw/domega W_t^-1 (dw/domega)', W_t the information of omega_t: entries `LOWER`, (21, T)."""
    Y = np.empty((6, 3))
    for t in range(rate.shape[1]):
        x, y, z = rate[0, t], rate[1, t], rate[2, t]
        xx, xy, xz, yy, yz, zz = rate_information(x, y, z, C, P[:, :, t])
        # W's Cholesky factor, then Y = slope factor'^-1
        fxx = np.sqrt(xx)
        fyx, fzx = xy / fxx, xz / fxx
        fyy = np.sqrt(yy - fyx * fyx)
        fzy = (yz - fzx * fyx) / fyy
        fzz = np.sqrt(zz - fzx * fzx - fzy * fzy)
        slopes = (
            (2.0 * x, 0.0, 0.0), (0.0, 2.0 * y, 0.0), (0.0, 0.0, 2.0 * z),
            (y, x, 0.0), (z, 0.0, x), (0.0, z, y),
        )  # fmt: skip
        for a in range(6):
            Y[a, 0] = slopes[a][0] / fxx
            Y[a, 1] = (slopes[a][1] - fyx * Y[a, 0]) / fyy
            Y[a, 2] = (slopes[a][2] - fzx * Y[a, 0] - fzy * Y[a, 1]) / fzz
        place = 0
        for a in range(6):
            for b in range(a + 1):
                out[place, t] = Y[a, 0] * Y[b, 0] + Y[a, 1] * Y[b, 1] + Y[a, 2] * Y[b, 2]
                place += 1


def _lower(size: int):
    """(rows, columns) of a symmetric matrix's lower triangle, and where each entry is in it."""
    rows, columns = np.tril_indices(size)
    place = np.empty((size, size), int)
    place[rows, columns] = place[columns, rows] = np.arange(rows.size)
    return rows, columns, place


ARMS, LOWER = _lower(9), _lower(6)  # of Omega_t's entries, and of w's


def _gram(data: Collapsed, rate, entries, C) -> np.ndarray:
    """sum_t Omega_t (x) Omega_t (x) what omega_t takes up, (9, 9, 6, 6).

    Both factors are symmetric: 45 x 21 sums instead of 54 x 54.
    """
    found = np.zeros((ARMS[0].size, LOWER[0].size))
    for first in range(0, rate.shape[1], CHUNK):
        part = slice(first, first + CHUNK)
        taken = np.empty((LOWER[0].size, rate[:, part].shape[1]))
        _taken(rate[:, part], C, data.gyroscope_information[..., part], taken)
        found += (entries[ARMS[0], part] * entries[ARMS[1], part]) @ taken.T
    return found[ARMS[2]][:, :, LOWER[2]]


def information(data: Collapsed, positions, rate, state, reduced) -> np.ndarray:
    """Fisher information (3 (A - 1), 3 (A - 1)) of r_2 ... r_A, 1 / m^2, the motion unknown.

    ``rate`` (3, T) and ``state`` (12, T) are the motion, ``reduced`` what `Collapsed.reduce`
    gives at ``positions`` (A, 3). Its inverse is the Cramer-Rao bound of the positions.
    """
    C, X, inverse = reduced[0], reduced[2], reduced[-1]
    omega, count = arms(state), len(positions)
    stacked = omega.transpose(1, 0, 2).reshape(3, -1)
    whole = np.kron(np.diag(data.weights), stacked @ stacked.T)
    # what omega_dot and s take up
    columns = design(positions).reshape(count, 3, 12)
    linear = data.weights[:, None, None] * columns[..., 6:]
    entries = omega.transpose(1, 0, 2).reshape(9, -1)  # position's axis, force's axis
    moments = (entries @ entries.T).reshape(3, 3, 3, 3)
    linear = linear.reshape(-1, 6)
    lost = (linear @ inverse @ linear.T).reshape(count, 3, count, 3)
    # sum over c and d of lost[k, c, l, d] moments[i, c, j, d]
    pairs = lost.transpose(0, 2, 1, 3).reshape(-1, 9)
    taken = pairs @ moments.transpose(1, 3, 0, 2).reshape(9, 9)
    whole -= taken.reshape(count, count, 3, 3).transpose(0, 2, 1, 3).reshape(whole.shape)
    # what omega takes up of the rest
    left = data.weights[:, None, None] * (columns[..., :6] - columns[..., 6:] @ X)
    left = left.reshape(count, 18)
    # (position's axis, force's, position's, force's, w, w) -> (i, (c, a), j, (d, b))
    gram = _gram(data, rate, entries, C).reshape(3, 3, 3, 3, 6, 6)
    blocks = gram.transpose(0, 1, 4, 2, 3, 5).reshape(3, 18, 3, 18)
    taken = np.tensordot(np.tensordot(left, blocks, (1, 1)), left, (3, 1)).transpose(0, 1, 3, 2)
    whole -= taken.reshape(whole.shape)
    return whole[3:, 3:]
