"""Effects on the noise itself: its scale, its tails, its colour, named at the end of a search."""

from typing import NamedTuple

import numpy as np

from imuarray.diagnosis.fit import Fit
from imuarray.diagnosis.noise import Noise, band_powers, observable, passed_on, slope
from imuarray.diagnosis.reading_effects import Finding
from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.heldout import blocks_of, summed
from imuarray.engine.normal import uncorrelated
from imuarray.model.effects import KINDS
from imuarray.tails import QUARTILE, log_chi_square, log_normal

TAILS, COLOURED = "heavy_tails", "coloured_noise"
SCALES = tuple(f"{kind}_noise" for kind in KINDS)


class Colours(NamedTuple):
    """Autocorrelation of the n triads that show their noise."""

    triads: np.ndarray  # (n, 2) IMU, kind
    seen: np.ndarray  # (n,) of the residual's neighbouring samples
    rho: np.ndarray  # (n,) of the noise's own, without what the motion passes on of others'
    pairs: np.ndarray  # (n,) of independent ones that would show it as well
    alike: np.ndarray  # (n, n) correlation of their errors
    slope: np.ndarray  # (n,) of the spectrum, as `Noise` has it
    implied: np.ndarray  # (n,) of the residual's, where all triads have AR(1) noise
    power: np.ndarray  # (n,) of the noise, in that of the sd in use

    @property
    def square(self) -> np.ndarray:
        """(n,) of the correlations in their sds."""
        return self.rho**2 * self.pairs

    def pooled(self, chosen) -> float:
        """log p of the ``chosen`` (n,) bool correlations together."""
        number = max(int(chosen.sum()), 1)
        alike = max(np.sum(self.alike[np.ix_(chosen, chosen)] ** 2) / number, 1.0)
        total = float(np.sum(self.square[chosen]))
        return log_chi_square(max(total / alike, 1e-9), number / alike)  # Satterthwaite's


class Mixture(NamedTuple):
    """Two zero-mean normals for a triad's residual: a share is ``factor`` times as large."""

    share: float
    factor: float
    core: float  # sd of the rest, in assumed sds
    outlier: np.ndarray  # (T,) probability of being of the share
    nats: np.ndarray  # (T,) log likelihood above a single normal's


def triad(fit: Fit, imu: int, kind: int) -> np.ndarray:
    """A triad's residual (T, 3) as three uncorrelated ones of unit variance, NaN where left out."""
    rows, own = slice(6 * imu + 3 * kind, 6 * imu + 3 * kind + 3), slice(3 * kind, 3 * kind + 3)
    keep = fit.readings.keep[:, imu, own]
    return uncorrelated(fit.residual[:, imu, own], fit.basis[:, rows], keep)


def held_out(nats) -> tuple[float, float, np.ndarray]:
    """Sum over samples, the standard error that blocks of time show, and the blocks' sums."""
    parts = np.array([nats[block].sum() for block in blocks_of(len(nats))])
    return *summed(parts), parts


def verdict(log_ratio, covariance, limit):
    """(places far from zero, log p of the worst or of all) for normals (n,) of a covariance."""
    number = len(log_ratio)
    single = log_normal(np.abs(log_ratio) / np.sqrt(np.diag(covariance))) + np.log(2)
    inverse = np.linalg.pinv(covariance, SETTINGS.least_share, hermitian=True)
    freedom = int(np.linalg.matrix_rank(covariance, hermitian=True, rtol=SETTINGS.least_share))
    pooled = log_chi_square(float(log_ratio @ inverse @ log_ratio), freedom)
    log_p = min(single.min() + np.log(2 * number), pooled + np.log(2), 0.0)
    far = single + np.log(number) < limit
    rest = np.flatnonzero(~far)
    if far.any() and len(rest):  # all places, where those beside the far ones are not at zero
        own = log_ratio[rest] @ np.linalg.solve(covariance[np.ix_(rest, rest)], log_ratio[rest])
        far |= log_chi_square(float(own), len(rest)) < SETTINGS.others
    return np.flatnonzero(far), float(log_p)


