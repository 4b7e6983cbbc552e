"""Fisher information of the papers' model, from its structure tensor alone."""

from typing import NamedTuple

import numpy as np

from imuarray.model import structure_tensor
from imuarray.model.structure import design, product_slopes, products
from imuarray.motion import Motion


class NoiseLevels(NamedTuple):
    """Accelerometer sd (m/s^2) and the gyroscopes' information on omega (s^2/rad^2)."""

    accelerometer_sd: float
    rate_information: float


def state_of(motion: Motion) -> np.ndarray:
    """(w, omega_dot, s) of each sample, (T, 12)."""
    rate = np.asarray(motion.angular_rate)
    return np.hstack([products(rate), motion.angular_acceleration, motion.specific_force])


def lever_matrices(state) -> np.ndarray:
    """A_n = Omega(omega)^2 + Omega(omega_dot) of (8) in paper 2017, (T, 3, 3)."""
    return np.einsum("ica,ta->tci", structure_tensor()[1:], state)


def motion_jacobian(positions, rates) -> np.ndarray:
    """Derivative of the stacked specific force in (omega, omega_dot, s), (T, 3A, 9)."""
    whole, slopes = design(positions), product_slopes(rates)
    linear = np.broadcast_to(whole[:, 6:], (len(rates), len(whole), 6))
    return np.concatenate([whole[:, :6] @ slopes, linear], axis=2)


def joint_jacobian(positions, motion: Motion, noise: NoiseLevels):
    """Whitened derivatives in theta (T (3A + 3), 3 (A - 1)) and in all motion (.., 9 T)."""
    rates = np.asarray(motion.angular_rate)
    samples, count = len(rates), len(positions)
    levers = lever_matrices(state_of(motion)) / noise.accelerometer_sd
    force = motion_jacobian(positions, rates) / noise.accelerometer_sd
    shared = np.zeros((samples, 3 * count + 3, 3 * (count - 1)))
    moving = np.zeros((samples, 3 * count + 3, samples, 9))
    for t in range(samples):
        shared[t, 3 : 3 * count] = np.kron(np.eye(count - 1), levers[t])
        moving[t, : 3 * count, t] = force[t]
        moving[t, 3 * count :, t, :3] = np.sqrt(noise.rate_information) * np.eye(3)
    return shared.reshape(-1, shared.shape[-1]), moving.reshape(len(shared) * shared.shape[1], -1)


def joint_singular_values(positions, motion: Motion, noise: NoiseLevels) -> np.ndarray:
    """Singular values of the derivative in theta with the motion projected out, decreasing."""
    shared, moving = joint_jacobian(positions, motion, noise)
    left, values, _ = np.linalg.svd(moving, full_matrices=False)
    basis = left[:, values > 1e-12 * values[0]]
    return np.linalg.svd(shared - basis @ (basis.T @ shared), compute_uv=False)


def numerical_rank(values, tolerance: float = 1e-9) -> int:
    """How many singular values exceed ``tolerance`` times the largest."""
    return int(np.sum(values > tolerance * max(values[0], 1e-300))) if len(values) else 0


def position_information(positions, motion: Motion, noise: NoiseLevels, residual=None, offset=None):
    """Information on theta with the motion eliminated, and the score, by Schur complements.

    ``positions`` (A, 3) m relative to the reference; ``residual`` (T, A, 3) m/s^2 measured
    minus predicted and ``offset`` (T, 3) rad/s, gyroscopes' mean minus omega. Returns
    (3 (A - 1), 3 (A - 1)) and (3 (A - 1),); the score is zero without residuals.
    """
    rates = np.asarray(motion.angular_rate)
    samples, count = len(rates), len(positions)
    levers = lever_matrices(state_of(motion))
    force = motion_jacobian(positions, rates)
    weight = noise.accelerometer_sd**-2.0
    own = weight * np.swapaxes(force, 1, 2) @ force
    own[:, :3, :3] += noise.rate_information * np.eye(3)
    split = force.reshape(samples, count, 3, 9)[:, 1:]
    cross = weight * np.einsum("tci,tkcx->tkix", levers, split).reshape(samples, -1, 9)
    gain = np.linalg.solve(own, np.swapaxes(cross, 1, 2))
    shared = weight * np.einsum("tci,tcj->ij", levers, levers)
    information = np.kron(np.eye(count - 1), shared) - np.einsum("tpx,txq->pq", cross, gain)
    score = np.zeros(3 * (count - 1))
    if residual is not None:
        pull = weight * np.einsum("tnx,tn->tx", force, residual.reshape(samples, -1))
        pull[:, :3] += noise.rate_information * offset
        direct = weight * np.einsum("tci,tkc->ki", levers, residual[:, 1:]).ravel()
        score = direct - np.einsum("txp,tx->p", gain, pull)
    return information, score
