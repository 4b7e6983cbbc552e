"""Data of a recording, arranged for the collapsed problem."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from imuarray.estimation import kernels
from imuarray.model import ArrayModel, structure_tensor


class Tables(NamedTuple):
    """The structure tensor as the kernels want it: its non-zero terms."""

    rows: np.ndarray  # (E, 3): i, c, a of G[i, c, a]
    values: np.ndarray  # (E,)
    pairs: np.ndarray  # (P, 4): i, j, a, b of sum_c G[i, c, a] G[j, c, b]
    products: np.ndarray  # (P,)


@cache
def tables() -> Tables:
    """Non-zero terms of the structure tensor and of its products."""
    tensor = structure_tensor()
    rows = np.argwhere(tensor != 0.0)
    gram = np.einsum("ica,jcb->ijab", tensor, tensor)
    pairs = np.argwhere(gram != 0.0)
    return Tables(rows, tensor[tuple(rows.T)].copy(), pairs, gram[tuple(pairs.T)].copy())


@dataclass(frozen=True)
class Collapsed:
    """What every estimator of the papers' model needs of the data, computed once.

    Attributes (T samples, A accelerometer triads; time last)
    ----------
    specific_force : (A, 3, T) m/s^2, each sample's mean over triads taken out (s_t
        absorbs it exactly, and less is lost to rounding)
    offset : (3, T) that mean
    weighted : (A, 3, T) Lambda y
    energy : (T,) y' Lambda y
    moments : (4, 3, T), row 0 filled with sum_k (Lambda y)_k
    mean, gyroscope_information : (3, T), (3, 3, T), p(omega_t | y_g)
    weights : (A,) 1 / sigma_k^2, or None for a general covariance
    """

    specific_force: np.ndarray
    offset: np.ndarray
    weighted: np.ndarray
    energy: np.ndarray
    moments: np.ndarray
    mean: np.ndarray
    gyroscope_information: np.ndarray
    weights: np.ndarray | None
    precision: np.ndarray

    @property
    def samples(self) -> int:
        """Number T of samples."""
        return self.energy.size

    @classmethod
    def of(cls, model: ArrayModel, specific_force, angular_rate, saturated=None) -> Collapsed:
        """From measurements (T, A, 3) m/s^2 and (T, G, 3) rad/s, and saturated axes."""
        centred = np.array(np.transpose(specific_force, (1, 2, 0)), float, order="C")
        offset = centred.mean(axis=0)
        centred -= offset
        precision = model.noise.accelerometer_precision
        weights = model.noise.triad_weights
        if weights is None:
            flat = centred.reshape(-1, centred.shape[-1])
            weighted = (precision @ flat).reshape(centred.shape)
        else:
            weighted = weights[:, None, None] * centred
        moments = np.zeros((4, 3, centred.shape[-1]))
        moments[0] = weighted.sum(axis=0)
        mean, information = model.noise.angular_rate_given_gyroscopes(angular_rate, saturated)
        return cls(
            centred,
            offset,
            weighted,
            np.einsum("kct,kct->t", centred, weighted),
            moments,
            np.ascontiguousarray(mean.T),
            np.ascontiguousarray(information.transpose(1, 2, 0)),
            weights,
            precision,
        )

    def reduce(self, positions):
        """Eliminate phi at ``positions`` (A, 3).

        Returns C (6, 6), b (6, T), X (6, 6), phi (6, T), const (T,), log |H' Lambda H| and
        (H' Lambda H)^-1 (6, 6), named as in `imuarray.estimation.kernels`.
        """
        known = tables()
        K, C, X, inverse = np.empty((12, 12)), *np.empty((3, 6, 6))
        positions = np.ascontiguousarray(positions, float)
        if self.weights is None:
            kernels.information_general(positions, self.precision, structure_tensor(), K)
        else:
            kernels.information(positions, self.weights, known.pairs, known.products, K)
        logdet = kernels.eliminate(K, C, X, inverse)
        moments = self.moments.copy()
        kernels.weighted_moments(positions, self.weighted, moments)
        full = np.empty((12, self.samples))
        kernels.project(moments, known.rows, known.values, full)
        b, phi, const = (
            np.empty((6, self.samples)),
            np.empty((6, self.samples)),
            np.empty(self.samples),
        )
        kernels.reduce_linear(full, X, inverse, b, phi, const, self.energy)
        return C, b, X, phi, const, logdet, inverse
