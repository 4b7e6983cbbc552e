"""The matrices of (5a) of paper 2021, written out: slow and obvious, in plain numpy."""

import numpy as np


def skew(vector):
    """Omega(a) with Omega(a) b = a x b, (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def linear_part(positions):
    """H (3 K, 6) of (5a) in paper 2021: specific force by (omega_dot, s) at positions (K, 3)."""
    return np.vstack([np.hstack([-skew(r), np.eye(3)]) for r in positions])


def nonlinear_part(rates, positions):
    """h (..., 3 K) of (5a) in paper 2021: omega x (omega x r_k) for rates (..., 3) rad/s."""
    turns = skew(rates)
    forces = positions @ np.swapaxes(turns @ turns, -1, -2)
    return forces.reshape(*np.shape(rates)[:-1], -1)
