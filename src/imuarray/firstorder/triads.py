"""Offset, scale, misalignment and orientation of accelerometer triads by maximum likelihood.

All triads of a rigid array see the same specific force u_p in pose p, of known magnitude and
unknown direction: y_kp = M_k u_p + b_k + e. The reference triad's matrix M_1 is upper
triangular, which makes its axes the array frame (paper 2021, section IV-B, after its [18]).
Several recordings of a board share the matrices, and have offsets b_k of their own.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from imuarray.errors import IdentifiabilityError
from imuarray.firstorder.pose_noise import PoseNoise
from imuarray.firstorder.settings import SETTINGS
from imuarray.firstorder.turns import parts_sd_of, procrustes, require_rotations
from imuarray.linear import diagonal_blocks
from imuarray.model.jax64 import jax, jnp

UPPER = np.triu_indices(3)
GONE = 3, 5, 5  # where the first matrix's zeros are missing among the others of its entries
SMALL = np.radians(20.0)  # a triad turned by less starts from the drawing


class Fitted(NamedTuple):
    """All n parameters of a fit as `_unpack` has them, their covariance (n, n), and of what."""

    values: np.ndarray
    covariance: np.ndarray
    given: "Poses"

    def spread(self, place) -> np.ndarray:
        """Covariance (n + 3, ...) of all, the first matrix's zeros too, with those at ``place``."""
        return np.insert(np.insert(self.covariance, GONE, 0.0, 0), GONE, 0.0, 1)[:, place]


@dataclass(frozen=True)
class TriadFit:
    """Fit of A accelerometer triads to the P still poses of a recording, or of several.

    Attributes
    ----------
    matrix : (A, 3, 3), reading = matrix @ specific force + offset; the first upper triangular
    offset : (A, 3) m/s^2, in the first recording
    direction : (P, 3) unit vectors of the specific force in the poses
    residual : (P, A, 3) m/s^2
    covariance : (12 A, 12 A) of (matrix row by row, offset) triad by triad, scaled to the
        residual; rows of the fixed zeros are zero
    residual_ratio : float
        Residual over what the noise of the poses' averages, and the walk of offsets, explain; 1 if
        nothing else is there.
    used : (P, A) bool
        False where a triad's reading in a pose was left out as an outlier.
    walk : (A,) m/s^2 per root of a second, sd of an offset's walk; 0 where none shows
    doubtful : (P,) factor of a pose's noise, more than 1 where no triad says what the others do
    fitted : what the poses of all recordings gave
    """

    matrix: np.ndarray
    offset: np.ndarray
    direction: np.ndarray
    residual: np.ndarray
    covariance: np.ndarray
    residual_ratio: float
    used: np.ndarray
    walk: np.ndarray
    doubtful: np.ndarray
    fitted: Fitted

    def beside_directions(self) -> np.ndarray:
        """Covariance (9 A, 3 P) of the matrices with all poses' directions."""
        return self.fitted.spread(slice(-self.fitted.given.unit.size, None))[: self.matrix.size]

    def carried(self, score, information) -> Self:
        """The fit once rates have carried gravity from pose to pose.

        ``score`` (3 P,) and ``information`` (3 P, 3 P) of the directions, as `CommonMap` has them.
        """
        own = self.fitted
        along = own.covariance[:, -len(score) :]
        values, spread = own.values + along @ score, along @ information @ along.T
        own = own._replace(values=values, covariance=own.covariance - spread)
        return _result(own, self.used, self.residual_ratio, self.walk, self.doubtful)

    @property
    def relied(self) -> np.ndarray:
        """(P, A) bool: used, in a pose that fits the others."""
        return self.used & (self.doubtful == 1)[:, None]

    def of(self, number: int) -> Self:
        """The fit with one recording's poses only, and its offsets."""
        own = self.fitted.given.recording == number
        offset, covariance = _offset_of(self.fitted, len(self.matrix), number)
        return replace(
            self, offset=offset, covariance=covariance, direction=self.direction[own],
            residual=self.residual[own], used=self.used[own], doubtful=self.doubtful[own],
        )  # fmt: skip

    @property
    def residual_rms(self) -> np.ndarray:
        """Root mean square over the poses relied on and axes, (A,) m/s^2."""
        squares = np.mean(self.residual**2, axis=2)
        return np.sqrt(np.sum(squares * self.relied, axis=0) / self.relied.sum(axis=0))

    def parts_sd(self) -> dict[str, np.ndarray]:
        """Standard deviations of `parts_of` the matrices, and of the offset."""
        blocks = diagonal_blocks(self.covariance, 12)
        offset = np.sqrt(np.einsum("kii->ki", blocks[:, 9:, 9:]))
        return parts_sd_of(self.matrix, blocks[:, :9, :9]) | {"offset": offset}