def autocorrelation(fit: Fit, imu: int, kind: int) -> tuple[float, int]:
    """(lag-one autocorrelation, number of pairs) of a triad's residual."""
    unit = triad(fit, imu, kind)
    together = (np.diff(fit.readings.run) == 0)[:, None]
    pairs = np.where(together, unit[1:] * unit[:-1], np.nan)
    return float(np.nanmean(pairs) / np.nanmean(unit**2)), int(np.isfinite(pairs).sum())


def colours(fit: Fit, noise: Noise) -> Colours:
    """Colours of a fit's residual, without what the common motion passes from triad to triad.

    A triad that the others hardly check shows no colour.
    """
    known = observable(fit.readings, fit.basis)
    triads = np.argwhere(known)
    seen, pairs = np.array([autocorrelation(fit, *pair) for pair in triads]).T
    power = np.array([np.nanmean(triad(fit, *pair) ** 2) for pair in triads])
    seen, power = np.where(pairs > 0, seen, 0.0), np.where(pairs > 0, power, 1.0)
    (passed, alike), count = passed_on(fit, triads), len(fit.residual)
    back = np.linalg.pinv(passed, SETTINGS.least_passed)
    told = (np.diag(back @ passed) > SETTINGS.told) & (pairs > 0)
    own = np.maximum(1 + back @ (power - 1), SETTINGS.least_passed * power)
    own = np.where(told, own, power)
    rho = np.where(told, back @ (power * seen) / own, 0.0)
    rho = np.clip(rho, -SETTINGS.most_alike, SETTINGS.most_alike)
    spread = back * power / np.sqrt(np.maximum(pairs, 1)) / own[:, None]
    covariance = spread @ alike @ spread.T
    error = np.sqrt(np.maximum(np.diag(covariance), 1e-12))
    implied = slope((own * band_powers(rho, count)) @ passed.T, count)
    return Colours(
        triads, seen, rho, np.where(told, np.minimum(error**-2, pairs), 0.0),
        covariance / np.outer(error, error), noise.slope[known], implied, own,
    )  # fmt: skip


