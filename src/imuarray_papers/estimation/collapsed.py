"""Data of a recording, arranged for the collapsed problem."""

from functools import cache
from typing import NamedTuple, Self

import numpy as np

from imuarray.errors import IdentifiabilityError, InputError, require_shape
from imuarray.geometry.array import require_planar_extent
from imuarray.model import ArrayModel, structure_tensor
from imuarray.motion.state import Motion, MotionEstimate
from imuarray_papers.estimation import kernels
from imuarray_papers.estimation.rates import most_likely, workspace

TOLERANCE = 1e-10  # relative, of a step of omega from which a sample's search ends


class Tables(NamedTuple):
    """The structure tensor G as the kernels want it: its non-zero terms, and its columns.

    Indices are unsigned: signed ones might count from the end, and would be looked up one by one.
    """

    tensor: np.ndarray  # (4, 3, 12)
    rows: np.ndarray  # (E, 3): i, c, a of G[i, c, a]
    values: np.ndarray  # (E,)
    pairs: np.ndarray  # (P, 4): i, j, a, b of sum_c G[i, c, a] G[j, c, b]
    products: np.ndarray  # (P,)
    square: np.ndarray  # (12, 6) by the arm and axis, of w
    linear: np.ndarray  # (12, 6), of phi


@cache
def tables() -> Tables:
    """`Tables` of the structure tensor."""
    tensor = np.array(structure_tensor())
    rows = np.argwhere(tensor != 0.0).astype(np.uint64, order="C")
    gram = np.einsum("ica,jcb->ijab", tensor, tensor)
    pairs = np.argwhere(gram != 0.0).astype(np.uint64, order="C")
    square, linear = (half.copy() for half in np.split(tensor.reshape(12, 12), 2, axis=1))
    return Tables(
        tensor, rows, tensor[tuple(rows.T)].copy(), pairs, gram[tuple(pairs.T)].copy(), square,
        linear,
    )  # fmt: skip


