"""Paper 2021 written out, to be read first: (5a), (22), (23), (26a); slow and obvious, in numpy.

`imuarray_papers.posterior.likelihood` does the same in six numbers a sample instead of 3 K, some
hundred times as fast; `tests/papers/test_collapsed.py` holds it to this page.
"""

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


def draw_rates(angular_rate, gyroscope_sd, draws, rng):
    """(26b): omega (T, N, 3) from p(omega_t | y_g), (15), of rates (T, G, 3) rad/s.

    Under a flat prior: normal around the gyroscopes' mean, with their variance over G.
    """
    shape = len(angular_rate), draws, 3
    sd = gyroscope_sd / np.sqrt(angular_rate.shape[1])
    return angular_rate.mean(axis=1)[:, None] + sd * rng.standard_normal(shape)


def projection(positions, covariance):
    """(22), (23): S (3 K, 3 K), and log |H' Q^-1 H|, for noise of covariance Q (3 K, 3 K)."""
    precision, H = np.linalg.inv(covariance), linear_part(positions)
    gram = H.T @ precision @ H
    S = precision - precision @ H @ np.linalg.solve(gram, H.T @ precision)
    return S, np.linalg.slogdet(gram)[1]


def log_likelihood(specific_force, positions, covariance, rates, power=0.5):
    """(26a): log p-hat(y_a | theta) of forces (T, K, 3) on draws of omega (T, N, 3) rad/s.

    ``positions`` (K, 3) m are theta. ``power`` of 1 / |H' Q^-1 H| a sample is 1/2 as (19) and (23)
    imply, 1 as printed.
    """
    S, logdet = projection(positions, covariance)
    total = 0.0
    for force, omega in zip(specific_force, rates, strict=True):
        residual = force.ravel() - nonlinear_part(omega, positions)  # (N, 3 K)
        exponents = -0.5 * np.sum((residual @ S) * residual, axis=1)
        largest = exponents.max()  # (31), (32): or all would underflow
        total += largest + np.log(np.mean(np.exp(exponents - largest))) - power * logdet
    return total
