"""The noise of each triad: scale, colour and outliers, separated from smooth misfit.

Misfit that the motion causes is smooth in time, noise is not: fourth differences and the upper
half of the spectrum show the noise whatever the means get wrong.
"""

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from imuarray.diagnosis.fit import Fit
from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.linearise import CHUNK, THREADS, leverage_of
from imuarray.engine.normal import projected_columns
from imuarray.engine.readings import Readings, by_triad, few_at_once
from imuarray.engine.settings import SETTINGS as ENGINE
from imuarray.tails import QUARTILE, log_normal

DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / np.sqrt(70.0)
HALF = len(DIFFERENCE) // 2
# autocorrelations of differenced white noise at lags 1 ... 4
AUTOCORRELATION = np.correlate(DIFFERENCE, DIFFERENCE, "full")[len(DIFFERENCE) :]
# differences for one independent value in a mean square
INFLATION = float(1 + 2 * np.sum(AUTOCORRELATION**2))


class Noise(NamedTuple):
    """Noise of each triad by the fast part of the residual; arrays are (N, 2)."""

    sd: np.ndarray  # noise sd, m/s^2 and rad/s
    error: np.ndarray  # relative standard error of it
    outliers: np.ndarray  # isolated far triad-samples
    expected: np.ndarray  # of them in Gaussian noise
    slope: np.ndarray  # log ratio of the top bands' power, in its sds
    correlation: np.ndarray  # of the AR(1) that has this slope, 0 where it is not significant
    far: np.ndarray  # (T, N, 2) bool, the outliers


def fast_part(values, run) -> np.ndarray:
    """Fourth differences centred on each sample (T, ...), unit gain for white noise.

    NaN where the five samples are not in one run, or any is NaN.
    """
    out = np.full(values.shape, np.nan)
    inner = len(values) - 2 * HALF
    out[HALF : HALF + inner] = sum(tap * values[i : i + inner] for i, tap in enumerate(DIFFERENCE))
    broken = run[2 * HALF :] != run[: -2 * HALF]
    out[HALF : HALF + inner][broken] = np.nan
    return out


def per_triad(values) -> np.ndarray:
    """(T, N, 6) as (N, 2, 3 T): a triad's samples and axes together."""
    moved = values.reshape(len(values), -1, 2, 3)
    return np.moveaxis(moved, 0, -1).reshape(moved.shape[1], 2, -1)


def standardised(fit: Fit) -> np.ndarray:
    """Residuals of unit variance where noise is as assumed (T, N, 6), NaN where left out."""
    return to_unit(fit.readings, fit.residual, fit.basis)


def observable(readings: Readings, basis) -> np.ndarray:
    """Triads (N, 2) bool whose noise a residual shows: a lone gyroscope has the motion for itself.

    ``basis`` (T, 6 N, D) of the motion.
    """
    free = by_triad(np.where(readings.keep, 1.0 - leverage_of(basis), 0.0)).sum(axis=0)
    return readings.exists & (free > ENGINE.least_free * by_triad(readings.keep).sum(axis=0))


def to_unit(readings: Readings, residual, basis) -> np.ndarray:
    """Residual of unit variance from residual (T, N, 6) and the motion's basis (T, 6 N, D)."""
    share = np.sqrt(np.maximum(1.0 - leverage_of(basis), 1e-6))
    return np.where(readings.keep, residual / share, np.nan)


def estimated(readings: Readings, residual, basis) -> Noise:
    """The noise of each triad from a residual (T, N, 6) and the motion's basis (T, 6 N, D)."""
    known = observable(readings, basis)
    unit = np.where(np.repeat(known, 3, axis=1), to_unit(readings, residual, basis), np.nan)
    fast = fast_part(unit, readings.run)
    values = np.where(known[..., None], per_triad(fast), 1.0)
    counts = np.maximum(np.sum(np.isfinite(values), axis=-1), 1)
    core = np.maximum(np.nanmedian(np.abs(values), axis=-1) / QUARTILE, 1e-12)
    scale = np.maximum(np.sqrt(np.nanmean(values**2, axis=-1)), 1e-12)
    far = _outliers(fast, core)
    expected = 2 * np.exp(log_normal(SETTINGS.far)) * counts
    slope, correlation = _colour(np.nan_to_num(unit), known)
    passed = 1 + 2 * sum(value * correlation**lag for lag, value in enumerate(AUTOCORRELATION, 1))
    tails = np.nanmean(values**4, axis=-1) / scale**4 - 3.0
    error = np.sqrt(np.maximum(2 + tails, 1.0) * INFLATION / counts) / 2
    sd = readings.sd * np.where(known, scale / np.sqrt(passed), 1.0)
    # beside readings that fit nothing, a triad may come to have the motion for itself
    sd = np.fmax(sd, SETTINGS.least_noise * readings.declared)
    return Noise(sd, error, far.sum(axis=0), expected, slope, correlation, far)


