"""Slow, obvious forms that the fast paths are tested and benchmarked against."""

import numpy as np
from scipy.special import logsumexp

from imuarray.estimation.reference import linear_part, nonlinear_part, skew
from imuarray.posterior.reference import projection


def proper_log_likelihood(specific_force, positions, covariance, rates, phi_sd):
    """log of the mean over draws (T, N, 3) of p(y_a | omega, theta), with phi ~ N(0, phi_sd^2).

    No flat prior and no algebra of (19)-(26): a plain normal density whose covariance is
    that of noise plus H phi. For phi_sd -> infinity its differences in theta tend to (16).
    """
    H = linear_part(positions)
    total = covariance + phi_sd**2 * H @ H.T
    residual = specific_force.reshape(len(rates), 1, -1) - nonlinear_part(rates, positions)
    white = np.linalg.solve(np.linalg.cholesky(total), np.swapaxes(residual, -1, -2))
    terms = logsumexp(-0.5 * (white**2).sum(axis=1), axis=1) - np.log(rates.shape[1])
    return terms.sum() - 0.5 * len(rates) * np.linalg.slogdet(total)[1]


def gauss_hermite(mean, covariance, order):
    """Nodes (T, order^3, 3) and log weights (order^3,) for normals with means (T, 3)."""
    x, w = np.polynomial.hermite_e.hermegauss(order)
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    weights = np.multiply.outer(np.multiply.outer(w, w), w).ravel()
    nodes = mean[:, None] + grid @ np.linalg.cholesky(covariance).T
    return nodes, np.log(weights / weights.sum())


def exact_log_likelihood(specific_force, thetas, covariance, nodes, log_weights, power=0.5):
    """(16a) by quadrature in omega, direct form, for many theta (B, 3 (A - 1)): (B,)."""
    out = np.empty(len(thetas))
    for i, theta in enumerate(thetas):
        positions = np.vstack([np.zeros(3), theta.reshape(-1, 3)])
        S, logdet = projection(positions, covariance)
        residual = specific_force.reshape(len(nodes), 1, -1) - nonlinear_part(nodes, positions)
        square = ((residual @ S) * residual).sum(axis=-1)
        out[i] = logsumexp(log_weights - 0.5 * square, axis=1).sum()
        out[i] -= power * len(nodes) * logdet
    return out


def whitened_residual(motion, positions, specific_force, angular_rate, noise, keep=None):
    """Residuals of one sample in noise sds: accelerometers, then the gyroscope axes in ``keep``.

    ``motion`` (9,) is omega, omega_dot, s; ``keep`` (3G,) bool.
    """
    rate, acceleration, force = motion[:3], motion[3:6], motion[6:]
    cross = np.cross(rate, np.cross(rate, positions)) + np.cross(acceleration, positions)
    first = np.linalg.cholesky(noise.accelerometer)
    second = noise.gyroscope
    difference = (angular_rate - rate).ravel()
    if keep is not None:
        second, difference = second[np.ix_(keep, keep)], difference[keep]
    second = np.linalg.cholesky(second)
    return np.concatenate(
        [
            np.linalg.solve(first, (specific_force - cross - force).ravel()),
            np.linalg.solve(second, difference),
        ]
    )


def joint_jacobian(motions, positions, gyroscopes, accelerometer_sd, gyroscope_sd):
    """Whitened derivative of all measurements, (T (3A + 3G), 3 (A - 1) + 9 T).

    Columns: r_2 ... r_A, then omega, omega_dot, s of each sample; ``motions`` (T, 9).
    """
    samples, count = len(motions), len(positions)
    rows, base = 3 * (count + gyroscopes), 3 * (count - 1)
    out = np.zeros((samples * rows, base + 9 * samples))
    for t, (rate, acceleration) in enumerate(zip(motions[:, :3], motions[:, 3:6], strict=True)):
        at, col = t * rows, base + 9 * t
        A = skew(rate) @ skew(rate) + skew(acceleration)
        for k, r in enumerate(positions):
            here = slice(at + 3 * k, at + 3 * k + 3)
            if k:
                out[here, 3 * k - 3 : 3 * k] = A / accelerometer_sd
            # d/d omega of omega x (omega x r)
            turn = -skew(np.cross(rate, r)) - skew(rate) @ skew(r)
            block = np.hstack([turn, -skew(r), np.eye(3)])
            out[here, col : col + 9] = block / accelerometer_sd
        tail = at + 3 * count
        stack = np.tile(np.eye(3), (gyroscopes, 1)) / gyroscope_sd
        out[tail : at + rows, col : col + 3] = stack
    return out


def position_information(jacobian, unknowns):
    """Schur complement of the Fisher information on the first ``unknowns`` parameters."""
    wanted, nuisance = jacobian[:, :unknowns], jacobian[:, unknowns:]
    basis, _ = np.linalg.qr(nuisance)
    left = wanted - basis @ (basis.T @ wanted)
    return left.T @ left
