"""Noise of still poses' averages: that of the readings, and offsets that walk.

Offsets do as sensors warm up. They are pinned where the board moves: there the offset is a
parameter of the fit. The walks' variances in a second are estimated by restricted maximum
likelihood beside a factor of the readings' own noise: one for all triads, or each its own where
that gains more than as many parameters do by chance.
"""

from typing import NamedTuple, Self

import numpy as np
from scipy.optimize import minimize_scalar

from imuarray.firstorder.settings import SETTINGS
from imuarray.linear import scaled_inverse, shared_walk


class PoseNoise(NamedTuple):
    """Noise of the averages (P, A, 3) in P poses.

    ``sd`` (P, A, 3) of the readings' noise; ``walked`` (P, P) s, how long each two poses' offsets
    have walked together; ``walk`` (A,), their variance in a second; ``factor`` (A,) of the
    readings' variance, with which what else scatters is as large.
    """

    sd: np.ndarray
    walked: np.ndarray
    walk: np.ndarray
    factor: np.ndarray

    @classmethod
    def of(cls, sd, time, recording) -> Self:
        """``time`` (P,) s of each pose, after the instant of its recording's offset."""
        together = np.where(recording[:, None] == recording, shared_walk(time), 0.0)
        return cls(sd, together, np.zeros(sd.shape[1]), np.ones(sd.shape[1]))

    def whitening(self, used) -> np.ndarray:
        """(A, 3, P, P) that makes averages white, zero for those not ``used`` (P, A) bool."""
        mine = np.swapaxes(used, 0, 1)[:, None]
        both = mine[..., None] & mine[..., None, :]
        walked = self.walk[:, None, None, None] * self.walked
        noise = self.factor[:, None, None] * np.moveaxis(self.sd, 0, -1) ** 2
        spread = np.where(both, walked, 0.0) + _diagonal(np.where(mine, noise, 1.0))
        return np.where(both, np.linalg.inv(np.linalg.cholesky(spread)), 0.0)

    def misfits(self, used, residual) -> float:
        """The largest of the triads' residuals (P, A, 3) in their noise, over the usual of all."""
        squares = np.sum((residual / self.sd) ** 2, axis=2) * used
        each = squares.sum(axis=0) / np.maximum(used.sum(axis=0), 1)
        return float(np.sqrt(each.max() / max(np.median(each), np.finfo(float).tiny)))

    def estimated(self, used, misfit, slopes, fixed) -> Self:
        """With the walks that misfits show, if they do.

        ``misfit`` (P, A, 3) m/s^2 at an estimate, ``slopes`` (P, A, 3, n) of the averages in its
        parameters, ``fixed`` (n, n) information that comes from elsewhere.
        """
        if not self.walked.any():
            return self
        rows, one = _Rows.of(misfit, slopes, fixed), np.ones(len(self.walk))
        unit = np.median(self.sd) ** 2
        found = minimize_scalar(
            lambda x: rows.profiled(self._replace(walk=unit * np.exp(x) * one), used)[0],
            bounds=np.log(SETTINGS.walk_range), method="bounded", options={"xatol": 0.05},
        )  # fmt: skip
        # noise and walk that both grow: what of it is noise's, the fit's residual will show
        common = self._replace(walk=unit * np.exp(found.x) * one)
        ways = [(self, 0.0), (common, 2 * SETTINGS.walk_gain)]
        if len(one) > 2:  # of two, either may say that it is the other
            own, freedom = rows.own(self, used, unit)
            if freedom > SETTINGS.walk_freedom:
                ways.append((own, 2 * (SETTINGS.walk_gain + 2 * len(one) - 2)))
        best = min(ways, key=lambda way: rows.profiled(way[0], used)[0] + way[1])[0]
        return best._replace(walk=best.walk * rows.profiled(best, used)[1])


