"""Slow, obvious forms that the fast paths are tested and benchmarked against."""

import numpy as np
from scipy.special import logsumexp


def skew(vector):
    """Omega(a) with Omega(a) b = a x b, (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def linear_matrix(positions):
    """H(theta) of (5a), (3A, 6)."""
    return np.vstack([np.hstack([-skew(r), np.eye(3)]) for r in positions])


def nonlinear_part(rates, positions):
    """h(omega, theta) of (5a) for rates (..., 3): shape (..., 3A)."""
    turns = skew(rates)
    return np.einsum("...ij,...jl,kl->...ki", turns, turns, positions).reshape(
        *np.shape(rates)[:-1], -1
    )


def direct_log_likelihood(specific_force, positions, covariance, rates, power=0.5):
    """(26a) in its direct form, 3A dimensions a sample, on draws (T, N, 3)."""
    precision = np.linalg.inv(covariance)
    H = linear_matrix(positions)
    gram = H.T @ precision @ H
    S = precision - precision @ H @ np.linalg.solve(gram, H.T @ precision)
    residual = specific_force.reshape(len(rates), 1, -1) - nonlinear_part(rates, positions)
    square = np.einsum("tni,tni->tn", residual @ S, residual)
    terms = logsumexp(-0.5 * square, axis=1) - np.log(rates.shape[1])
    return terms.sum() - power * len(rates) * np.linalg.slogdet(gram)[1]
