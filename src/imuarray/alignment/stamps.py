"""Stamps that jitter or are rounded, of readings that a sensor makes at an even pace."""

import numpy as np
from scipy.interpolate import make_interp_spline, make_lsq_spline

PACES = 1e9, 60.0, 20.0, 5.0  # s between knots of a pace that changes slowly
RUN = 8.5  # steps, beyond which a gap begins another run
FEWEST = 16  # readings of a run
ROUNDED = 3  # different steps of rounded stamps
FASTEST = 0.75  # quantile of the readings' change, above which stamps show in them


def steadied(time, values, enough: float = 1.0) -> tuple[np.ndarray, float]:
    """Instants (N,) s of readings (N, 3), and how far (rms, s) their stamps ``time`` are off them.

    A smooth function of the readings' numbers, if the readings are rough in it by at most
    ``enough`` times what they are in the stamps: those that a logger rounds or writes late are
    smoother. Else the stamps.
    """
    step = np.median(np.diff(time))
    cuts = np.flatnonzero(np.diff(time) > RUN * step) + 1
    pieces = [_paced(part) for part in np.split(time, cuts)]
    even = np.concatenate(pieces)
    off = float(np.sqrt(np.mean((even - time) ** 2)))
    if (np.diff(even) <= 0).any() or _roughness(even, values) > enough * _roughness(time, values):
        return time, 0.0
    return even, off


def _paced(time) -> np.ndarray:
    """Stamps of a run as a line in the readings' numbers, or a spline where that tells."""
    if len(time) < FEWEST:
        return time
    steps, every = np.diff(time), np.arange(float(len(time)))
    usual = steps[steps < 1.5 * np.median(steps)]
    step = np.mean(usual)
    missed = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(steps / step), 1.0))])
    # Where stamps jitter by half a step, rounding would see gaps that are none.
    tried = [_line(time, number, pace) for number in (every, missed) for pace in PACES]
    lines = [found for _, found in tried[:: len(PACES)]]
    if len(np.unique(np.round(usual, 7))) <= ROUNDED:  # a spline would follow the rounding's jumps
        lines = [found for found in lines if np.abs(found - time).max() <= np.ptp(usual)]
        tried = [(0.0, found) for found in lines[:1]] or tried
    return min(tried, key=lambda one: one[0])[1]


def _line(time, number, pace: float) -> tuple[float, np.ndarray]:
    """Schwarz' criterion, by which each knot has to earn its place, and the instants (N,)."""
    inner = np.arange(1.0, (time[-1] - time[0]) / pace - 0.5) * pace
    inner *= number[-1] / (time[-1] - time[0])
    degree = 3 if len(inner) else 1
    knots = np.concatenate([[0.0] * (degree + 1), inner, [number[-1]] * (degree + 1)])
    found = make_lsq_spline(number, time - time[0], knots, degree, method="norm-eq")(number)
    left = np.mean((time - time[0] - found) ** 2)
    cost = len(time) * np.log(max(left, 1e-20)) + len(knots) * np.log(len(time))
    return float(cost), time[0] + found


def _roughness(time, values) -> float:
    """How far every other reading is off a spline through the rest, where readings change fast."""
    change = np.linalg.norm(np.diff(values, axis=0), axis=1)[:-1:2]
    spline = make_interp_spline(time[::2], values[::2], 3)
    odd = slice(1, 2 * len(change), 2)
    off = np.linalg.norm(values[odd] - spline(time[odd]), axis=1)
    return float(np.median(off[change >= np.quantile(change, FASTEST)]))
