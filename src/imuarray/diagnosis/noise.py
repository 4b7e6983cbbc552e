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
from imuarray.engine.normal import projected_columns, uncorrelated
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
    slopes, correlation = _colour(np.nan_to_num(unit), known)
    passed = 1 + 2 * sum(value * correlation**lag for lag, value in enumerate(AUTOCORRELATION, 1))
    tails = np.nanmean(values**4, axis=-1) / scale**4 - 3.0
    error = np.sqrt(np.maximum(2 + tails, 1.0) * INFLATION / counts) / 2
    sd = readings.sd * np.where(known, scale / np.sqrt(passed), 1.0)
    # beside readings that fit nothing, a triad may come to have the motion for itself
    sd = np.fmax(sd, SETTINGS.least_noise * readings.declared)
    return Noise(sd, error, far.sum(axis=0), expected, slopes, correlation, far)


def _outliers(fast, core) -> np.ndarray:
    """Triad-samples that stand out of their neighbours, (T, N, 2) bool."""
    size = np.abs(np.nan_to_num(fast)) / np.repeat(core, 3, axis=1)
    worst = size.reshape(len(size), -1, 2, 3).max(axis=-1)
    highest = maximum_filter1d(worst, 2 * HALF + 1, axis=0, mode="nearest")
    return few_at_once((worst > SETTINGS.far) & (worst >= highest))


def _colour(unit, known):
    """(slope in sds, AR(1) correlation) from the upper spectrum of each ``known`` triad, (N, 2)."""
    power = np.abs(np.fft.rfft(unit, axis=0)) ** 2
    power = power.reshape(len(power), -1, 2, 3).mean(axis=3)
    found = slope(np.array([power[band].mean(axis=0) for band in _bands(len(unit))[1:]]), len(unit))
    grid = np.linspace(-0.95, 0.98, 194)
    expected = slope(band_powers(grid, len(unit)), len(unit))
    correlation = grid[np.argmin(np.abs(expected[:, None, None] - found), axis=0)]
    found = np.where(known, found, 0.0)
    return found, np.where(np.abs(found) > SETTINGS.coloured, correlation, 0.0)


def _bands(samples):
    """Frequencies in units of the sampling rate, and which are in the two bands."""
    part = np.fft.rfftfreq(samples)
    return part, (part >= SETTINGS.bands[0]) & (part < SETTINGS.bands[1]), part >= SETTINGS.bands[1]


def slope(power, samples: int) -> np.ndarray:
    """Log ratio of the two bands' mean power (2, ...) over a triad's three axes, in its sds."""
    _, *bands = _bands(samples)
    ratio = np.diff(np.log(np.maximum(power, 1e-12)), axis=0)[0]
    return ratio / np.sqrt(sum(1 / (3 * band.sum()) for band in bands))


def band_powers(rho, samples: int) -> np.ndarray:
    """Mean power in the two bands (2, n) of AR(1) noises of unit variance, correlations (n,)."""
    part, *bands = _bands(samples)
    rho = np.asarray(rho)[:, None]
    power = (1 - rho**2) / (1 + rho**2 - 2 * rho * np.cos(2 * np.pi * part))
    return np.array([power[:, band].mean(axis=1) for band in bands])


def passed_on(fit: Fit, triads) -> tuple[np.ndarray, np.ndarray]:
    """(share, alike), each (n, n): what the motion passes on between ``triads`` (n, 2).

    The share of each triad's noise power (columns), its own included, in each one's residual
    (rows); and how much products of neighbouring residuals are correlated between triads. Means
    over some samples: they change as slowly as the motion does.
    """
    imu, kind = triads.T
    rows = (6 * imu + 3 * kind)[:, None] + np.arange(3)
    count, number = len(fit.residual), np.arange(SETTINGS.instants)
    # spread evenly, but at no even steps: readings may be missing at such
    at = np.unique((count * np.mod(number * (np.sqrt(5) - 1) / 2, 1)).astype(int))
    keep = fit.readings.keep.reshape(count, -1)[at]
    basis = fit.basis[at]
    left = (np.eye(basis.shape[1]) - basis @ np.swapaxes(basis, 1, 2)) * keep[:, None]
    every = np.moveaxis(left[:, rows], -1, 0)  # of each reading's noise in the triads' residuals
    unit = uncorrelated(every, basis[:, rows], np.broadcast_to(keep[:, rows], every.shape))
    seen = np.isfinite(unit[0]).sum(axis=(0, 2))
    unit = np.nan_to_num(unit)
    share = np.sum(unit[rows.ravel()] ** 2, axis=(1, 3)).reshape(len(rows), 3, -1).sum(axis=1)
    flat = np.moveaxis(unit, 0, -1).reshape(len(at), rows.size, -1)
    squares = np.sum((flat @ np.swapaxes(flat, 1, 2)) ** 2, axis=0)
    squares = squares.reshape(len(rows), 3, len(rows), 3).sum(axis=(1, 3))
    size = np.sqrt(np.maximum(np.diag(squares), 1e-12))
    return (share / np.maximum(seen, 1)).T, squares / np.outer(size, size)


def slow_power(fit: Fit, noise: Noise) -> np.ndarray:
    """Power (N, 2) of triads' residuals at low frequencies in that of white noise of their sd."""
    out, triads = np.ones(noise.correlation.shape), np.argwhere(observable(fit.readings, fit.basis))
    rho = np.maximum(noise.correlation, 0.0)
    if np.any(rho):
        more = 2 * rho / (1 - rho)
        out[tuple(triads.T)] += passed_on(fit, triads)[0] @ more[tuple(triads.T)]
    return out


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
    mask = fit.described[:, fit.wanted]
    size = int(mask.sum())
    half, states = np.zeros((size, size)), np.zeros((len(triads), 3, size))
    for start in range(0, len(fit.residual), CHUNK):
        part = slice(start, start + CHUNK)
        projected, blocks = projected_columns(fit.whitened[part], fit.basis[part], mask)
        for state, (imu, kind) in zip(states, triads, strict=True):
            axes, rho = slice(3 * kind, 3 * kind + 3), correlation[imu, kind]
            # derivatives of the triad's readings, the motion's share taken out
            seen = -fit.basis[part, 6 * imu : 6 * imu + 6][:, axes] @ projected
            for _, places, block in (item for item in blocks if item[0] == imu):
                seen[..., places] += block[:, axes]
            before = np.empty_like(seen)  # the sum over samples before of rho^lag times theirs
            for now, earlier in zip(seen, before, strict=True):
                earlier[:] = state
                state += now
                state *= rho
            half += seen.reshape(-1, size).T @ before.reshape(-1, size)
    return half
