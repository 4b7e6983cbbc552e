"""Effects on the noise itself: its scale, its tails, its colour, named at the end of a search."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, norm

from imuarray.criticism.fit import Fit
from imuarray.criticism.noise import Noise, standardised, tail_log_p
from imuarray.criticism.scores import log_tail

KINDS = ("accelerometer", "gyroscope")
UNITS = ("m s-2", "rad s-1")


class Named(NamedTuple):
    """A cause in the noise: whose, log p, numbers and their meaning."""

    effect: str
    imus: tuple[int, ...]
    log_p: float
    parameters: dict  # name -> (value, sd, unit)
    gain: float  # nats against white Gaussian noise of the declared sd
    gain_se: float


class Mixture(NamedTuple):
    """Two zero-mean normals for a triad's residual: a share is ``factor`` times as large."""

    share: float
    factor: float
    core: float  # sd of the rest, in assumed sds
    outlier: np.ndarray  # (T,) probability of being of the share


def _hits(z, exists, limit):
    """(triads far from zero, log p of worst or all) for standard normals z (N,)."""
    there = np.flatnonzero(exists)
    single = norm.logsf(np.abs(z[there])) + np.log(2)
    pooled = log_tail(float(np.sum(z[there] ** 2)), len(there))
    log_p = min(single.min() + np.log(2 * len(there)), pooled + np.log(2))
    level = limit + np.log(2) if pooled < single.min() + np.log(len(there)) else limit
    return [
        int(k) for k, p in zip(there, single, strict=True) if p + np.log(len(there)) < level
    ], log_p


def noise_scale(fit: Fit, noise: Noise, kind: int, limit: float, without=()) -> Named | None:
    """A triad's (0 accelerometer, 1 gyroscope) noise against the declared one, or None."""
    readings = fit.readings
    ratio = noise.sd[:, kind] / readings.declared[:, kind]
    z = np.log(ratio) / noise.error[:, kind]
    exists = readings.exists[:, kind].copy()
    exists[list(without)] = False
    if not exists.any():
        return None
    hits, log_p = _hits(z, exists, limit)
    if log_p > limit:
        return None
    imus = hits or [int(k) for k in np.flatnonzero(exists)]
    squares = np.sum(standardised(fit)[:, imus, 3 * kind : 3 * kind + 3] ** 2, axis=2)
    scale = readings.sd[imus, kind] / readings.declared[imus, kind]
    nats = np.nansum(squares * (scale**2 - 1) / 2 - 3 * np.log(scale), axis=1)
    name = f"{KINDS[kind]}_noise"
    numbers = {
        f"ratio_{readings.labels[k]}": (
            float(ratio[k]),
            float(ratio[k] * noise.error[k, kind]),
            "1",
        )
        for k in imus
    }
    return Named(name, tuple(imus), float(log_p), numbers, *_gain(nats))


def _gain(nats, blocks=10):
    """Sum over samples with the standard error that blocks of time show."""
    parts = [part.sum() for part in np.array_split(nats, blocks)]
    return float(np.sum(parts)), float(np.std(parts, ddof=1) * np.sqrt(blocks))


def mixture(fit: Fit, imu: int, kind: int, steps=100) -> Mixture:
    """EM for a triad's standardised residual, its three axes together."""
    unit = standardised(fit)[:, imu, 3 * kind : 3 * kind + 3]
    axes = np.sum(np.isfinite(unit), axis=1)
    square = np.nansum(unit**2, axis=1)
    core = max(float(np.nanmedian(np.abs(unit)) / norm.ppf(0.75)), 1e-6)
    share, factor = 0.02, 8.0
    for _ in range(steps):
        odds = np.log(share / (1 - share)) - axes * np.log(factor)
        odds = odds + square / (2 * core**2) * (1 - 1 / factor**2)
        outlier = 1 / (1 + np.exp(-np.clip(odds, -500, 500)))
        outlier[axes == 0] = 0.0
        weight = np.maximum(np.sum(outlier * axes), 1e-9)
        share = np.clip(np.sum(outlier[axes > 0]) / max(np.sum(axes > 0), 1), 1e-5, 0.5)
        core = np.sqrt(np.sum((1 - outlier) * square) / max(np.sum((1 - outlier) * axes), 1))
        factor = max(np.sqrt(np.sum(outlier * square) / weight) / core, 2.0)
    return Mixture(float(share), float(factor), float(core), outlier)


