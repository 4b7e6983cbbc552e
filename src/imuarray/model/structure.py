"""The linear structure of the papers' model, found by differentiating it.

With w = (w_x^2, w_y^2, w_z^2, w_x w_y, w_x w_z, w_y w_z) and phi = (omega_dot, s) the
specific force at a triad is linear in (w, phi), and the coefficients are affine in its
position: u_k = (G_0 + r_x G_1 + r_y G_2 + r_z G_3) (w, phi). B of (26a)'s h = B w and
H of (5a) are the two parts. Compiled kernels rest on this tensor, so the model itself
stays in one place (`imuarray.model.kinematics`).
"""

from functools import cache

import numpy as np

from imuarray.model import kinematics
from imuarray.model.jax64 import jax, jnp
from imuarray.motion.state import Motion

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def _coefficients(position):
    """(3, 12): columns for w (6), omega_dot (3), s (3) of a triad at ``position`` (3,)."""

    def force(rate, linear):
        motion = Motion(rate, linear[:3], linear[3:], jnp.zeros(3), jnp.zeros(3))
        return kinematics.specific_force(motion, position[None, :])[0]

    curvature = jax.hessian(force, argnums=0)(jnp.zeros(3), jnp.zeros(6))
    linear = jax.jacfwd(force, argnums=1)(jnp.zeros(3), jnp.zeros(6))
    columns = [curvature[:, i, j] / (2.0 if i == j else 1.0) for i, j in PAIRS]
    return jnp.concatenate([jnp.stack(columns, axis=1), linear], axis=1)


@cache
def structure_tensor() -> np.ndarray:
    """G, shape (4, 3, 12): G[0] constant, G[1:] per coordinate of the position in metres."""
    corners = np.array(jax.jit(jax.vmap(_coefficients))(np.vstack([np.zeros(3), np.eye(3)])))
    corners[1:] -= corners[0]
    corners.setflags(write=False)
    return corners


def design(positions) -> np.ndarray:
    """B and H side by side for positions (A, 3) metres: shape (3A, 12)."""
    weights = np.column_stack([np.ones(len(positions)), positions])
    return np.einsum("km,mij->kij", weights, structure_tensor()).reshape(-1, 12)


def products(rate) -> np.ndarray:
    """w from angular rates (..., 3) rad/s: shape (..., 6)."""
    rate = np.asarray(rate)
    return np.stack([rate[..., i] * rate[..., j] for i, j in PAIRS], axis=-1)
