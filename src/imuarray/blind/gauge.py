"""What no recording can distinguish from a clean one: errors that all sensors share.

The sensors asked for are ignored; every IMU is affected alike.
"""

import numpy as np

from imuarray.blind.change import UNIT_FORCE, Parameter, effect, error_of, spread
from imuarray.blind.errors import apart
from imuarray.blind.scene import Pair

COMMON = {"everywhere": True, "scalable": False}


def _signed(rng, sensors, size) -> float:
    """One amplitude for all, of either sign."""
    return size * float(rng.choice([-1.0, 1.0]))


@error_of("rate", "scale", "1", 1e-3, 0.03, _signed, **COMMON)
def gauge_gyroscope_scale(scale, field, sensors):
    """(1 + c) w on all axes of all gyroscopes; the same as a dilation r / (1 + c)^2."""
    return scale * field.rate


@error_of("force", "scale", "1", 1e-3, 0.03, _signed, **COMMON)
def gauge_accelerometer_scale(scale, field, sensors):
    """(1 + c) u on all axes of all accelerometers; the same as a dilation (1 + c) r."""
    return scale * field.force


@effect("s", 1e-4, 5e-3, **COMMON)
def gauge_sensor_delay(scene, rng, sensors, size):
    """All IMUs sample at t + tau: another motion, as free as the first."""
    delay = _signed(rng, sensors, size)
    ages = spread(scene, sensors, delay)
    return {"parameters": {"delay": Parameter(delay, "s")}, "ages": Pair(ages, ages)}


@error_of(
    "force", "bias", UNIT_FORCE, 0.01, 0.1,
    lambda rng, sensors, size: size * rng.standard_normal(3), **COMMON,
)  # fmt: skip
def gauge_accelerometer_bias(bias, field, sensors):
    """u + b, the same b on all triads: part of s."""
    return bias


@error_of(
    "force", "lever_arm", "m", 1e-4, 1.5e-3,
    lambda rng, sensors, size: size * rng.standard_normal((3, 3)), from_readings=False, **COMMON,
)  # fmt: skip
def gauge_lever_arm(arms, field, sensors):
    """Axis i of every triad sits at r_k + d_i: one specific force for all, part of s."""
    return apart(np.broadcast_to(arms, (len(sensors), 3, 3)), field, sensors)
