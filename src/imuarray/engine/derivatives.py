"""Time derivatives of a fitted motion, by local polynomials."""

from math import factorial

import numpy as np

from imuarray.engine.readings import Readings
from imuarray.model.effects import Prediction
from imuarray.motion.state import lever


def derivatives(readings: Readings, motion, positions) -> tuple:
    """omega double dot, s dot and the readings' second and third derivatives, by polynomials.

    Quartics over a short window of the fitted motion, whose noise is independent of the
    residual's; the ideal readings are those of the papers' model.
    """
    rate, turn, force = motion[:, :3], motion[:, 3:6], motion[:, 6:9]
    ideal = lever(rate[:, None], turn[:, None], positions) + force[:, None]

    def along(values, order):
        return polynomial_derivative(readings.time, readings.run, values, readings.window, order)

    second = Prediction(along(ideal, 2), along(rate, 2)[:, None])
    third = Prediction(along(ideal, 3), along(rate, 3)[:, None])
    return along(rate, 2), along(force, 1), second, third


def polynomial_derivative(time, run, values, window, order, degree=4) -> np.ndarray:
    """The order-th derivative by local quartics, within runs; the ends use the end's polynomial.

    Zero in runs shorter than the window; ``degree``: of other polynomials.
    """
    step = np.median(np.diff(time))
    taps = [polynomial_taps(window, place, order, degree) / step**order for place in range(window)]
    out = np.zeros_like(values)
    half = window // 2
    edges = np.flatnonzero(np.concatenate([[True], np.diff(run) > 0, [True]]))
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        if last - first < window:
            continue
        middle = last - window + 1
        out[first + half : last - half] = sum(
            tap * values[first + i : middle + i] for i, tap in enumerate(taps[half])
        )
        for pos in range(half):
            out[first + pos] = np.tensordot(taps[pos], values[first : first + window], 1)
            out[last - half + pos] = np.tensordot(
                taps[half + 1 + pos], values[last - window : last], 1
            )
    return out


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
    return nothing, nothing, flat, flat
