"""Where the integrand of (26) is: a normal density around its mode in omega, per sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.motion_ml import motion_from

# Wider than the curvature at the mode says, so that no weight is without bound in practice.
WIDENING = 1.05

# The six products of omega, in the order of the collapsed problem.
PRODUCTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def proposals(collapsed: Collapsed, mean, covariance, positions, widening: float = WIDENING):
    """Mean (T, 3) rad/s and covariance (T, 3, 3) of a normal density like the integrand.

    The integrand is p(omega_t | y_g) = N(``mean``, ``covariance``) times the exponential of
    (26a) at ``positions`` (A, 3) m.
    """
    precision = np.linalg.inv(covariance)
    given = replace(
        collapsed,
        mean=np.ascontiguousarray(mean.T),
        gyroscope_information=np.ascontiguousarray(precision.transpose(1, 2, 0)),
    )
    rate = motion_from(given, positions).motion.angular_rate
    found, _ = collapsed.reduce(positions)
    slope = _product_slopes(rate)
    curvature = precision + np.einsum("tai,ab,tbj->tij", slope, found.C, slope)
    misfit = _products(rate) @ found.C - found.b.T
    full = curvature + _second(misfit)
    # far from a good fit the second derivative may not be positive: then the first order serves
    sound = np.linalg.eigvalsh(full)[:, 0] > 0.1 * np.linalg.eigvalsh(curvature)[:, 0]
    curvature[sound] = full[sound]
    return rate, widening**2 * np.linalg.inv(curvature)


def tilts(mean, covariance, proposal_mean, proposal_covariance) -> np.ndarray:
    """log N(omega; mean, covariance) - log N(omega; proposal) as coefficients, (10, T).

    Of 1, x, y, z and the six products; (T, 3) rad/s and (T, 3, 3) each.
    """
    P, Q = np.linalg.inv(covariance), np.linalg.inv(proposal_covariance)
    constant = 0.5 * (np.linalg.slogdet(P)[1] - np.linalg.slogdet(Q)[1])
    constant -= 0.5 * np.einsum("ti,tij,tj->t", mean, P, mean)
    constant += 0.5 * np.einsum("ti,tij,tj->t", proposal_mean, Q, proposal_mean)
    linear = np.einsum("tij,tj->ti", P, mean) - np.einsum("tij,tj->ti", Q, proposal_mean)
    square = 0.5 * (Q - P)
    products = [square[:, i, j] * (1 if i == j else 2) for i, j in PRODUCTS]
    return np.ascontiguousarray(np.vstack([constant, *linear.T, *products]))


def _products(rate):
    return np.stack([rate[:, i] * rate[:, j] for i, j in PRODUCTS], axis=1)


def _product_slopes(rate):
    """Derivatives (T, 6, 3) of the six products in omega."""
    out = np.zeros((len(rate), 6, 3))
    for row, (i, j) in enumerate(PRODUCTS):
        out[:, row, i] += rate[:, j]
        out[:, row, j] += rate[:, i]
    return out


def _second(misfit):
    """sum_a misfit_a times the second derivative of product a, (T, 3, 3)."""
    out = np.zeros((len(misfit), 3, 3))
    for row, (i, j) in enumerate(PRODUCTS):
        out[:, i, j] += misfit[:, row]
        out[:, j, i] += misfit[:, row]
    return out
