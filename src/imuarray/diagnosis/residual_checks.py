"""Is anything left? Tests of the residual against what no named cause need explain.

For each reading's axis, regressions on a wide set of features of the motion and of time, the
fitted parameters and the motion projected out; and the residual's size, its autocorrelation and
the correlation between sensors.
"""

from typing import NamedTuple, Self

import numpy as np
from scipy.ndimage import median_filter

from imuarray.diagnosis.fit import Fit, delay_score
from imuarray.diagnosis.noise import Noise, observable, slow_power, standardised
from imuarray.diagnosis.reading_effects import triads
from imuarray.diagnosis.replicates import motion_sizes
from imuarray.diagnosis.scores import Information
from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.linearise import CHUNK
from imuarray.engine.normal import projected_columns
from imuarray.engine.settings import SETTINGS as ENGINE
from imuarray.linear import scaled_square
from imuarray.model.structure import products
from imuarray.motion.state import lever
from imuarray.tails import log_chi_square, log_normal, log_poisson


class Check(NamedTuple):
    """A test of what is left: name, statistic, log p with its multiplicity, whose."""

    name: str
    statistic: float
    log_p: float
    imus: tuple[int, ...]

    @classmethod
    def of(cls, name: str, statistic, log_p, *imus) -> Self:
        """With plain numbers; a multiplicity may take log p beyond 0."""
        return cls(name, float(statistic), float(min(log_p, 0.0)), tuple(map(int, imus)))


def features(fit: Fit, imu: int) -> dict[str, np.ndarray]:
    """Groups of features of an IMU's own motion, each (T, n) with unit mean square."""
    motion, state = fit.state.motion, fit.state
    rate, turn = motion[:, :3], motion[:, 3:6]
    force = lever(rate, turn, state.positions[min(imu, len(state.positions) - 1)]) + motion[:, 6:9]
    jerk, force_rate = state.jerk
    time = 2 * fit.readings.time[:, None] / fit.readings.span - 1
    groups = {
        "offset": np.ones((len(rate), 1)),
        "force": force,
        "force squared": products(force),
        "force cubed": force**3,
        "force's size": np.abs(force),
        "rate": rate,
        "rate squared": products(rate),
        "rate cubed": rate**3,
        "omega dot": turn,
        "omega dot squared": np.sum(turn**2, axis=1, keepdims=True),
        "force rate": force_rate,
        "omega double dot": jerk,
        "force rate's sign": np.sign(force_rate),
        "time": np.hstack([time, time**2, time**3]),
        "force in time": time * force,
        "rate in time": time * rate,
    }
    return {name: unit(value) for name, value in groups.items()}


def unit(values) -> np.ndarray:
    """Columns (T, n) with unit mean square."""
    size = np.sqrt(np.mean(values**2, axis=0))
    return values / np.where(size > 0, size, 1.0)


def displaced(motion, causes, axis: int) -> np.ndarray:
    """Readings of an accelerometer's axis where ``causes`` (T, n) move it, (T, 3 n)."""
    rate, turn = motion[:, :3], motion[:, 3:6]
    arms = np.stack([lever(rate, turn, place)[:, axis] for place in np.eye(3)], axis=1)
    return unit((arms[:, :, None] * causes[:, None, :]).reshape(len(motion), -1))


