"""Time derivatives of a fitted motion, by local polynomials."""

from functools import cache
from math import factorial

import numpy as np
from scipy.ndimage import correlate1d

from imuarray.engine.readings import Readings, odd_window, run_lengths
from imuarray.engine.settings import SETTINGS
from imuarray.model.effects import Prediction, Slow
from imuarray.motion.state import lever


def derivatives(readings: Readings, motion, positions) -> tuple:
    """Derivatives of a fitted motion (T, ...) that effects look at.

    omega double dot, s dot (T, 3), the ideal readings' second and third derivatives, and these
    over a longer window, which most samples must have about them: a filter undone by noisy ones
    would only amplify their noise. By quartics, whose noise is independent of the residual's.
    """
    rate, turn, force = motion[:, :3], motion[:, 3:6], motion[:, 6:9]
    # an ideal reading is linear in its place: of as many triads as there are axes, and the first
    ideal = np.stack([force, *lever(rate[:, None], turn[:, None], np.eye(3)).swapaxes(0, 1), rate])

    def along(values, order, window=readings.window, ends=None):
        time, run = readings.time, readings.run
        return polynomial_derivative(time, run, values, window, order, ends=ends)

    def both(*how):
        for order in (2, 3):
            first, *arms, turned = along(ideal.swapaxes(0, 1), order, *how).swapaxes(0, 1)
            placed = first[:, None] + np.tensordot(positions, np.stack(arms), 1).swapaxes(0, 1)
            yield Prediction(placed, turned[:, None])

    # at the ends of so long a window a quartic's third derivative has even the wrong sign
    longer, short = odd_window(readings.time, SETTINGS.slow_window), [*both()]
    most = np.mean(run_lengths(readings.run) >= longer) > SETTINGS.most_gaps
    slow = both(longer, 3) if most else short
    return along(rate, 2), along(force, 1), *short, Slow(*slow)


def polynomial_derivative(time, run, values, window, order, degree=4, ends=None) -> np.ndarray:
    """The order-th derivative by local quartics, within runs; the ends use the end's polynomial.

    Zero in runs shorter than the window; ``degree``: of other polynomials, ``ends``: of the ends'.
    """
    step, half = np.median(np.diff(time)), window // 2
    degrees = [degree if ends is None or place == half else ends for place in range(window)]
    taps = np.array([
        polynomial_taps(window, place, order, each) / step**order
        for place, each in enumerate(degrees)
    ])  # fmt: skip
    flat, place = np.reshape(values, (len(values), -1)), np.arange(window)
    out = correlate1d(flat, taps[half], axis=0, mode="constant")
    edges = np.flatnonzero(np.concatenate([[True], np.diff(run) > 0, [True]]))
    first, last = edges[:-1], edges[1:]
    long = last - first >= window
    out[np.repeat(~long, last - first)] = 0.0
    for begin, rows in ((first, slice(half)), (last - window, slice(half + 1, window))):
        whole = begin[long, None] + place
        out[whole[:, rows]] = np.einsum("pw,rwc->rpc", taps[rows], flat[whole], optimize=True)
    return out.reshape(np.shape(values))


@cache
def polynomial_taps(window, place, order, degree) -> np.ndarray:
    """(window,) weights that give a least-squares polynomial's derivative at a place, unit steps.

    Savitzky and Golay's; scipy.signal has them, and is slow to import.
    """
    powers = np.vander(np.arange(window) - place, degree + 1, increasing=True)
    return factorial(order) * np.linalg.pinv(powers)[order]


def no_derivatives(samples, accelerometers) -> tuple:
    """All zero: a motion of which no derivative is known."""
    nothing = np.zeros((samples, 3))
    flat = Prediction(np.zeros((samples, accelerometers, 3)), np.zeros((samples, 1, 3)))
    return nothing, nothing, flat, flat, Slow(flat, flat)
