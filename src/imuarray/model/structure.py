"""The linear structure of the papers' model, found from its values.

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
CURVATURES = np.array(  # d2w_a / domega_i domega_j, (6, 3, 3)
    [np.outer(np.eye(3)[i], np.eye(3)[j]) + np.outer(np.eye(3)[j], np.eye(3)[i]) for i, j in PAIRS]
)


def _force(rate, linear, position):
    """(3,) m/s^2 at ``position`` (3,) m; ``linear`` (6,) is phi."""
    motion = Motion(rate, linear[:3], linear[3:], jnp.zeros(3), jnp.zeros(3))
    return kinematics.specific_force(motion, position[None, :])[0]


@cache
def structure_tensor() -> np.ndarray:
    """G, shape (4, 3, 12): G[0] constant, G[1:] per coordinate of the position in metres.

    A quadratic form's coefficients are its values at unit vectors e_i, and those at e_i + e_j
    less them: small integers here, so nothing is rounded, and each process compiles less than
    for its second derivative.
    """
    unit, nothing = np.eye(3), np.zeros((6, 3))
    rates = np.vstack([*(unit[i] if i == j else unit[i] + unit[j] for i, j in PAIRS), nothing])
    linear = np.vstack([np.zeros((6, 6)), np.eye(6)])
    places = np.vstack([np.zeros(3), unit])
    of_each = jax.vmap(jax.vmap(_force, (0, 0, None)), (None, None, 0))
    tensor = np.array(jax.jit(of_each)(rates, linear, places)).transpose(0, 2, 1)
    for column, (i, j) in enumerate(PAIRS[3:], 3):
        tensor[..., column] -= tensor[..., i] + tensor[..., j]
    tensor[1:] -= tensor[0]
    tensor = np.ascontiguousarray(tensor)
    tensor.setflags(write=False)
    return tensor


def design(positions) -> np.ndarray:
    """B and H side by side for positions (A, 3) metres: shape (3A, 12)."""
    weights = np.column_stack([np.ones(len(positions)), positions])
    return np.einsum("km,mij->kij", weights, structure_tensor()).reshape(-1, 12)


def products(rate) -> np.ndarray:
    """w from angular rates (..., 3) rad/s: shape (..., 6)."""
    rate = np.asarray(rate)
    return np.stack([rate[..., i] * rate[..., j] for i, j in PAIRS], axis=-1)


def product_slopes(rate) -> np.ndarray:
    """dw / domega at rates (..., 3) rad/s: shape (..., 6, 3)."""
    return np.einsum("aij,...j->...ai", CURVATURES, rate)