class Collapsed(NamedTuple):
    """Data of every estimator of the papers' model, computed once; compiled code takes it as it is.

    Attributes (T samples, A accelerometer triads; time last)
    ----------
    force : (A, 3, T) m/s^2, each sample's mean over triads taken out (s_t absorbs it exactly, and
        less is lost to rounding); for a general covariance Lambda times that
    offset : (3, T) that mean
    energy : (T,) y' Lambda y
    base : (3, T) sum_k (Lambda y)_k
    mean, rate_information : (3, T), (3, 3, T), p(omega_t | y_g)
    weights : (A,) 1 / sigma_k^2, empty for a general covariance
    precision : (3 A, 3 A) Lambda
    """

    force: np.ndarray
    offset: np.ndarray
    energy: np.ndarray
    base: np.ndarray
    mean: np.ndarray
    rate_information: np.ndarray
    weights: np.ndarray
    precision: np.ndarray
    tables: Tables

    @property
    def samples(self) -> int:
        """Number T of samples."""
        return self.energy.size

    @classmethod
    def of(cls, model: ArrayModel, specific_force, angular_rate, saturated=None) -> Self:
        """From measurements (T, A, 3) m/s^2 and (T, G, 3) rad/s, and saturated axes.

        InputError for other shapes.
        """
        force, rate = np.ascontiguousarray(specific_force, float), np.asarray(angular_rate, float)
        samples, accelerometers = len(force), model.array.accelerometers
        require_shape("specific_force", force, (samples, accelerometers, 3))
        require_shape("angular_rate", rate, (samples, model.array.gyroscopes, 3))
        if saturated is not None:
            require_shape("saturated", np.asarray(saturated), rate.shape)
        precision, weights = model.noise.accelerometer_precision, model.noise.triad_weights
        centred, offset = np.empty((accelerometers, 3, samples)), np.empty((3, samples))
        energy, base = np.empty(samples), np.empty((3, samples))
        plain = np.ones(accelerometers) if weights is None else weights
        kernels.arrange(force, plain, centred, offset, energy, base)
        if weights is None:
            weighted = (precision @ centred.reshape(len(precision), -1)).reshape(centred.shape)
            base, energy = weighted.sum(axis=0), np.einsum("kct,kct->t", centred, weighted)
            centred, weights = weighted, np.empty(0)
        mean, information = model.noise.angular_rate_given_gyroscopes(rate, saturated)
        return cls(
            centred, offset, energy, base, np.ascontiguousarray(mean.T),
            np.ascontiguousarray(information.transpose(1, 2, 0)), weights,
            np.ascontiguousarray(precision), tables(),
        )  # fmt: skip

    @property
    def weighted(self) -> np.ndarray:
        """Lambda y, (A, 3, T)."""
        return self.weights[:, None, None] * self.force if self.weights.size else self.force

    def with_rates(self, covariance, mean=None) -> Self:
        """The data with the covariance (T, 3, 3) (rad/s)^2, and mean (T, 3), of angular rates."""
        require_shape("rate_covariance", np.asarray(covariance), (self.samples, 3, 3))
        precision = np.linalg.inv(covariance).transpose(1, 2, 0)
        return self._replace(
            rate_information=np.ascontiguousarray(precision),
            mean=self.mean if mean is None else np.ascontiguousarray(mean.T),
        )

    def rate_density(self, sd: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Mean (T, 3) rad/s and covariance (T, 3, 3) of p(omega | y_g), (15) of paper 2021.

        ``sd`` (rad/s) of omega's prior, infinite as in the paper. InputError where an axis of some
        sample has no unsaturated gyroscope.
        """
        information = self.rate_information.transpose(2, 0, 1)
        bad = np.flatnonzero(np.linalg.matrix_rank(information) < 3)
        if bad.size:
            raise InputError(
                "gyroscopes: expected one unsaturated per axis in every sample, found none in"
                f" sample {bad[0]} (and {bad.size - 1} more)"
            )
        if not np.isfinite(sd):
            return self.mean.T, np.linalg.inv(information)
        covariance = np.linalg.inv(information + np.eye(3) / sd**2)
        return np.einsum("tij,tjk,kt->ti", covariance, information, self.mean), covariance

    def reduce(self, positions) -> tuple[kernels.Reduced, float]:
        """(the recording with phi eliminated at ``positions`` (A, 3), log |H' Lambda H|)."""
        positions = np.ascontiguousarray(positions, float)
        require_shape("positions", positions, (len(self.force), 3))
        out = kernels.reduced(self.samples)
        return out, kernels.collapse(positions, self, out)


def estimate_motion(
    model: ArrayModel, specific_force, angular_rate, positions=None, saturated=None, limit: int = 50
) -> MotionEstimate:
    """Concentrated Gauss-Newton of Skog et al. (2017, eq. 5): phi is eliminated exactly.

    Parameters
    ----------
    specific_force : (T, A, 3) m/s^2
    angular_rate : (T, G, 3) rad/s
    positions : (A, 3) m or None for the nominal ones (relative to the reference triad)
    saturated : (T, G, 3) bool or None
        Gyroscope axes at the rail; they are left out, and their reading only starts the
        iteration (which fixes the sign when every gyroscope is lost).

    Raises
    ------
    IdentifiabilityError
        For fewer than three or collinear triads.
    """
    positions = model.array.relative if positions is None else np.asarray(positions, float)
    require_planar_extent(positions, "positions")
    data = Collapsed.of(model, specific_force, angular_rate, saturated)
    return motion_from(data, positions, limit)


def motion_from(data: Collapsed, positions, limit: int = 50) -> MotionEstimate:
    """`estimate_motion` for data already arranged, at most ``limit`` steps a sample."""
    positions = np.ascontiguousarray(positions, float)
    require_shape("positions", positions, (len(data.force), 3))
    rate, work = data.mean.copy(), workspace(data.samples)
    if np.isnan(most_likely(data, positions, rate, TOLERANCE, limit, work)):
        raise IdentifiabilityError(
            "positions: expected triads from which omega_dot and s follow, found H'QH singular"
        )
    return motion_estimate(data, rate, work.state, work.cost + work.reduced.const, work.counts)


def motion_estimate(data: Collapsed, rate, state, cost, iterations) -> MotionEstimate:
    """From what the kernels found: omega (3, T), (w, phi) (12, T), cost and steps (T,)."""
    motion = Motion.of(rate.T, state[6:9].T, (state[9:12] + data.offset).T)
    return MotionEstimate(motion, cost, np.abs(iterations), iterations > 0)