class _Rows(NamedTuple):
    """Misfits (A, 3, P), their slopes (A, 3, P, m) in each triad's ``columns`` (A, m) of n.

    A column that a triad has not is n itself, with slopes of zero.
    """

    misfit: np.ndarray
    slopes: np.ndarray
    columns: np.ndarray
    fixed: np.ndarray

    @classmethod
    def of(cls, misfit, slopes, fixed) -> Self:
        slopes, count = np.moveaxis(slopes, 0, -2), slopes.shape[-1]
        has = np.any(slopes != 0, axis=(1, 2))
        most = int(has.sum(axis=1).max())
        columns = np.array([np.append(np.flatnonzero(own), [count] * most)[:most] for own in has])
        padded = np.concatenate([slopes, np.zeros((*slopes.shape[:-1], 1))], axis=-1)
        own = np.take_along_axis(padded, columns[:, None, None], axis=-1)
        return cls(np.moveaxis(misfit, 0, -1), own, columns, fixed)

    def solved(self, white):
        """Whitened misfits and slopes; information (n, n), its right side (n,) and solution."""
        count = len(self.fixed)
        left, rows = (white @ self.misfit[..., None])[..., 0], white @ self.slopes
        inner, right = np.zeros((count + 1, count + 1)), np.zeros(count + 1)
        for mine, own, rest in zip(self.columns, rows, left, strict=True):
            flat = own.reshape(-1, own.shape[-1])
            inner[np.ix_(mine, mine)] += flat.T @ flat
            right[mine] += flat.T @ rest.ravel()
        inner, right = inner[:-1, :-1] + self.fixed, right[:-1]
        scale = 1 / np.sqrt(np.diag(inner))
        step = scale * np.linalg.solve(inner * np.outer(scale, scale), scale * right)
        return left, rows, inner, right, step

    def profiled(self, noise: PoseNoise, used) -> tuple[float, float]:
        """-2 log of the restricted likelihood of a noise, and a factor of all variances in it.

        The factor is the one that fits best, at least 1.
        """
        white = noise.whitening(used)
        left, _, inner, right, step = self.solved(white)
        # misfits more than parameters that they determine
        free = 3 * int(used.sum()) - (len(self.fixed) - np.linalg.matrix_rank(self.fixed))
        square = float(np.sum(left**2) - right @ step)
        grown = max(square / free, 1.0)
        known, size = np.diagonal(white, axis1=-2, axis2=-1), np.diag(inner)
        scaled = inner / np.sqrt(np.outer(size, size))
        lost = np.linalg.slogdet(scaled)[1] + np.log(size).sum()
        logs = lost - 2 * np.log(known[known > 0]).sum()
        return float(free * np.log(grown) + square / grown + logs), grown

    def own(self, noise: PoseNoise, used, unit: float) -> tuple[PoseNoise, float]:
        """With each triad's own walk and factor, at least 1; the fewest that judge a triad's.

        Minorise-maximise steps for variance components (Zhou, Hu, Zhou and Lange, J. Comput. Graph.
        Stat. 28, 2019): no step lowers the likelihood.
        """
        parts = _diagonal(np.moveaxis(noise.sd, 0, -1) ** 2), noise.walked
        noise = noise._replace(walk=np.full(len(self.columns), unit))
        for _ in range(SETTINGS.walk_steps):
            white = noise.whitening(used)
            left, rows, inner, _, step = self.solved(white)
            inverse = np.zeros(np.add(inner.shape, 1))
            inverse[:-1, :-1] = scaled_inverse(inner)
            rest = left - np.einsum("kipm,km->kip", rows, np.append(step, 0.0)[self.columns])
            given = inverse[self.columns[:, :, None], self.columns[:, None]]
            change = []
            for part in parts:
                own = white @ part @ np.swapaxes(white, -1, -2)
                square = np.einsum("kip,kipq,kiq->k", rest, own, rest)
                known = np.einsum("kmn,kinm->k", given, np.swapaxes(rows, -1, -2) @ own @ rows)
                change.append(np.sqrt(square / (np.einsum("kipp->k", own) - known)))
            before, walk = (
                noise.walk,
                np.maximum(noise.walk * change[1], unit * SETTINGS.walk_range[0]),
            )
            noise = noise._replace(walk=walk, factor=np.maximum(noise.factor * change[0], 1.0))
            if np.abs(np.log(walk / before)).max() < SETTINGS.walk_close:
                break
        absorbed = np.einsum("kmn,kinm->k", given, np.swapaxes(rows, -1, -2) @ rows)
        return noise, float(np.min(3 * used.sum(axis=0) - absorbed))


def _diagonal(values) -> np.ndarray:
    """Matrices (..., P, P) of diagonals (..., P)."""
    return values[..., None] * np.eye(values.shape[-1])


def walked_mean(values, sd, time) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Offsets (K, 3) at time 0 from averages (P, K, 3) in poses at ``time`` (P,) s; sds; walks.

    ``sd`` (P, K, 3) of the averages' noise. What scatters more than noise and walk say makes the
    sds larger; of one pose alone they are NaN. The walks (K,) are sds per root of a second.
    """
    count, channels = len(values), values[0].size
    used = np.ones(values.shape[:2], bool)
    noise = PoseNoise.of(sd, time, np.zeros(count, int))
    mean, spread, ratio = _weighted(values, noise.whitening(used))
    if ratio > SETTINGS.walk_seen or noise.misfits(used, values - mean) > SETTINGS.walk_seen:
        slopes = np.broadcast_to(np.eye(channels), (count, channels, channels))
        noise = noise.estimated(
            used, values - mean, slopes.reshape(*values.shape, channels), np.zeros((channels,) * 2)
        )
        mean, spread, ratio = _weighted(values, noise.whitening(used))
    sds = np.sqrt(spread) * (max(ratio, 1.0) if count > 1 else np.nan)
    return mean, sds, np.sqrt(noise.walk)


def _weighted(values, white) -> tuple[np.ndarray, np.ndarray, float]:
    """Weighted means (K, 3), their variances, and the residual in units of the noise (1 expected).

    ``white`` (K, 3, P, P).
    """
    one = white.sum(axis=-1)
    rows = (white @ np.moveaxis(values, 0, -1)[..., None])[..., 0]
    weight = np.sum(one**2, axis=-1)
    mean = np.sum(one * rows, axis=-1) / weight
    left = rows - mean[..., None] * one
    return mean, 1 / weight, float(np.sqrt(np.sum(left**2) / max(left.size - mean.size, 1)))
