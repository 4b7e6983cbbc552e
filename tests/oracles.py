"""Slow, obvious forms that the fast paths are tested and benchmarked against."""

from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from imuarray.model import ArrayModel
from imuarray.model.jax64 import jax, jnp
from imuarray.motion import Motion
from imuarray_papers.estimation.collapsed import estimate_motion
from imuarray_papers.reference import linear_part, nonlinear_part, projection, skew


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


class Joint(NamedTuple):
    """What `joint_map` came to; the parameters are r_2 ... r_A, then the effects'."""

    positions: np.ndarray  # (A, 3)
    effects: np.ndarray
    covariance: np.ndarray  # of the parameters
    motion: np.ndarray  # (T, 9 or 15)
    cost: float
    converged: bool


def joint_map(model, force, rate, saturated=None, prior=None, limit=40):
    """Plain Gauss-Newton on motion, positions and effects at once, by automatic differentiation.

    Any model and noise; ``prior`` None or (mean, sd) of r_2 ... r_A. Steps that raise the cost are
    halved.
    """
    split, D = 3 * (model.array.accelerometers - 1), 9 + 6 * model.needs_derivatives
    whiten = [np.linalg.cholesky(np.linalg.inv(part)).T
              for part in (model.noise.accelerometer, model.noise.gyroscope)]  # fmt: skip
    keep = np.ones(rate.shape) if saturated is None else 1.0 - saturated
    mean, sd = (np.zeros(split), np.inf) if prior is None else prior
    mean = np.append(mean, np.zeros(model.effect_size))
    sd = np.append(np.broadcast_to(sd, split), model.effect_prior_sd)

    def one(x, p, force, rate, keep):
        places = jnp.concatenate([jnp.zeros((1, 3)), p[:split].reshape(-1, 3)])
        fields = jnp.concatenate([x, jnp.zeros(15 - D)]).reshape(5, 3)
        found = model.predict(Motion(*fields), places, p[split:])
        parts = [whiten[0] @ (force - found.specific_force).ravel(),
                 whiten[1] @ (keep * (rate - found.angular_rate)).ravel()]  # fmt: skip
        return jnp.concatenate([*parts, x[9:] / np.repeat(model.derivative_sd, 3)[: D - 9]])

    parts = (0, None, 0, 0, 0)
    values = jax.jit(jax.vmap(one, parts))
    slopes = jax.jit(jax.vmap(jax.jacfwd(one, (0, 1)), parts))
    first = estimate_motion(ArrayModel(model.array, model.noise), force, rate, None, saturated)
    x = np.hstack([*first.motion[:3], np.zeros((len(force), D - 9))])
    p = np.append(model.array.relative[1:].ravel(), np.zeros(model.effect_size))

    def cost(x, p):
        off = np.asarray(values(x, p, force, rate, keep))
        return off, np.sum(off**2) + np.sum(((p - mean) / sd) ** 2)

    off, best = cost(x, p)
    for _ in range(limit):
        mine, shared = map(np.asarray, slopes(x, p, force, rate, keep))
        inverse = np.linalg.inv(mine.mT @ mine)
        cross, slope = mine.mT @ shared, (mine.mT @ off[..., None])[..., 0]
        flat, taken = shared.reshape(-1, p.size), (inverse @ cross).reshape(-1, p.size)
        known = flat.T @ flat - cross.reshape(-1, p.size).T @ taken + np.diag(sd**-2.0)
        down = flat.T @ off.ravel() - taken.T @ slope.ravel() + (p - mean) / sd**2
        scale = np.sqrt(np.diag(known))
        covariance = np.linalg.inv(known / np.outer(scale, scale)) / np.outer(scale, scale)
        step = -covariance @ down
        turn = -np.einsum("tab,tb->ta", inverse, slope + cross @ step)
        converged = np.abs(step / np.sqrt(np.diag(covariance))).max() < 1e-7
        for length in 0.5 ** np.arange(12):
            tried = x + length * turn, p + length * step
            again, lower = cost(*tried)
            if lower <= best * (1 + 1e-12):
                (x, p), off, best = tried, again, lower
                break
        if converged:
            break
    places = np.vstack([np.zeros(3), p[:split].reshape(-1, 3)])
    return Joint(places, p[split:], covariance, x, float(best), bool(converged))


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
