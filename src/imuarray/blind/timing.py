"""Effects of the catalogue on the instants at which sensors sample: delays and clocks."""

import numpy as np

from imuarray.blind.change import UNIT_FORCE, Parameter, effect, spread
from imuarray.blind.scene import Pair

CLOCK_PERIOD = 1e-3  # s, P of a free-running IMU
LATENCY = 5e-5  # s, sd of the host's


@effect("s", 1e-5, 5e-3)
def sensor_delay(scene, rng, sensors, size):
    """Both sensors of IMU k sampled at t + tau_k; size in seconds."""
    delay = size * rng.standard_normal(len(sensors))
    ages = spread(scene, sensors, delay)
    return {"parameters": {"delay": Parameter(delay, "s")}, "ages": Pair(ages, ages)}


@effect("s", 1e-4, 5e-3)
def gyroscope_delay(scene, rng, sensors, size):
    """Gyroscopes at t + tau_k, accelerometers at t; if all are chosen, half the time one tau."""
    common = len(sensors) == scene.accelerometers and rng.random() < 0.5
    own = rng.standard_normal(len(sensors))
    # a common delay has no companions to make up for a small draw
    delay = size * (np.sign(own[0]) * np.ones(len(sensors)) if common else own)
    said = {"delay": Parameter(delay, "s"), "common": Parameter(bool(common), "1")}
    return {"parameters": said, "ages": Pair(None, spread(scene, sensors, delay))}


@effect("s", CLOCK_PERIOD, CLOCK_PERIOD)
def sensor_clock(scene, rng, sensors, size):
    """IMU k samples at phi + n P (1 + eps); the host gets the newest sample not after t.

    At size = P = 1 ms, the realistic one, this is exact. Other sizes keep the clocks and make the
    sawtooth of the age higher or lower: a shorter period would have another pattern of ages, and
    its size would not grow smoothly with it. A realistic host asks, half the time, now earlier, now
    later by `LATENCY`, which matters near a clock's jump alone: readings there are a period off.
    """
    offset = rng.uniform(0.01, 0.05, len(sensors)) * rng.choice([-1.0, 1.0], len(sensors))
    period = CLOCK_PERIOD * (1 + offset)
    phase = rng.random(len(sensors)) * period
    uneven = LATENCY * (size == CLOCK_PERIOD and rng.random() > 0.5)
    late = uneven * rng.standard_normal((len(scene.time), 1))
    waiting = np.mod(scene.time[:, None] + late - phase, period) - late
    ages = spread(scene, sensors, -waiting * (size / CLOCK_PERIOD))
    said = {
        "period": Parameter(period, "s"),
        "clock_offset": Parameter(offset, "1"),
        "phase": Parameter(phase, "s"),
        "host_latency": Parameter(uneven, "s"),
        "largest_age": Parameter(size * (1 + offset), "s"),
    }
    return {"parameters": said, "ages": Pair(ages, ages)}


@effect(UNIT_FORCE, 0.5, 5.0, everywhere=True, scalable=False, from_readings=False)
def shock(scene, rng, sensors, size):
    """The board is struck and rings for some 20 ms at 400 Hz, a rigid body.

    Each IMU reads that at an instant of its own in the millisecond before the host's, and the
    motion of the hand, which is slow, as ever. Size is the acceleration of the ringing, m/s^2.
    """
    number = max(2, round(scene.duration * rng.uniform(0.3, 1.0)))
    begin = np.sort(scene.time[0] + rng.random(number) * scene.duration)
    ringing = 2 * np.pi * rng.uniform(350.0, 450.0, number)
    fading = rng.uniform(0.01, 0.03, number)
    push = size * rng.standard_normal((number, 3))
    turn = size / 0.02 * rng.standard_normal((number, 3))  # rad/s^2: as much at 2 cm
    instants = scene.time[:, None] - CLOCK_PERIOD * rng.random((len(scene.time), len(sensors)))
    past = instants[..., None] - begin
    gone = np.maximum(past, 0.0)
    wave = np.where(past > 0, np.exp(-gone / fading) * np.exp(1j * ringing * gone), 0.0)
    force, twist = wave.imag @ push, wave.imag @ turn
    rate = -(wave.real / ringing) @ turn
    arms = scene.positions[list(sensors)]
    said = {"begin": Parameter(begin, "s"), "frequency": Parameter(ringing / (2 * np.pi), "Hz")}
    return {
        "parameters": said,
        "force_error": lambda field: force + np.cross(twist, arms),
        "rate_error": lambda field: rate,
    }
