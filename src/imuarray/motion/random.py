"""Independent random motion, one draw a sample, as the two papers simulate it."""

import numpy as np

from imuarray.motion.state import Motion


def directions(rng: np.random.Generator, shape) -> np.ndarray:
    """Unit vectors uniform on the sphere, shape (*shape, 3)."""
    raw = rng.standard_normal((*shape, 3))
    return raw / np.linalg.norm(raw, axis=-1, keepdims=True)


def sphere_motion(rng, shape, angular_rate, angular_acceleration, specific_force) -> Motion:
    """Fixed magnitudes, directions uniform on the sphere (paper 2017, section IV).

    Parameters
    ----------
    shape : tuple
        Leading shape of the samples, (N,) or (realisations, N).
    angular_rate, angular_acceleration, specific_force : float
        Magnitudes in rad/s, rad/s^2, m/s^2.
    """
    magnitudes = (angular_rate, angular_acceleration, specific_force)
    return Motion.of(*(size * directions(rng, shape) for size in magnitudes))


def normal_motion(
    rng,
    shape,
    angular_rate_sd,
    angular_acceleration_sd,
    specific_force_sd,
    angular_jerk_sd=0.0,
    force_rate_sd=0.0,
) -> Motion:
    """Zero-mean normal motion, independent in time (paper 2021, section IV-A).

    Standard deviations per axis in rad/s, rad/s^2, m/s^2 (and rad/s^3, m/s^3 for the
    derivatives that only delays see).
    """
    sds = (
        angular_rate_sd,
        angular_acceleration_sd,
        specific_force_sd,
        angular_jerk_sd,
        force_rate_sd,
    )
    return Motion(*(sd * rng.standard_normal((*shape, 3)) for sd in sds))
