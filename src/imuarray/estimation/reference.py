"""ML-BCD, Algorithm 1 of paper 2017, written out: slow and obvious, in plain numpy.

`imuarray.estimation.bcd` does the same some thousand times as fast; tests hold it to this page.
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


def nonlinear_slope(rate, positions):
    """dh / domega (3 K, 3) at one rate (3,)."""
    turn = skew(rate)
    columns = [positions @ (skew(e) @ turn + turn @ skew(e)).T for e in np.eye(3)]
    return np.stack([column.ravel() for column in columns], axis=1)


def most_likely_motion(force, rates, positions, accelerometer_sd, gyroscope_sd, steps=50):
    """(5): (omega, omega_dot, s) of one sample, from force (K, 3) m/s^2 and rates (G, 3) rad/s.

    Gauss-Newton in omega; at each omega the rest, in which the model is linear, is eliminated.
    ``accelerometer_sd`` (K,) m/s^2 of each triad, ``gyroscope_sd`` rad/s.
    """
    weight = np.repeat(1.0 / np.asarray(accelerometer_sd), 3)
    H = weight[:, None] * linear_part(positions)
    unexplained = np.eye(len(H)) - H @ np.linalg.pinv(H)  # by any omega_dot and s
    omega = rates.mean(axis=0)
    for _ in range(steps):
        off = weight * (force.ravel() - nonlinear_part(omega, positions))
        slope = weight[:, None] * nonlinear_slope(omega, positions)
        residual = np.concatenate([unexplained @ off, (rates - omega).ravel() / gyroscope_sd])
        jacobian = [unexplained @ slope, np.tile(np.eye(3) / gyroscope_sd, (len(rates), 1))]
        step = np.linalg.lstsq(np.vstack(jacobian), residual, rcond=None)[0]
        omega = omega + step
        if np.linalg.norm(step) < 1e-13 * np.linalg.norm(omega):
            break
    off = weight * (force.ravel() - nonlinear_part(omega, positions))
    rest = np.linalg.lstsq(H, off, rcond=None)[0]
    return omega, rest[:3], rest[3:]


def positions_given_motion(forces, omega, omega_dot, s):
    """(8), (9): positions (K, 3) m, r_1 = 0, from forces (N, K, 3) and the motion, (N, 3) each."""
    A = skew(omega) @ skew(omega) + skew(omega_dot)
    C = np.linalg.inv(sum(a.T @ a for a in A))
    found = np.zeros((forces.shape[1], 3))
    for k in range(1, len(found)):
        found[k] = C @ sum(a.T @ (y - f) for a, y, f in zip(A, forces[:, k], s, strict=True))
    return found


def ml_bcd(forces, rates, positions, accelerometer_sd, gyroscope_sd, iterations):
    """Algorithm 1: positions (iterations, K, 3) m after each iteration.

    ``forces`` (N, K, 3) m/s^2, ``rates`` (N, G, 3) rad/s; ``positions`` (K, 3) m is the initial
    guess, the reference first and at 0.
    """
    path = []
    for _ in range(iterations):
        motion = [
            most_likely_motion(y, w, positions, accelerometer_sd, gyroscope_sd)
            for y, w in zip(forces, rates, strict=True)
        ]
        positions = positions_given_motion(forces, *map(np.array, zip(*motion, strict=True)))
        path.append(positions)
    return np.array(path)
