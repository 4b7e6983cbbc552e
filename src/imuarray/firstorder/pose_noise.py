"""How still poses' averages scatter: noise of the readings, and offsets that walk.

Offsets do as sensors warm up. All walk alike, and are pinned where the board moves: there the
offset is a parameter of the fit. The walk's variance in a second is estimated by restricted maximum
likelihood beside a factor of the readings' own noise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from imuarray.walk import shared_walk

SHOWN = 2.0  # nats that a walk must gain
SEEN = 1.2  # times the noise; a walk is looked for beyond
RANGE = 1e-4, 1e8  # of a walk in a second, as a share of an average's variance


class PoseNoise(NamedTuple):
    """Of the averages (P, A, 3) in P poses.

    ``sd`` (P, A, 3) of the readings' noise; ``walked`` (P, P) s, how long each two poses' offsets
    have walked together; ``walk``, their variance in a second.
    """

    sd: np.ndarray
    walked: np.ndarray
    walk: float = 0.0

    @classmethod
    def of(cls, sd, time, recording) -> PoseNoise:
        """``time`` (P,) s of each pose, after the instant of its recording's offset."""
        return cls(sd, np.where(recording[:, None] == recording, shared_walk(time), 0.0))

    def whitening(self, used) -> np.ndarray:
        """(A, 3, P, P) that makes averages white, zero for those not ``used`` (P, A) bool."""
        mine = np.swapaxes(used, 0, 1)[:, None]
        both = mine[..., None] & mine[..., None, :]
        spread = np.where(both, self.walk * self.walked, 0.0) + _diagonal(self._variances(mine))
        return np.where(both, np.linalg.inv(np.linalg.cholesky(spread)), 0.0)

    def _variances(self, mine) -> np.ndarray:
        return np.where(mine, np.moveaxis(self.sd, 0, -1) ** 2, 1.0)

    def estimated(self, used, misfit, slopes, fixed) -> PoseNoise:
        """With the walk that misfits show, if they do.

        ``misfit`` (P, A, 3) m/s^2 at an estimate, ``slopes`` (P, A, 3, n) of the averages in its
        parameters, ``fixed`` (n, n) information that comes from elsewhere.
        """
        misfit, slopes = np.moveaxis(misfit, 0, -1), np.moveaxis(slopes, 0, -2)
        free = 3 * int(used.sum()) - (slopes.shape[-1] - np.linalg.matrix_rank(fixed))

        def deviance(walk: float) -> float:
            white = self._replace(walk=walk).whitening(used)
            rows = (white @ slopes).reshape(-1, slopes.shape[-1])
            left = (white @ misfit[..., None]).ravel()
            inner = rows.T @ rows + fixed
            scale = 1 / np.sqrt(np.diag(inner))
            step = scale * np.linalg.solve(inner * np.outer(scale, scale), scale * (rows.T @ left))
            square = left @ left - step @ inner @ step
            grown = max(square / free, 1.0)
            known = np.diagonal(white, axis1=-2, axis2=-1)
            lost = np.linalg.slogdet(inner * np.outer(scale, scale))[1] - 2 * np.log(scale).sum()
            return free * np.log(grown) + square / grown - 2 * np.log(known[known > 0]).sum() + lost

        unit = np.median(self.sd) ** 2
        found = minimize_scalar(
            lambda x: deviance(unit * np.exp(x)), bounds=np.log(RANGE), method="bounded",
            options={"xatol": 0.05},
        )  # fmt: skip
        walk = unit * np.exp(found.x)
        return self._replace(walk=walk if deviance(0.0) - found.fun > 2 * SHOWN else 0.0)


def _diagonal(values) -> np.ndarray:
    """Matrices (..., P, P) of diagonals (..., P)."""
    return values[..., None] * np.eye(values.shape[-1])


def walked_mean(values, sd, time) -> tuple[np.ndarray, np.ndarray, float]:
    """Offsets (K, 3) at time 0 from averages (P, K, 3) in poses at ``time`` (P,) s; sds; walk.

    ``sd`` (P, K, 3) of the averages' noise. What scatters more than noise and walk say makes the
    sds larger; of one pose alone they are NaN. The walk is an sd per root of a second.
    """
    count, channels = len(values), values[0].size
    used = np.ones(values.shape[:2], bool)
    noise = PoseNoise.of(sd, time, np.zeros(count, int))
    mean, spread, ratio = _weighted(values, noise.whitening(used))
    if ratio > SEEN:
        slopes = np.broadcast_to(np.eye(channels), (count, channels, channels))
        noise = noise.estimated(
            used, values - mean, slopes.reshape(*values.shape, channels), np.zeros((channels,) * 2)
        )
        mean, spread, ratio = _weighted(values, noise.whitening(used))
    sds = np.sqrt(spread) * (max(ratio, 1.0) if count > 1 else np.nan)
    return mean, sds, float(np.sqrt(noise.walk))


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
