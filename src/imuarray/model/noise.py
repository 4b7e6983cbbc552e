"""Measurement noise: Gaussian, white in time, any covariance across the array."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.linalg import block_diag

from imuarray.errors import InputError


def _inverse(covariance) -> np.ndarray:
    """Inverse of a covariance; what is written as diagonal, as most are, needs no factorisation."""
    diagonal = np.diag(covariance)
    if np.count_nonzero(covariance) == len(diagonal):
        return np.diag(1.0 / diagonal)
    return np.linalg.inv(covariance)


def _covariance(blocks, count, what) -> np.ndarray:
    """(3n, 3n) covariance from a scalar sd, (n,) sds, (n, 3, 3) blocks or the full form."""
    given = np.asarray(blocks, float)
    size = 3 * count
    if given.ndim == 0 or given.shape == (count,):
        full = np.diag(np.repeat(np.broadcast_to(given, count) ** 2, 3))
    elif given.shape == (count, 3, 3):
        full = block_diag(*given)
    elif given.shape == (size, size):
        full = given
    else:
        raise InputError(
            f"{what} noise: expected a standard deviation, {count} of them, {count} 3 x 3"
            f" covariances or one {size} x {size} covariance, found shape {given.shape}"
        )
    if not np.allclose(full, full.T, rtol=1e-10, atol=0) or np.linalg.eigvalsh(full)[0] <= 0:
        raise InputError(f"{what} noise: expected a symmetric positive definite covariance")
    return full


@dataclass(frozen=True)
class Noise:
    """Covariances of the stacked accelerometers (3A, 3A) and gyroscopes (3G, 3G).

    Off-diagonal blocks are cross-talk between triads; the two kinds of sensor are
    uncorrelated (paper 2021, section II-B).
    """

    accelerometer: np.ndarray
    gyroscope: np.ndarray

    @classmethod
    def of(cls, accelerometers, gyroscopes, accelerometer, gyroscope) -> Self:
        """Noise for A and G triads from sds (m/s^2, rad/s), per-triad or full covariances."""
        return cls(
            _covariance(accelerometer, accelerometers, "accelerometer"),
            _covariance(gyroscope, gyroscopes, "gyroscope"),
        )

    @cached_property
    def accelerometer_precision(self) -> np.ndarray:
        """Lambda, (3A, 3A)."""
        return _inverse(self.accelerometer)

    @cached_property
    def triad_weights(self) -> np.ndarray | None:
        """(A,) values 1 / sigma_k^2 when each triad's noise is isotropic, else None."""
        variances = np.diag(self.accelerometer).reshape(-1, 3)
        scalar = np.diag(np.repeat(variances[:, 0], 3))
        return 1.0 / variances[:, 0] if np.array_equal(scalar, self.accelerometer) else None

    def times(self, factor) -> Self:
        """The noise with all sds ``factor`` times as large."""
        return Noise(factor**2 * self.accelerometer, factor**2 * self.gyroscope)

    def draw(self, rng, shape) -> tuple[np.ndarray, np.ndarray]:
        """Noise for ``shape`` samples: (*shape, A, 3) m/s^2 and (*shape, G, 3) rad/s."""

        def one(covariance):
            white = rng.standard_normal((*shape, len(covariance)))
            diagonal = np.diag(covariance)
            if np.array_equal(np.diag(diagonal), covariance):
                white *= np.sqrt(diagonal)
            else:
                white = white @ np.linalg.cholesky(covariance).T
            return white.reshape(*shape, -1, 3)

        return one(self.accelerometer), one(self.gyroscope)

    def misfit(self, force, rate, saturated=None) -> float:
        """Chi-square of residuals (T, A, 3) m/s^2 and (T, G, 3) rad/s, saturated axes left out."""
        force, rate = force.reshape(len(force), -1), rate.reshape(len(rate), -1)
        if saturated is not None:
            rate = np.where(np.reshape(saturated, rate.shape), 0.0, rate)
        total = np.sum((force @ self.accelerometer_precision) * force)
        return float(total + np.sum(np.linalg.solve(self.gyroscope, rate.T).T * rate))

    def angular_rate_given_gyroscopes(self, angular_rate, saturated=None):
        """The Gaussian p(omega_t | y_g) under a flat prior (paper 2021, eq. 15).

        Parameters
        ----------
        angular_rate : (T, G, 3) rad/s
        saturated : (T, G, 3) bool or None
            Axes to leave out.

        Returns
        -------
        mean (T, 3) rad/s, information (T, 3, 3) s^2/rad^2. Where no gyroscope sees an
        axis the information is singular and the mean holds the plain average there.
        """
        samples, count, _ = angular_rate.shape
        used, total = self._all_fused
        mean = angular_rate.reshape(samples, -1) @ np.ascontiguousarray(used.T)
        information = np.broadcast_to(total, (samples, 3, 3)).copy()
        if saturated is None or not np.any(saturated):
            return mean, information
        lost = np.asarray(saturated, bool).reshape(samples, -1)
        affected = np.flatnonzero(lost.any(axis=1))
        if np.count_nonzero(self.gyroscope) == len(self.gyroscope):
            part = angular_rate[affected]
            seen = np.where(lost[affected], 0.0, 1.0 / np.diag(self.gyroscope)).reshape(part.shape)
            total = seen.sum(axis=1)
            information[affected] = total[:, None] * np.eye(3)
            seen[np.broadcast_to((total == 0.0)[:, None], seen.shape)] = 1.0  # the plain average
            mean[affected] = np.einsum("tgc,tgc->tc", seen, part) / seen.sum(axis=1)
            return mean, information
        # noise that axes share: one gain for each set of axes
        patterns, which = np.unique(lost[affected], axis=0, return_inverse=True)
        for number, pattern in enumerate(patterns):
            rows = affected[which.ravel() == number]
            gain, information[rows] = self._fuse(~pattern)
            mean[rows] = angular_rate[rows].reshape(len(rows), -1) @ gain.T
        return mean, information

    @cached_property
    def _all_fused(self):
        return self._fuse(np.ones(len(self.gyroscope), bool))

    def _fuse(self, keep):
        """Gain (3, 3G) and information (3, 3) of the gyroscope axes in ``keep`` (3G,).

        An axis nobody keeps gets the plain average and no information.
        """
        stack = np.tile(np.eye(3), (len(keep) // 3, 1))
        weighted = _inverse(self.gyroscope[np.ix_(keep, keep)]) @ stack[keep]
        total = stack[keep].T @ weighted
        blind = ~keep.reshape(-1, 3).any(axis=0)
        gain = np.zeros((3, len(keep)))
        gain[:, keep] = np.linalg.solve(total + np.diag(blind.astype(float)), weighted.T)
        gain[blind] = stack.T[blind] / (len(keep) // 3)
        return gain, total
