"""Noisy measurements of a motion by an array."""

import numpy as np

from imuarray.model import ArrayModel
from imuarray.motion import Motion


def clip(values, rail):
    """Values at the rail where the sensor would saturate, and which did (bool)."""
    if not np.isfinite(rail):
        return values, np.zeros(values.shape, bool)
    saturated = np.abs(values) >= rail
    return np.clip(values, -rail, rail), saturated


def measure(
    model: ArrayModel,
    motion: Motion,
    positions,
    rng,
    parameters=(),
    gyroscope_range=np.inf,
    time=None,
):
    """y_a, y_g and which gyroscope axes saturated, for motion fields (..., T, 3).

    Parameters
    ----------
    positions : (A, 3) m relative to the reference, or (realisations, A, 3) with motion
        fields (realisations, T, 3)
    parameters : (P,) effect parameters
    gyroscope_range : float, rad/s
    time : (T,) s, which drifts, shifts and clocks look at

    Returns
    -------
    specific_force (..., T, A, 3) m/s^2, angular_rate (..., T, G, 3) rad/s, saturated (same)
    """
    ideal = model.predict_many(motion, positions, parameters, time)
    shape = np.shape(motion.angular_rate)[:-1]
    force_noise, rate_noise = model.noise.draw(rng, shape)
    rate, saturated = clip(ideal.angular_rate + rate_noise, gyroscope_range)
    return ideal.specific_force + force_noise, rate, saturated
