"""Angular acceleration from the rate's own change: a prior of each sample's omega_dot.

On a small array the gyroscopes know it far better than the accelerometers do; two accelerometers
leave it open about the line that joins them.
"""

import numpy as np

from imuarray.engine.linearise import (
    State,
    TurningPrior,
    polynomial_derivative,
    polynomial_taps,
)
from imuarray.engine.readings import Readings


def turned(readings: Readings, state: State, follows: bool = False) -> State:
    """A state with the slope of its own rate as prior mean of omega_dot.

    The slope is a local sextic's, a quartic's in runs too short for that. The prior's sd is the
    gyroscopes' noise in it, and what a quartic leaves out, as the sextic shows it; in still shorter
    runs all that is known is omega_dot's size. ``follows``: as `TurningPrior` has it.
    """
    rate, quartic = state.motion[:, :3], readings.window
    sextic = 3 * quartic // 4 * 2 + 1
    used = readings.keep[..., 3:] / np.square(readings.sd[:, 1])[:, None]
    noise = 1.0 / np.sqrt(np.maximum(used.sum(axis=1), used.max(initial=0.0)))
    short, spread = _slope(readings, rate, quartic, 4)
    slope, other = _slope(readings, rate, sextic, 6)
    long, left = other > 0, 0.0
    if long.any():
        padded = np.pad(_taps(readings, quartic, 4), (sextic - quartic) // 2)
        both = np.sum((_taps(readings, sextic, 6) - padded) ** 2)  # noise of the difference
        left = max(np.mean((slope - short)[long] ** 2 - both * noise[long] ** 2), 0.0)
        short[long], spread[long] = slope[long], other[long]
    sd = np.sqrt((spread[:, None] * noise) ** 2 + left)
    alone = spread == 0.0  # in runs that are too short: as large as elsewhere
    sd[alone] = np.sqrt(np.mean(short[~alone] ** 2)) if not alone.all() else np.inf
    return state._replace(turning=TurningPrior(short, sd, np.full(len(sd), follows)))


def _taps(readings: Readings, window, degree, place=None) -> np.ndarray:
    """(window,) weights that give the slope at a place, by default the middle; 1/s."""
    place = window // 2 if place is None else place
    return polynomial_taps(window, place, 1, degree) / np.median(np.diff(readings.time))


def _slope(readings: Readings, rate, window, degree) -> tuple[np.ndarray, np.ndarray]:
    """The rate's slope (T, 3), and how noise of one reading shows in it (T,), 1/s; 0 for none."""
    slope = polynomial_derivative(readings.time, readings.run, rate, window, 1, degree)
    sizes = [np.linalg.norm(_taps(readings, window, degree, place)) for place in range(window)]
    first, count = np.unique(readings.run, return_index=True, return_counts=True)[1:]
    begin, length = np.repeat(first, count), np.repeat(count, count)
    place = np.arange(len(rate)) - begin
    left, half = length - 1 - place, window // 2
    place = np.where(place < half, place, np.where(left < half, window - 1 - left, half))
    return slope, np.where(length < window, 0.0, np.array(sizes)[np.clip(place, 0, window - 1)])
