"""Readings of one sensor at other instants: splines, what they leave out, and how far they err.

Readings are carried over by splines of fifth degree (Unser, Sampling - 50 years after Shannon,
2000, gives the error of a spline for a sinusoid that `interpolation_error` sums over a spectrum).
"""

from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.interpolate import BSpline, make_interp_spline, make_lsq_spline

from imuarray.alignment.settings import SETTINGS
from imuarray.recording.record import pieces


@dataclass(frozen=True, eq=False)
class Sensor:
    """Readings of one triad: values (N, 3) at time (N,) s, railed (N, 3) bool, and its noise sd.

    ``jitter`` s: how far (rms) stamps are off these instants.
    """

    name: str
    time: np.ndarray
    jitter: float
    values: np.ndarray
    railed: np.ndarray
    noise_sd: float
    spectra: dict = field(default_factory=dict, init=False)  # by segment, as far as asked for

    @cached_property
    def step(self) -> float:
        """s, between readings where none is missing."""
        steps = np.diff(self.time)
        # a mean: stamps may be rounded
        return float(np.mean(steps[steps < 1.5 * np.median(steps)]))

    @cached_property
    def even(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Runs at even steps, gaps filled by the spline: values, and which are railed."""
        found = []
        for run in self.runs(SETTINGS.widest + 0.5):
            time, values, railed = self.time[run], self.values[run], self.railed[run]
            if len(time) > 2 * SETTINGS.degree and (np.diff(time) > 1.5 * self.step).any():
                at = np.arange(time[0], time[-1], self.step)
                nearest = np.searchsorted((time[1:] + time[:-1]) / 2, at)
                values, railed = _spline(time, values)(at), railed[nearest]
            found.append((values, railed))
        return found

    def spectrum(self, segment: int) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies (F,) in cycles a reading, and the power of motion (S, F) in moving pieces.

        In units of the readings squared, summed over axes; all frequencies add up to it.
        ``segment`` readings a piece, fewer where no run has as many.
        """
        segment = min(segment, max(len(values) for values, _ in self.even))
        whole = [pair for pair in self.even if len(pair[0]) >= segment]
        window = np.kaiser(segment, 14.0)  # leaks less than 1e-10: fast motion beside little noise
        pieces, railed = (
            np.concatenate([sliding_window_view(x, segment, axis=0)[:: segment // 2] for x in part])
            for part in zip(*whole, strict=True)
        )
        railed = railed.any(axis=(1, 2))  # a rail's corners are not the motion's
        pieces = pieces[~railed | railed.all()]
        pieces = (pieces - pieces.mean(axis=-1, keepdims=True)) * window
        power = 2 * np.sum(np.abs(np.fft.rfft(pieces)) ** 2, axis=1) / segment / np.sum(window**2)
        frequency = np.fft.rfftfreq(segment)
        noise = 6 * self.noise_sd**2 / segment
        quiet = np.argsort(power.sum(axis=1))[: len(power) // 4 + 1]
        level = np.clip(power[quiet][:, frequency > 0.4].mean(), noise, SETTINGS.noisy**2 * noise)
        moving = power.sum(axis=1) > SETTINGS.moving**2 * level * len(frequency)
        return frequency, power[moving] - level

    def runs(self, longest: float) -> list[slice]:
        """Slices of readings no further apart than ``longest`` usual steps."""
        return pieces(np.diff(self.time) > longest * self.step)

    def error(self, spacing: float) -> float:
        """Rms of what a spline of knots ``spacing`` seconds apart misses, one axis, in motion."""
        # the window widens what is slow by 4.6 / segment, which must be little beside the knots
        segment = SETTINGS.segment * max(round(spacing / self.step / 2), 1)
        if segment not in self.spectra:
            self.spectra[segment] = self.spectrum(segment)
        frequency, power = self.spectra[segment]
        if not len(power):
            return 0.0
        missed = power @ spline_error(frequency * spacing / self.step)
        missed = np.sort(missed)[: len(missed) - int(SETTINGS.shocks * len(missed))]
        return float(np.sqrt(max(missed.mean(), 0.0) / 3))

    @cached_property
    def longest(self) -> float:
        """Usual steps between neighbours that the motion is slow enough to bridge."""
        steps = range(2, SETTINGS.widest + 1)
        allowed = (n for n in steps if self.error(n * self.step) < self.noise_sd)
        return 0.5 + max(allowed, default=1)

    def near_rail(self, at, spacing: float = 0.0) -> np.ndarray:
        """Where (T, 3) a railed reading shows at ``at`` (T,), with knots ``spacing`` s apart."""
        reach = SETTINGS.reach * max(self.step, spacing)
        found = np.zeros((len(at), 3), bool)
        for axis in range(3):
            railed = self.time[self.railed[:, axis]]
            if len(railed):
                nearest = railed[np.searchsorted((railed[1:] + railed[:-1]) / 2, at)]
                found[:, axis] = np.abs(nearest - at) < reach
        return found


def spline_error(frequency) -> np.ndarray:
    """Mean square error, over phases, of a sinusoid of power 1 at cycles a knot (F,)."""
    inside = np.minimum(frequency, 0.5)
    images = inside[:, None] + np.arange(-8, 9)
    basis = np.sinc(images) ** (SETTINGS.degree + 1)
    response = basis / basis.sum(axis=1, keepdims=True)
    response[:, 8] -= 1.0
    return np.where(frequency > 0.5, 1.0, np.sum(response**2, axis=1))


class Splines:
    """Through the runs of a sensor; by least squares on ``knots`` (K,) s where given."""

    def __init__(self, sensor: Sensor, values=None, knots=None):
        values = sensor.values if values is None else values
        self.parts: list[tuple[float, float, BSpline]] = []
        for run in sensor.runs(sensor.longest):
            time = sensor.time[run]
            if len(time) > 2 * SETTINGS.degree:
                spline = _spline(time, values[run], knots)
                self.parts.append((time[0], time[-1], spline))

    def __call__(self, at, order: int = 0) -> np.ndarray:
        """The ``order``-th derivative at ``at`` (T,), (T, 3), NaN where there is none."""
        found = np.full((len(at), 3), np.nan)
        for first, last, spline in self.parts:
            inside = slice(*np.searchsorted(at, [first, np.nextafter(last, np.inf)]))
            found[inside] = spline(at[inside], order)
        return found


def _spline(time, values, knots=None) -> BSpline:
    """Through a run, or by least squares on the knots that are within it."""
    inner = np.zeros(0) if knots is None else knots[(knots > time[0]) & (knots < time[-1])][2:-2]
    if len(inner):
        # a reading between neighbours, or nothing determines the spline there
        inner = inner[np.unique(np.searchsorted(time, inner), return_index=True)[1]]
        ends = [np.full(SETTINGS.degree + 1, end) for end in (time[0], time[-1])]
        knots = np.concatenate([ends[0], inner, ends[1]])
        with suppress(np.linalg.LinAlgError):  # where readings are missing, too little still does
            return make_lsq_spline(time, values, knots, SETTINGS.degree, method="norm-eq")
    return make_interp_spline(time, values, SETTINGS.degree)
