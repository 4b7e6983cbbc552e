"""p(omega_t | y_g), (30a) and (30b); and a normal density like the integrand of (26)."""

import numpy as np

from imuarray.errors import InputError
from imuarray.model.structure import CURVATURES, PAIRS, product_slopes, products
from imuarray.recording import Recording
from imuarray_papers.estimation.collapsed import Collapsed, motion_from

FEWEST = 4  # gyroscopes for a covariance (3, 3) of full rank
# Of draws, times what the curvature at the mode says, so that no weight is without bound in
# practice; it alone gives log p-hat a variance of some 6 (WIDENING - 1)^2 / N a sample.
WIDENING = 1.05


def sample_covariance(angular_rate):
    """Mean (T, 3) rad/s, (30a), and covariance (T, 3, 3), (30b), of rates (T, G, 3).

    The covariance is that of one gyroscope, as the paper writes it. InputError where G < 4.
    """
    if angular_rate.shape[1] < FEWEST:
        raise InputError(
            f"gyroscopes: expected at least {FEWEST} for the spread among them (30b), found"
            f" {angular_rate.shape[1]}"
        )
    mean = angular_rate.mean(axis=1)
    off = angular_rate - mean[:, None]
    return mean, np.einsum("tgi,tgj->tij", off, off) / (angular_rate.shape[1] - 1)


def rate_distribution(recording: Recording):
    """`sample_covariance`, or the declared noise where there are fewer than 4 gyroscopes."""
    rate = recording.angular_rate
    if rate.shape[1] >= FEWEST:
        return sample_covariance(rate)
    covariance = np.eye(3) * recording.gyroscope_noise_sd**2 / rate.shape[1]
    return rate.mean(axis=1), np.broadcast_to(covariance, (len(rate), 3, 3))


def proposals(collapsed: Collapsed, mean, covariance, positions):
    """Mean (T, 3) rad/s and covariance (T, 3, 3) of a normal density like the integrand.

    The integrand is p(omega_t | y_g) = N(``mean``, ``covariance``) times the exponential of
    (26a) at ``positions`` (A, 3) m.
    """
    given = collapsed.with_rates(covariance, mean)
    rate = motion_from(given, positions).motion.angular_rate
    found, _ = collapsed.reduce(positions)
    slope = product_slopes(rate)
    curvature = np.linalg.inv(covariance) + np.einsum("tai,ab,tbj->tij", slope, found.C, slope)
    misfit = products(rate) @ found.C - found.b.T
    full = curvature + np.einsum("ta,aij->tij", misfit, CURVATURES)
    # far from a good fit the second derivative may not be positive: then the first order serves
    sound = np.linalg.eigvalsh(full)[:, 0] > 0.1 * np.linalg.eigvalsh(curvature)[:, 0]
    curvature[sound] = full[sound]
    return rate, WIDENING**2 * np.linalg.inv(curvature)


def log_weights(mean, covariance, proposal_mean, proposal_covariance) -> np.ndarray:
    """Log importance weights log N(omega; mean, covariance) - log N(omega; proposal), (10, T).

    Coefficients of 1, x, y, z and the six products; (T, 3) rad/s and (T, 3, 3) each.
    """
    P, Q = np.linalg.inv(covariance), np.linalg.inv(proposal_covariance)
    constant = 0.5 * (np.linalg.slogdet(P)[1] - np.linalg.slogdet(Q)[1])
    constant -= 0.5 * np.einsum("ti,tij,tj->t", mean, P, mean)
    constant += 0.5 * np.einsum("ti,tij,tj->t", proposal_mean, Q, proposal_mean)
    linear = np.einsum("tij,tj->ti", P, mean) - np.einsum("tij,tj->ti", Q, proposal_mean)
    square = 0.5 * (Q - P)
    both = [square[:, i, j] * (1 if i == j else 2) for i, j in PAIRS]
    return np.ascontiguousarray(np.vstack([constant, *linear.T, *both]))
