"""Angular acceleration from the rate's own change: a prior of each sample's omega_dot.

On a small array the gyroscopes know it far better than the accelerometers do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imuarray.engine.estimate import Recorded
from imuarray.engine.linearise import polynomial_derivative, quartic_taps
from imuarray.engine.readings import Readings


def turned(one: Recorded) -> Recorded:
    """A recording with the slope of the rate that was fitted as prior mean of omega_dot.

    Its sd is the gyroscopes' noise, and what a quartic over so many samples may leave out, as one
    over twice as many shows it. For runs of a derivative's window at least.
    """
    readings, rate = one.readings, one.state.motion[:, :3]
    used = readings.keep[..., 3:] / np.square(readings.sd[:, 1])[:, None]
    noise = 1.0 / np.sqrt(np.maximum(used.sum(axis=1), used.max(initial=0.0)))
    near, spread = _slope(readings, rate, readings.window)
    wide, other = _slope(readings, rate, 2 * readings.window + 1)
    # a quartic's error goes with the fourth power of its length
    left = np.mean((wide - near) ** 2 - (spread**2 + other**2)[:, None] * noise**2) / 2.0**8
    sd = np.sqrt((spread[:, None] * noise) ** 2 + max(left, 0.0))
    return replace(one, state=one.state._replace(turning=(near, sd)))


def _slope(readings: Readings, rate, window) -> tuple[np.ndarray, np.ndarray]:
    """The rate's slope (T, 3), and how noise of one reading shows in it (T,), 1/s."""
    slope = polynomial_derivative(readings.time, readings.run, rate, window, 1)
    sizes = np.array([np.sqrt(np.sum(quartic_taps(window, k, 1) ** 2)) for k in range(window)])
    first, count = np.unique(readings.run, return_index=True, return_counts=True)[1:]
    begin, length = np.repeat(first, count), np.repeat(count, count)
    place = np.arange(len(rate)) - begin
    left, half = length - 1 - place, window // 2
    place = np.where(place < half, place, np.where(left < half, window - 1 - left, half))
    size = np.where(length < window, 0.0, sizes[np.clip(place, 0, window - 1)])
    return slope, size / np.median(np.diff(readings.time))