def whole_scales(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """(log ratio to the sd in use (n,), covariance (n, n)) of the n triads that show their noise.

    One step of restricted maximum likelihood: the residual's squares against what the motion
    leaves of them, and the information of all triads' variances together.
    """
    readings = fit.readings
    samples, count = fit.residual.shape[:2]
    score, information = np.zeros(2 * count), np.zeros((2 * count, 2 * count))
    kept = readings.keep.reshape(samples, -1).astype(float)
    for start in range(0, samples, 256):
        part = slice(start, start + 256)
        basis, mask = fit.basis[part], kept[part]
        left = -np.einsum("tri,tsi->trs", basis, basis)
        rows = np.arange(left.shape[1])
        left[:, rows, rows] += mask
        left *= mask[:, :, None] * mask[:, None, :]
        squares = np.sum(left**2, axis=0).reshape(2 * count, 3, 2 * count, 3)
        information += 2 * squares.sum(axis=(1, 3))
        surplus = fit.residual[part].reshape(-1, 6 * count) ** 2 * mask - left[:, rows, rows]
        score += surplus.sum(axis=0).reshape(2 * count, 3).sum(axis=1)
    known = observable(readings, fit.basis)
    there = known.ravel()
    # of two triads of a kind, how much of their difference is either's is not seen
    covariance = np.linalg.pinv(
        information[np.ix_(there, there)], SETTINGS.least_share, hermitian=True
    )
    wide = np.array([_width(fit, int(i), int(k)) for i, k in np.argwhere(known)])
    return covariance @ score[there], covariance * np.outer(wide, wide)


def _width(fit: Fit, imu: int, kind: int) -> float:
    """By how much a scale's error exceeds that of white normal noise."""
    unit = triad(fit, imu, kind)
    tails = np.nanmean(unit**4) / np.nanmean(unit**2) ** 2 - 1.0
    rho = autocorrelation(fit, imu, kind)[0]
    return float(np.sqrt(max(tails / 2, 1.0) * (1 + rho**2) / (1 - rho**2)))


def scales(fit: Fit, noise: Noise, untied: bool) -> tuple[np.ndarray, np.ndarray]:
    """(log ratio to the declared sd (n,), covariance (n, n)) of the n triads that show their noise.

    From the whole residual where that agrees with its fast part, or where nothing ties it to the
    motion (``untied``) and its spectrum is that of its own colour; else from the fast part, which
    smooth misfit does not reach.
    """
    there = observable(fit.readings, fit.basis)
    whole, covariance = whole_scales(fit)
    whole = whole + np.log(fit.readings.sd / fit.readings.declared)[there]
    fast = np.log(noise.sd / fit.readings.declared)[there]
    spread, rough = np.diag(covariance), noise.error[there] ** 2
    apart = np.sqrt(np.maximum(rough - spread, spread))
    agree = (noise.correlation[there] != 0) | (np.abs(whole - fast) < SETTINGS.agree * apart)
    if untied:
        own = colours(fit, noise)
        agree |= np.abs(own.slope - own.implied) < SETTINGS.agree
    own = np.diag(np.where(agree, spread, rough))
    covariance = np.where(np.outer(agree, agree), covariance, own)
    return np.where(agree, whole, fast), covariance


def noise_scale(fit: Fit, noise: Noise, kind: int, limit, least, untied=True) -> Finding | None:
    """The noise of a kind's triads against the declared one, or None.

    ``least`` (N,) log ratios below which a departure is not believed.
    """
    readings = fit.readings
    pairs = np.argwhere(observable(readings, fit.basis))
    log_ratio, covariance = scales(fit, noise, untied)
    chosen = np.flatnonzero((pairs[:, 1] == kind) & (np.abs(log_ratio) > least[pairs[:, 0]]))
    if not len(chosen):
        return None
    tested = covariance[np.ix_(chosen, chosen)]
    if readings.left is not None:  # the correction scaled each triad's noise, and declared one
        tested = tested + SETTINGS.pooled**2 * np.eye(len(chosen))
    hits, log_p = verdict(log_ratio[chosen], tested, limit)
    log_p += np.log(np.sum(pairs[:, 1] == kind) / len(chosen))
    if log_p > limit:
        return None
    chosen = chosen[hits] if len(hits) else chosen
    nats, numbers = np.zeros(len(fit.residual)), {}
    for place in chosen:
        imu = pairs[place, 0]
        square = np.nan_to_num(triad(fit, imu, kind)) ** 2
        bare = readings.declared[imu, kind] / readings.sd[imu, kind]
        own = np.exp(log_ratio[place]) * bare
        nats += np.sum(square / bare**2 - square / own**2, axis=1) / 2 - 3 * np.log(own / bare)
        ratio = float(np.exp(log_ratio[place]))
        error = ratio * float(np.sqrt(covariance[place, place]))
        numbers[f"ratio_{readings.labels[imu]}"] = (ratio, error, "1")
    imus = tuple(int(k) for k in pairs[chosen, 0])
    return Finding(SCALES[kind], imus, log_p, numbers, *held_out(nats))


def mixture(fit: Fit, imu: int, kind: int, without=None) -> Mixture:
    """EM for a triad's standardised residual, its three axes together; ``without`` (T,) bool."""
    unit = triad(fit, imu, kind)
    if without is not None:
        unit[without] = np.nan
    axes, square = np.sum(np.isfinite(unit), axis=1), np.nansum(unit**2, axis=1)
    plain = np.sqrt(np.sum(square) / max(np.sum(axes), 1))
    share, factor, core = 0.05, 3.0, float(np.nanmedian(np.abs(unit)) / QUARTILE)
    for _ in range(60):
        odds = np.log(share / (1 - share)) - axes * np.log(factor)
        odds = odds + square / (2 * core**2) * (1 - 1 / factor**2)
        outlier = np.where(axes > 0, 1 / (1 + np.exp(-np.clip(odds, -500, 500))), 0.0)
        share = float(np.clip(outlier[axes > 0].mean(), 1e-5, 0.5))
        rest = np.sum((1 - outlier) * axes)
        core = float(np.sqrt(np.sum((1 - outlier) * square) / max(rest, 1)))
        wide = np.sum(outlier * square) / max(np.sum(outlier * axes), 1e-9)
        factor = max(float(np.sqrt(wide)) / core, 1.05)
    sds = core, core * factor, plain
    *logs, single = (-axes * np.log(sd) - square / (2 * sd**2) for sd in sds)
    both = np.logaddexp(np.log1p(-share) + logs[0], np.log(share) + logs[1])
    return Mixture(share, factor, core, outlier, both - single)


def heavy_tails(fit: Fit, noise: Noise, limit: float):
    """(Finding or None, hits, others): triads [(imu, kind, Mixture)] with heavy tails.

    ``others`` are those where it may be so, once it is so somewhere: each by itself, or all the
    rest of a kind together.
    """
    triads = np.argwhere(observable(fit.readings, fit.basis))
    tried = [(int(i), int(k), mixture(fit, i, k)) for i, k in triads]
    gains = np.array([_tail_gain(fit, noise, *item) for item in tried])
    for place, (imu, kind, _) in enumerate(tried):
        # motion takes a little of far readings along, into the residuals of all others
        far = [m.outlier > 0.5 for (*_, m), gain in zip(tried, gains, strict=True)
               if SETTINGS.leaks * gain > gains[place] > 0]  # fmt: skip
        if far:
            own = mixture(fit, imu, kind, without=np.any(far, axis=0))
            tried[place] = imu, kind, own
            gains[place] = _tail_gain(fit, noise, imu, kind, own)
    logs = np.array([log_chi_square(max(gain, 1e-9), 2) for gain in gains]) + np.log(len(triads))
    pooled = {kind: _all_tails(gains[triads[:, 1] == kind]) for kind in {k for _, k, _ in tried}}
    least = min(logs.min(), *pooled.values())
    if least > limit:
        return None, [], []
    hits, maybe = [*np.flatnonzero(logs < limit)], logs - np.log(len(triads)) < SETTINGS.maybe
    for kind, together in pooled.items():
        mine = triads[:, 1] == kind
        rest = mine & (logs >= limit)
        if np.array_equal(rest, mine):
            alike = together < SETTINGS.others
        else:
            # less the largest, which the motion may have taken along from a hit
            alike = rest.sum() > 1 and _all_tails(np.sort(gains[rest])[:-1]) < SETTINGS.others
        if alike:
            hits += [*np.flatnonzero(rest)]
        elif rest.any() and log_chi_square(max(gains[rest].sum(), 1e-9), 2 * rest.sum()) < limit:
            hits += [*np.flatnonzero(rest & maybe)]
            maybe |= rest
    others = np.setdiff1d(np.flatnonzero(maybe), hits)
    hits, others = ([tried[place] for place in places] for places in (hits, others))
    imus = tuple(sorted({imu for imu, *_ in hits}))
    return Finding(TAILS, imus, float(least), *_numbers(fit, hits)), hits, others


def _all_tails(gains) -> float:
    """log p of several tails together: half of triads without gain nothing, the rest chi-square."""
    return log_chi_square(max(float(gains.sum()), 1e-9), len(gains)) + np.log(len(KINDS))


def _numbers(fit: Fit, hits):
    """(numbers, gain, its standard error, blocks) of the triads with heavy tails."""
    nats, numbers, count = np.zeros(len(fit.residual)), {}, len(fit.residual)
    for imu, kind, mix in hits:
        nats += mix.nats
        name = f"{KINDS[kind]}_{fit.readings.labels[imu]}"
        error = float(np.sqrt(mix.share * (1 - mix.share) / count))
        numbers[f"share_{name}"] = (mix.share, error, "1")
        far = max(6 * mix.share * count, 1.0)
        numbers[f"factor_{name}"] = (mix.factor, float(mix.factor / np.sqrt(far)), "1")
    return numbers, *held_out(nats)


def _tail_gain(fit: Fit, noise: Noise, imu: int, kind: int, mix: Mixture) -> float:
    """Twice a mixture's nats, less where neighbours are alike; none for a handful of outliers."""
    rho = noise.correlation[imu, kind]
    several = mix.share * len(fit.residual) > SETTINGS.few
    return 2 * float(mix.nats.sum()) * (1 - rho**2) / (1 + rho**2) if several else 0.0


def pooled_autocorrelation(found: Colours) -> float:
    """log p of lag-one correlations together, 0 where spectra disagree."""
    kind, logs = found.triads[:, 1], [0.0]
    for chosen in (np.ones(len(kind), bool), kind == 0, kind == 1):
        if chosen.any():
            signed, root = np.sign(found.rho[chosen]), np.sqrt(chosen.sum())
            apart = abs(np.sum(signed * (found.slope - found.implied)[chosen])) / root
            there = -np.sum(signed * found.slope[chosen]) / root
            if apart < SETTINGS.agree < there:
                logs.append(found.pooled(chosen) + np.log(3))
    return min(logs)


def neighbours_alike(found: Colours) -> np.ndarray:
    """log p (n,) of each triad's lag-one correlation, 0 where its spectrum disagrees."""
    plain = log_normal(np.sqrt(found.square)) + np.log(2 * len(found.rho))
    return np.where(np.abs(found.slope - found.implied) < SETTINGS.agree, plain, 0.0)


def coloured(fit: Fit, noise: Noise, limit: float, untied: bool) -> Finding | None:
    """Noise correlated in time: neighbours alike, and a spectrum that agrees with it.

    ``untied``: no check ties the residual to the motion; else only the spectrum above it counts.
    """
    own = colours(fit, noise)
    triads, size, off = own.triads, np.abs(own.rho), np.abs(own.slope - own.implied)
    sharp = log_normal(np.abs(own.slope)) + np.log(2 * len(triads))
    log_p = np.minimum(sharp, neighbours_alike(own) if untied else 0.0)
    agree = off < np.maximum(SETTINGS.agree, SETTINGS.agree_share * np.abs(own.implied))
    clear = (size > SETTINGS.flat) & (own.square > SETTINGS.clear**2)  # its own, not passed on
    far = (log_p <= limit) & clear & agree
    logs = log_p[far]
    together = pooled_autocorrelation(own)
    if not far.any() and together > limit:
        return None
    for kind in set(triads[far, 1]) or range(len(KINDS)):
        rest = (triads[:, 1] == kind) & ~far
        if rest.any() and own.pooled(rest) < SETTINGS.others and np.median(own.square[rest]) > 2:
            far |= rest
    if not far.any():
        return None
    nats, numbers, step = np.zeros(len(fit.residual)), {}, np.median(np.diff(fit.readings.time))
    each = (part[far] for part in (triads, own.seen, own.rho, np.maximum(own.pairs, 1)))
    for (imu, kind), seen, rho, pairs in zip(*each, strict=True):
        name = f"{KINDS[kind]}_{fit.readings.labels[imu]}"
        error = float(np.sqrt((1 - rho**2) / pairs))
        numbers[f"correlation_{name}"] = (float(rho), error, "1")
        if rho > 0:
            late = -step / np.log(rho)
            took = late * error / -(rho * np.log(rho))
            numbers[f"correlation_time_{name}"] = (float(late), float(took), "s")
        unit = np.nan_to_num(triad(fit, imu, kind))
        unit = unit / max(unit.std(), 1e-9)
        jump = (unit[1:] - seen * unit[:-1]) ** 2 / (1 - seen**2)
        nats[1:] += np.sum(unit[1:] ** 2 - jump - np.log1p(-(seen**2)), axis=1) / 2
    imus = tuple(sorted({int(imu) for imu in triads[far, 0]}))
    best = float(min(*logs, together, 0.0))
    return Finding(COLOURED, imus, best, numbers, *held_out(nats))