def _outliers(fast, core) -> np.ndarray:
    """Triad-samples that stand out of their neighbours, (T, N, 2) bool."""
    size = np.abs(np.nan_to_num(fast)) / np.repeat(core, 3, axis=1)
    worst = size.reshape(len(size), -1, 2, 3).max(axis=-1)
    highest = maximum_filter1d(worst, 2 * HALF + 1, axis=0, mode="nearest")
    return few_at_once((worst > SETTINGS.far) & (worst >= highest))


def _colour(unit, known):
    """(slope in sds, AR(1) correlation) from the upper spectrum of each ``known`` triad, (N, 2)."""
    power = np.abs(np.fft.rfft(unit, axis=0)) ** 2
    part, low, high = _bands(len(unit))
    bands = [power[band].reshape(band.sum(), -1, 2, 3) for band in (low, high)]
    means = [np.maximum(b.mean(axis=(0, 3)), 1e-12) for b in bands]
    ratio = np.log(means[1] / means[0])
    error = _slope_error(low, high)
    slope = np.where(known, ratio / error, 0.0)
    grid = np.linspace(-0.95, 0.98, 194)
    expected = np.array([_ar_ratio(rho, part[low], part[high]) for rho in grid])
    correlation = grid[np.argmin(np.abs(expected[:, None, None] - ratio), axis=0)]
    return slope, np.where(np.abs(slope) > SETTINGS.coloured, correlation, 0.0)


def _bands(samples):
    """Frequencies in units of the sampling rate, and which are in the two bands."""
    part = np.fft.rfftfreq(samples)
    return part, (part >= SETTINGS.bands[0]) & (part < SETTINGS.bands[1]), part >= SETTINGS.bands[1]


def _slope_error(low, high) -> float:
    """sd of the log ratio of two bands' mean power over a triad's three axes."""
    return float(np.sqrt(1 / (3 * low.sum()) + 1 / (3 * high.sum())))


def expected_ratio(rho: float, samples: int) -> float:
    """The slope, in its sds, that an AR(1) of this correlation has."""
    part, low, high = _bands(samples)
    return _ar_ratio(rho, part[low], part[high]) / _slope_error(low, high)


def _ar_ratio(rho, low, high) -> float:
    """Expected log ratio of the two bands' mean power for an AR(1)."""
    power = [1 / (1 + rho**2 - 2 * rho * np.cos(2 * np.pi * f)) for f in (low, high)]
    return float(np.log(power[1].mean() / power[0].mean()))


def coloured_meat(fit: Fit, information, correlation) -> np.ndarray | None:
    """Covariance of the score (K, K) where triads have AR(1) noise; None where all is white."""
    if not np.any(correlation):
        return None
    triads = np.argwhere(correlation != 0)
    shares = np.array_split(triads, min(THREADS, len(triads)))
    with ThreadPoolExecutor(THREADS) as pool:
        halves = list(pool.map(partial(_with_former, fit, correlation), shares))
    meat = information + sum(half + half.T for half in halves)
    return (meat + meat.T) / 2


def _with_former(fit: Fit, correlation, triads) -> np.ndarray:
    """Covariance (K, K) of some triads' scores with those of all samples before."""
    from scipy.signal import lfilter  # slow to import, and seldom needed

    mask = fit.described[:, fit.wanted]
    size = int(mask.sum())
    half, states = np.zeros((size, size)), np.zeros((len(triads), 1, 3, size))
    for start in range(0, len(fit.residual), CHUNK):
        part = slice(start, start + CHUNK)
        projected, blocks = projected_columns(fit.whitened[part], fit.basis[part], mask)
        for number, (imu, kind) in enumerate(triads):
            axes, rho = slice(3 * kind, 3 * kind + 3), correlation[imu, kind]
            # derivatives of the triad's readings, the motion's share taken out
            seen = -fit.basis[part, 6 * imu : 6 * imu + 6][:, axes] @ projected
            for _, places, block in (item for item in blocks if item[0] == imu):
                seen[..., places] += block[:, axes]
            # the sum over samples before of rho^lag times theirs
            before, states[number] = lfilter(
                [0.0, rho], [1.0, -rho], seen, axis=0, zi=states[number]
            )
            half += seen.reshape(-1, size).T @ before.reshape(-1, size)
    return half