def heavy_tails(fit: Fit, noise: Noise, limit: float):
    """(Named or None, triads (n, 2)) with more outliers than Gaussian noise has."""
    triads = np.argwhere(fit.readings.exists)
    logs = tail_log_p(noise)
    log_p = np.array([logs[tuple(t)] for t in triads]) + np.log(len(triads))
    if log_p.min() > limit:
        return None, triads[:0]
    hit = triads[log_p < limit]
    found = [mixture(fit, *triad) for triad in hit]
    nats = np.zeros(len(fit.residual))
    numbers = {}
    for (imu, kind), mix in zip(hit, found, strict=True):
        name = f"{KINDS[kind]}_{fit.readings.labels[imu]}"
        count = len(fit.residual)
        error = float(np.sqrt(mix.share * (1 - mix.share) / count))
        numbers[f"share_{name}"] = (mix.share, error, "1")
        few = max(3 * mix.share * count, 1.0)
        numbers[f"factor_{name}"] = (mix.factor, float(mix.factor / np.sqrt(2 * few)), "1")
        nats += _tail_nats(fit, imu, kind, mix)
    imus = tuple(sorted({int(imu) for imu, _ in hit}))
    return Named("heavy_tails", imus, float(log_p.min()), numbers, *_gain(nats)), hit


def _tail_nats(fit: Fit, imu, kind, mix: Mixture) -> np.ndarray:
    """Log density of the mixture less that of a normal of the same variance, by sample."""
    unit = standardised(fit)[:, imu, 3 * kind : 3 * kind + 3]
    axes, square = np.sum(np.isfinite(unit), axis=1), np.nansum(unit**2, axis=1)
    sds = (mix.core, mix.core * mix.factor)
    logs = [-axes * np.log(sd) - square / (2 * sd**2) for sd in sds]
    both = np.logaddexp(np.log1p(-mix.share) + logs[0], np.log(mix.share) + logs[1])
    plain = np.sqrt(np.sum(square) / max(np.sum(axes), 1))
    return both - (-axes * np.log(plain) - square / (2 * plain**2))


def coloured(fit: Fit, noise: Noise, limit: float) -> Named | None:
    """Noise correlated in time: a spectrum that is not flat above the motion's frequencies."""
    exists = noise.correlation != 0
    if not exists.any():
        return None
    number = fit.readings.exists.sum()
    single = norm.logsf(np.abs(noise.slope)) + np.log(2 * number)
    log_p = float(single[exists].min())
    hits = np.argwhere(exists & (single < limit))
    if log_p > limit or not len(hits):
        return None
    numbers, nats = {}, np.zeros(len(fit.residual))
    step = float(np.median(np.diff(fit.readings.time)))
    unit = np.nan_to_num(standardised(fit))
    for imu, kind in hits:
        rho = float(noise.correlation[imu, kind])
        name = f"{KINDS[kind]}_{fit.readings.labels[imu]}"
        error = abs(rho / noise.slope[imu, kind])
        numbers[f"correlation_{name}"] = (rho, float(error), "1")
        if rho > 0:
            time = -step / np.log(rho)
            numbers[f"correlation_time_{name}"] = (time, time * error / (rho * -np.log(rho)), "s")
        values = unit[:, imu, 3 * kind : 3 * kind + 3]
        values = values / max(values.std(), 1e-9)
        jump = (values[1:] - rho * values[:-1]) ** 2 / (1 - rho**2)
        nats[1:] += np.sum(values[1:] ** 2 - jump - np.log1p(-(rho**2)), axis=1) / 2
    imus = tuple(sorted({int(imu) for imu, _ in hits}))
    return Named("coloured_noise", imus, log_p, numbers, *_gain(nats))


__all__ = ["Mixture", "Named", "chi2", "coloured", "heavy_tails", "mixture", "noise_scale"]