def _unpack(p, triads, poses):
    """(matrices (A, 3, 3), offsets (R, A, 3), directions (P, 3) not normalised) from the flat p."""
    # slices and methods alone: the same for NumPy, for which JAX would compile each step by itself
    known = 9 * triads - len(GONE)
    there, place = (np.insert(x, GONE, 0) for x in (np.ones(known), np.arange(known)))
    matrices = (p[place] * there).reshape(triads, 3, 3)
    offsets, directions = p[known : len(p) - 3 * poses], p[len(p) - 3 * poses :]
    return matrices, offsets.reshape(-1, triads, 3), directions.reshape(poses, 3)


def _predicted(p, triads, magnitude, recording):
    matrices, offsets, directions = _unpack(p, triads, len(recording))
    length = jnp.sqrt(jnp.sum(directions**2, axis=1, keepdims=True))
    force = magnitude * directions / length
    return jnp.einsum("kij,pj->pki", matrices, force) + offsets[recording]


class Poses(NamedTuple):
    """Averages (P, A, 3) m/s^2 in P poses, gravity, whose poses; where a fit starts."""

    mean: np.ndarray
    magnitude: float
    recording: np.ndarray
    turns: np.ndarray
    unit: np.ndarray

    def start(self) -> np.ndarray:
        offsets = np.zeros(3 * len(self.turns) * (1 + self.recording.max()))
        matrices = np.eye(3)[UPPER], self.turns[1:].ravel()
        return np.concatenate([*matrices, offsets, self.unit.ravel()])

    def misfit(self, p) -> np.ndarray:
        """(P, A, 3) of the averages."""
        return self.mean - np.asarray(_predict(p, len(self.turns), self.magnitude, self.recording))

    def slopes(self, p) -> np.ndarray:
        """(P, A, 3, n) of what the parameters predict."""
        return np.asarray(_slopes(p, len(self.turns), self.magnitude, self.recording))

    def linearised(self, p) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Misfit, slopes, and information (n, n) on free lengths."""
        lengths = np.asarray(_length_slopes(p, len(self.mean)))
        return self.misfit(p), self.slopes(p), lengths.T @ lengths


def doubted(noise: PoseNoise, doubtful) -> PoseNoise:
    return noise._replace(sd=noise.sd * doubtful[:, None, None])


def turns_of(mean, labels) -> np.ndarray:
    """Turns of the triads against the first, (A, 3, 3); small turns are the fit's own."""
    turns = np.array([procrustes(own, mean[:, 0]) for own in np.moveaxis(mean, 1, 0)])
    require_rotations(turns, labels, "accelerometer")
    small = (np.einsum("kii->k", turns) - 1) / 2 > np.cos(SMALL)
    turns[small] = np.eye(3)
    return turns


def _lengths(p, poses):
    """Fixes the directions' free lengths at 1; zero at the solution, so it costs nothing."""
    return (p[-3 * poses :].reshape(-1, 3) ** 2).sum(axis=1) - 1.0


_predict = jax.jit(_predicted, static_argnums=1)
_slopes = jax.jit(jax.jacfwd(_predicted), static_argnums=1)
_length_slopes = jax.jit(jax.jacfwd(_lengths), static_argnums=1)


