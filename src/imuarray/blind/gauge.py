"""What no recording can tell from a clean one: errors that all sensors share.

The sensors asked for are ignored; every IMU is affected alike.
"""

from __future__ import annotations

import numpy as np

from imuarray.blind.change import UNIT_FORCE, Parameter, effect, spread
from imuarray.blind.scene import Pair


def _all(scene) -> tuple[int, ...]:
    return tuple(range(scene.accelerometers))


def _sign(rng) -> float:
    return float(rng.choice([-1.0, 1.0]))


@effect("1", 1e-3, 0.03)
def gauge_gyroscope_scale(scene, rng, sensors, size):
    """(1 + c) w on all axes of all gyroscopes; the same as a dilation r / (1 + c)^2."""
    scale = size * _sign(rng)
    return {
        "sensors": _all(scene),
        "parameters": {"scale": Parameter(scale, "1")},
        "rate_error": lambda field: scale * field.rate,
    }


@effect("1", 1e-3, 0.03)
def gauge_accelerometer_scale(scene, rng, sensors, size):
    """(1 + c) u on all axes of all accelerometers; the same as a dilation (1 + c) r."""
    scale = size * _sign(rng)
    return {
        "sensors": _all(scene),
        "parameters": {"scale": Parameter(scale, "1")},
        "force_error": lambda field: scale * field.force,
    }


@effect("s", 1e-4, 5e-3)
def gauge_sensor_delay(scene, rng, sensors, size):
    """All IMUs sample at t + tau: another motion, as free as the first."""
    delay = size * _sign(rng)
    ages = spread(scene, _all(scene), delay)
    return {
        "sensors": _all(scene),
        "parameters": {"delay": Parameter(delay, "s")},
        "ages": Pair(ages, ages),
    }


@effect(UNIT_FORCE, 0.01, 0.1)
def gauge_accelerometer_bias(scene, rng, sensors, size):
    """u + b, the same b on all triads: part of s."""
    bias = size * rng.standard_normal(3)
    return {
        "sensors": _all(scene),
        "parameters": {"bias": Parameter(bias, UNIT_FORCE)},
        "force_error": lambda field: bias,
    }


@effect("m", 1e-4, 1.5e-3)
def gauge_lever_arm(scene, rng, sensors, size):
    """Axis i of every triad sits at r_k + d_i: one specific force for all, part of s."""
    arms = size * rng.standard_normal((3, 3))

    def error(field):
        whole = _all(scene)
        repeated = np.broadcast_to(arms, (len(whole), 3, 3))
        seen = [field.lever(repeated[:, axis], whole)[..., axis] for axis in range(3)]
        return np.stack(seen, axis=-1)

    said = {"lever_arm": Parameter(arms, "m")}
    return {"sensors": _all(scene), "parameters": said, "force_error": error}
