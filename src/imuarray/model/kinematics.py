"""Rigid-body kinematics: what ideal triads on the array see (paper 2021, eq. 4)."""

from imuarray.model.jax64 import jax, jnp
from imuarray.motion.state import Motion


def specific_force(motion: Motion, positions):
    """u_k = omega x (omega x r_k) + omega_dot x r_k + s, (A, 3) m/s^2, at one instant.

    ``positions`` (A, 3) metres relative to the reference triad, whose specific force s is.
    """
    rate = motion.angular_rate
    centrifugal = jnp.cross(rate, jnp.cross(rate, positions))
    euler = jnp.cross(motion.angular_acceleration, positions)
    return centrifugal + euler + motion.specific_force


def force_rate(motion: Motion, positions):
    """du_k/dt in the array frame, (A, 3) m/s^3, by automatic differentiation in time."""
    nothing = jnp.zeros_like(motion.angular_rate)
    tangent = Motion(
        motion.angular_acceleration, motion.angular_jerk, motion.force_rate, nothing, nothing
    )
    return jax.jvp(lambda state: specific_force(state, positions), (motion,), (tangent,))[1]