def least_squares(
    given: Poses, noise: PoseNoise, used, doubtful, start
) -> tuple[TriadFit, np.ndarray, np.ndarray]:
    """Least squares over the readings ``used``; left singular vectors (P, A, 3, n), and misfits.

    Both of averages as white as they can be reading by reading.
    """
    poses = len(used)
    white = doubted(noise, doubtful).whitening(used)

    def residual(p):
        misfit = np.moveaxis(given.misfit(p), 0, -1)
        return np.concatenate([(white @ misfit[..., None]).ravel(), _lengths(p, poses)])

    def slopes(p):
        own = np.moveaxis(given.slopes(p), 0, -2)
        return np.concatenate([-(white @ own).reshape(-1, len(p)), _length_slopes(p, poses)])

    values, left, right = _solved(residual, slopes, start, poses)
    rest, inverse = residual(values), np.linalg.inv(right)
    count = white.shape[0] * 3 * poses
    rows = _by_reading(white, left[:count])
    misfit = _by_reading(white, rest[:count, None])[..., 0]
    freedom = 3 * int(used.sum()) + poses - values.size
    ratio = np.sqrt(rest @ rest / freedom) if freedom > 0 else np.nan
    scale = max(ratio, 1.0) if freedom > 0 else 1.0
    own = Fitted(values, scale**2 * inverse @ inverse.T, given)
    found = _result(own, used, float(ratio), np.sqrt(noise.walk), doubtful.copy())
    return found, rows, misfit


def _solved(residual, slopes, start, poses: int):
    """Gauss-Newton: values (n,), and Q (m, n), R (n, n) of the slopes there.

    IdentifiabilityError where they do not determine all values.
    """
    values, rest = start, residual(start)
    for _ in range(SETTINGS.triad_steps):
        rows = slopes(values)
        norm = np.linalg.norm(rows, axis=0)
        left, right = np.linalg.qr(rows / np.where(norm > 0, norm, 1.0))
        sizes = np.linalg.svd(right, compute_uv=False)
        rank = int(np.sum(sizes > 1e-7 * sizes[0]))
        if rank < values.size:
            raise IdentifiabilityError(
                f"still poses: expected about twelve or more directions, found {poses}, which"
                f" determine {rank} of {values.size} unknowns"
            )
        whole = -np.linalg.solve(right, left.T @ rest)
        for share in 0.5 ** np.arange(SETTINGS.triad_halvings):
            moved = values + share * whole / norm
            after = residual(moved)
            if after @ after <= rest @ rest:
                values, rest = moved, after
                break
        else:
            break
        if np.abs(whole).max() < SETTINGS.triad_close:
            break
    return values, left, right * norm


def _by_reading(white, values) -> np.ndarray:
    """(P, A, 3, n) of values (A * 3 * P, n) of white averages: ``white`` (A, 3, P, P) undone."""
    back = np.swapaxes(white, -1, -2) @ values.reshape(*white.shape[:3], -1)
    weight = np.sum(white**2, axis=2)[..., None]
    return np.moveaxis(back / np.sqrt(np.where(weight > 0, weight, 1.0)), 2, 0)


def _offset_of(own: Fitted, triads: int, number: int) -> tuple[np.ndarray, np.ndarray]:
    """A recording's offsets (A, 3), and the covariance (12 A, 12 A) of matrices and these."""
    first = 9 * triads + 3 * triads * number
    mine = np.arange(first, first + 3 * triads).reshape(-1, 3)
    place = np.hstack([np.arange(9 * triads).reshape(-1, 9), mine]).ravel()
    return own.values[mine - len(GONE)], own.spread(place)[place]


def _result(own: Fitted, used, ratio: float, walk, doubtful) -> TriadFit:
    poses, triads = used.shape
    matrices, _, directions = _unpack(own.values, triads, poses)
    offset, covariance = _offset_of(own, triads, 0)
    direction = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return TriadFit(
        matrices, offset, direction, own.given.misfit(own.values), covariance, ratio, used,
        walk, doubtful, own,
    )  # fmt: skip