def regression_checks(fit: Fit, given: Information, noise: Noise) -> list[Check]:
    """Each group of features over all axes, and each IMU's axes over all features."""
    inner = given.covariance(given.places(fit.active))
    chosen = fit.active[:, fit.wanted]
    pairs, projected = np.argwhere(chosen), projected_columns(fit.whitened, fit.basis, chosen)[0]
    motion, (samples, count) = fit.state.motion, fit.residual.shape[:2]
    basis = fit.basis.reshape(samples, count, 6, -1)
    groups: dict[str, list] = {}
    slow = slow_power(fit, noise)  # as features are: coloured noise is largest there
    axes = []
    for imu in range(count):
        common = features(fit, imu)
        for axis in np.flatnonzero(np.repeat(fit.readings.exists[imu], 3)):
            # boards bend, mounts give way
            table = common | {
                f"lever times {cause}": displaced(motion, common[cause], axis)
                for cause in ("force", "time") if axis < 3
            }  # fmt: skip
            names = np.repeat(list(table), [v.shape[1] for v in table.values()])
            stacked = np.hstack(list(table.values()))
            seen = -np.einsum("ti,tia->ta", basis[:, imu, axis], projected)
            own = np.flatnonzero(pairs[:, 0] == imu)
            seen[:, own] += fit.whitened[:, imu, axis][:, pairs[own, 1]]
            kept = fit.readings.keep[:, imu, axis].astype(float)
            free = kept - np.sum(basis[:, imu, axis] ** 2, axis=1)
            score = stacked.T @ fit.residual[:, imu, axis]
            cross = stacked.T @ seen
            block = stacked.T @ (free[:, None] * stacked) - cross @ inner @ cross.T
            plain = np.diag(stacked.T @ (kept[:, None] * stacked))
            block = block * slow[imu, axis // 3]
            for name in table:
                chosen = np.flatnonzero(names == name)
                groups.setdefault(name, []).append((imu, *_chi(block, score, plain, chosen)))
            axes.append((imu, *_chi(block, score, plain, np.arange(len(names)))))
    alike = dependence(fit)
    checks = [_either(f"residual against {name}", found, alike) for name, found in groups.items()]
    every = _pooled("residual against all", axes, alike)
    return [*checks, every, _worst("an axis against all", axes)]


def left_by_motion(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of white noise less the motion's share, and its products' variance, (6 N, 6 N)."""
    kept = fit.readings.keep.reshape(len(fit.residual), -1).astype(float)
    free = np.maximum(kept - np.sum(fit.basis**2, axis=2), 0.0)
    covariance, variance = np.diag(kept.sum(axis=0)), free.T @ free
    for basis in np.array_split(fit.basis, len(fit.basis) // CHUNK + 1):
        shared = basis @ basis.swapaxes(1, 2)
        covariance = covariance - shared.sum(axis=0)
        variance = variance + np.sum(shared**2, axis=0)
    return covariance, variance


def dependence(fit: Fit) -> float:
    """Variance of a sum of axes' chi-squares over that of independent ones: few IMUs share much."""
    covariance = left_by_motion(fit)[0]
    there = np.flatnonzero(np.diag(covariance) > ENGINE.least_free * len(fit.residual))
    size = np.sqrt(np.diag(covariance)[there])
    together = covariance[np.ix_(there, there)] / np.outer(size, size)
    return max(SETTINGS.crowd, float(np.sum(together**2)) / len(there))


def _chi(block, score, plain, chosen):
    """(chi-square, degrees of freedom) of some features."""
    scale = np.sqrt(np.maximum(plain[chosen], 1e-300))
    inner = block[np.ix_(chosen, chosen)]
    return scaled_square(inner, score[chosen], SETTINGS.seen_feature, scale)


def _pooled(name, found, alike) -> Check:
    """All axes together: the sum of chi-squares, its variance ``alike`` times as large."""
    total, freedom = sum(f[1] for f in found), max(sum(f[2] for f in found), 1)
    log_p = log_chi_square(max(total / alike, 1e-9), freedom / alike)  # Satterthwaite's
    worst = max(found, key=lambda f: f[1] - f[2])
    return Check.of(name, total / freedom, log_p, worst[0])


def _either(name, found, alike) -> Check:
    """All axes together, or the worst of them."""
    together, worst = _pooled(name, found, alike), _worst(name, found)
    _, statistic, log_p, imus = min(together, worst, key=lambda check: check.log_p)
    return Check.of(name, statistic, log_p + np.log(2), *imus)


def _worst(name, found) -> Check:
    """The worst axis, all of them allowed for."""
    tested = [(log_chi_square(max(f[1], 1e-9), max(f[2], 1)), f) for f in found]
    log_p, worst = min(tested, key=lambda t: t[0])
    return Check.of(name, worst[1] / max(worst[2], 1), log_p + np.log(len(found)), worst[0])


def size_checks(fit: Fit) -> list[Check]:
    """Does the residual's size grow with the motion's? A regression of its square per triad."""
    pairs, unit = np.argwhere(observable(fit.readings, fit.basis)), triads(standardised(fit))
    squares, checks = [unit[:, imu, kind] ** 2 for imu, kind in pairs], []
    each = [np.nan_to_num(square / np.nanmean(square) - 1).sum(axis=1) for square in squares]
    for name, values in motion_sizes(fit).items():
        size = np.sum(values**2, axis=1)
        if not np.any(size):
            continue
        trend = (size - size.mean()) / size.std()
        found = [
            (imu, (trend @ excess) / np.sqrt(np.sum((trend * excess) ** 2)))
            for (imu, _), excess in zip(pairs, each, strict=True)
        ]
        checks.append(normal_checks(f"residual's size against {name}", found))
    return checks


def normal_checks(name, found, alike=False) -> Check:
    """Worst and pooled of standard normals expected near zero; their mean where all are alike."""
    found = [(imu, float(z)) for imu, z in found]
    worst = max(found, key=lambda f: abs(f[1]))
    single = log_normal(abs(worst[1])) + np.log(2 * len(found))
    pooled = log_chi_square(sum(z**2 for _, z in found), len(found))
    mean = log_normal(abs(sum(z for _, z in found)) / np.sqrt(len(found))) + np.log(2)
    log_p = min(single, pooled, mean if alike else 0.0) + np.log(2 + alike)
    return Check.of(name, worst[1], log_p, worst[0])


def age_checks(fit: Fit) -> list[Check]:
    """Do IMUs' ages come and go at some frequency, or wander from sample to sample?

    The periodogram of each IMU's delay; the residual along a delay where delays show most.
    """
    score, information = delay_score(fit)
    both, time = np.flatnonzero(fit.readings.exists.all(axis=1)), fit.readings.time
    place = np.round((time - time[0]) / np.median(np.diff(time))).astype(int)
    turning, wandering = [], []
    for imu, own, known in zip(both, score.T[both], information.T[both], strict=True):
        grid = np.zeros(place[-1] + 1)
        np.add.at(grid, place, own - known * own.sum() / known.sum())
        power = np.abs(np.fft.rfft(grid))[SETTINGS.slow :] ** 2
        if len(power) >= SETTINGS.around:
            # against white noise, or its own level around a frequency where that is higher
            level = median_filter(power, SETTINGS.around, mode="nearest") / np.log(2)
            highest = np.max(power / np.maximum(level, known.sum()))
            log_p = np.log(len(power) * len(both)) - highest
            turning.append(Check.of("ages in time", highest, log_p, imu))
        square = own**2 / known
        excess = (known - known.mean()) * (square - square.mean())
        wandering.append((imu, excess.sum() / max(np.sqrt(np.sum(excess**2)), 1e-300)))
    worst = sorted(turning, key=lambda check: -check.statistic)[:1]
    wander = [normal_checks("ages that wander", wandering, alike=True)] if wandering else []
    return worst + wander


def correlation_check(fit: Fit, noise: Noise) -> Check:
    """Correlations between axes beyond what the common motion explains."""
    samples = len(fit.residual)
    flat = np.where(fit.readings.keep, fit.residual, 0.0).reshape(samples, -1)
    expected, variance = left_by_motion(fit)
    spread = np.sqrt(variance)
    # products of two autocorrelated series vary more
    rho = np.repeat(noise.correlation, 3, axis=1).ravel()
    rho = np.outer(rho, rho)
    spread = spread * np.sqrt((1 + rho) / (1 - rho))
    there = np.flatnonzero(fit.readings.keep.any(axis=0).ravel())
    z = (flat.T @ flat - expected) / np.maximum(spread, 1e-9)
    upper = np.triu_indices(len(there), 1)
    values = z[np.ix_(there, there)][upper]
    place = int(np.argmax(np.abs(values)))
    log_p = log_normal(abs(values[place])) + np.log(2 * len(values))
    imus = sorted({there[i[place]] // 6 for i in upper})
    return Check.of("correlation between sensors", values[place], log_p, *imus)


def noise_checks(noise: Noise, exists) -> list[Check]:
    """Outliers and colour that are still there."""
    places, tails = np.argwhere(exists), log_poisson(noise.outliers, noise.expected)
    worst = min(places, key=lambda t: tails[tuple(t)])
    number, log_p = noise.outliers[tuple(worst)], tails[tuple(worst)] + np.log(len(places))
    found = [(i, noise.slope[i, k]) for i, k in places]
    return [Check.of("outliers", number, log_p, worst[0]), normal_checks("whiteness", found)]


def resolution_check(fit: Fit) -> Check:
    """Are readings coarser than their noise? The least step between values against the sd."""
    readings = fit.readings
    steps = np.where(readings.exists, readings.resolution / readings.sd, 0.0).max(axis=1)
    imu = int(np.argmax(steps))
    coarse = steps[imu] > SETTINGS.coarse
    return Check.of("resolution", steps[imu], -50.0 if coarse else 0.0, imu)


def all_checks(fit: Fit, given: Information, noise: Noise) -> list[Check]:
    """Everything that is tested of a residual."""
    # a prior of omega_dot from the rates' change is all that two accelerometers are held against
    return [
        *regression_checks(fit, given, noise), *size_checks(fit), *age_checks(fit),
        *([] if fit.readings.pair else [correlation_check(fit, noise)]),
        *noise_checks(noise, observable(fit.readings, fit.basis)), resolution_check(fit),
    ]  # fmt: skip
