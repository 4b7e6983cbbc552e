"""Offset, scale, misalignment and orientation of accelerometer triads by maximum likelihood.

All triads of a rigid array see the same specific force u_p in pose p, of known magnitude and
unknown direction: y_kp = M_k u_p + b_k + e. The reference triad's matrix M_1 is upper
triangular, which makes its axes the array frame (paper 2021, section IV-B, after its [18]).
Several recordings of a board share the matrices, and have offsets b_k of their own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from imuarray.errors import IdentifiabilityError, InputError
from imuarray.firstorder.parts import parts_sd_of
from imuarray.firstorder.pose_noise import SEEN, PoseNoise
from imuarray.firstorder.turns import procrustes, require_rotations
from imuarray.model.jax64 import jax, jnp

UPPER = np.triu_indices(3)

OUTLIER = 5.0  # times the median size of a residual
SHARED = 5.0  # times the median of what leaving out a pose gains, the worst of its triads apart
MOST_OFF = 0.5  # relative, of a pose's mean specific force from gravity
MOST_LEFT_OUT = 0.2  # of a triad's poses
NEARLY = 0.5  # of the largest gain: as many triads leave out a reading at once
MOST_STEPS, HALVED, CLOSE = 100, 12, 1e-8  # of Gauss-Newton; steps in sds
SMALL = np.radians(20.0)  # a triad turned by less starts from the drawing


class Fitted(NamedTuple):
    """All n parameters of a fit as `_unpack` has them, their covariance (n, n), and of what.

    ``mean`` (P, A, 3) m/s^2 in the poses; ``magnitude`` of gravity, m/s^2.
    """

    values: np.ndarray
    covariance: np.ndarray
    mean: np.ndarray
    magnitude: float


@dataclass(frozen=True)
class TriadFit:
    """What the P still poses of a recording, or of several, say of A accelerometer triads.

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
    direction_covariance : (3 P, 3 P), scaled like the other; along a direction it says nothing
    recording : (P,) int, the recording of each pose
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
    direction_covariance: np.ndarray
    recording: np.ndarray
    walk: np.ndarray
    doubtful: np.ndarray
    fitted: Fitted

    def beside_directions(self) -> np.ndarray:
        """Covariance (12 A, 3 P) of the matrices and offsets with all poses' directions."""
        out = np.zeros((len(self.covariance), self.fitted.mean.shape[0] * 3))
        place = _places(len(self.matrix))
        out[place] = self.fitted.covariance[: len(place), -out.shape[1] :]
        return out

    def carried(self, score, information) -> TriadFit:
        """What is left once rates have carried gravity from pose to pose.

        ``score`` (3 P,) and ``information`` (3 P, 3 P) of the directions, as `CommonMap` has them.
        """
        own = self.fitted
        along = own.covariance[:, -len(score) :]
        values, spread = own.values + along @ score, along @ information @ along.T
        own = own._replace(values=values, covariance=own.covariance - spread)
        return _result(
            own, self.used, self.recording, self.residual_ratio, self.walk, self.doubtful
        )

    @property
    def relied(self) -> np.ndarray:
        """(P, A) bool: used, in a pose that fits the others."""
        return self.used & (self.doubtful == 1)[:, None]

    def first(self) -> Self:
        """The same with the poses of the first recording only."""
        own = self.recording == 0
        both = np.ix_(np.repeat(own, 3), np.repeat(own, 3))
        return replace(
            self, direction=self.direction[own], residual=self.residual[own], used=self.used[own],
            direction_covariance=self.direction_covariance[both], recording=self.recording[own],
            doubtful=self.doubtful[own],
        )  # fmt: skip

    @property
    def residual_rms(self) -> np.ndarray:
        """Root mean square over the poses relied on and axes, (A,) m/s^2."""
        squares = np.mean(self.residual**2, axis=2)
        return np.sqrt(np.sum(squares * self.relied, axis=0) / self.relied.sum(axis=0))

    @property
    def residual_rms_all(self) -> np.ndarray:
        """The same over all poses, those left out included."""
        return np.sqrt(np.mean(self.residual**2, axis=(0, 2)))

    def parts_sd(self) -> dict[str, np.ndarray]:
        """Standard deviations of `parts_of` the matrices, and of the offset."""
        count = len(self.matrix)
        blocks = self.covariance.reshape(count, 12, count, 12)[range(count), :, range(count)]
        offset = np.sqrt(np.einsum("kii->ki", blocks[:, 9:, 9:]))
        return parts_sd_of(self.matrix, blocks[:, :9, :9]) | {"offset": offset}


def _unpack(p, triads, poses):
    """(matrices (A, 3, 3), offsets (R, A, 3), directions (P, 3) not normalised) from the flat p."""
    first = jnp.zeros((3, 3)).at[UPPER].set(p[:6])
    split, end = 6 + 9 * (triads - 1), len(p) - 3 * poses
    others = p[6:split].reshape(triads - 1, 3, 3)
    offsets = p[split:end].reshape(-1, triads, 3)
    return jnp.concatenate([first[None], others]), offsets, p[end:].reshape(-1, 3)


def _predicted(p, triads, magnitude, recording):
    matrices, offsets, directions = _unpack(p, triads, len(recording))
    length = jnp.sqrt(jnp.sum(directions**2, axis=1, keepdims=True))
    force = magnitude * directions / length
    return jnp.einsum("kij,pj->pki", matrices, force) + offsets[recording]


def fit_triads(mean, sd, magnitude: float, labels=None, recording=None, time=None) -> TriadFit:
    """ML estimate from the poses' averages, without the readings that stand far out.

    A triad whose offset has jumped or drifts (sensors settling after power-on do) spoils the
    directions for all others. One reading of one triad in one pose is left out at a time, the
    one whose absence helps most, as long as that is more than OUTLIER squared times the usual;
    never more than a fifth of a triad's. A pose that stands out in all triads, as where the board
    was not quite still, counts by as much less. A triad may be turned by any angle against the
    first.

    Parameters
    ----------
    mean : (P, A, 3) m/s^2, average reading in each pose
    sd : (P, A, 3) m/s^2, standard deviation of that average
    magnitude : float, m/s^2, gravity where the recording was made
    labels : of the triads, for messages; by default their numbers
    recording : (P,) int, which of several recordings of the board, from 0, each pose is from; the
        board was not taken apart between them. By default all are of one.
    time : (P,) s of each pose, after the instant at which its recording's offsets are asked for; by
        default offsets do not walk

    Raises
    ------
    InputError
        Where the mean over triads is nowhere near ``magnitude``, or a triad is mirrored.
    IdentifiabilityError
        Where the poses are too few or too alike to determine all parameters.
    """
    recording = np.zeros(len(mean), int) if recording is None else np.asarray(recording)
    time = np.zeros(len(mean)) if time is None else np.asarray(time)
    turns = _turns(mean, labels or [str(k + 1) for k in range(mean.shape[1])])
    # all triads' mean in the frame of the first
    unit = np.einsum("kji,pkj->pki", turns, mean).mean(axis=1) / magnitude
    size = np.linalg.norm(unit, axis=1)
    wild = np.flatnonzero(~(np.abs(size - 1) < MOST_OFF))
    if wild.size:
        raise InputError(
            f"still poses: expected specific forces of about {magnitude:g} m/s^2, found"
            f" {size[wild[0]] * magnitude:.3g} in pose {wild[0] + 1}; are the units right?"
        )
    given = _Poses(mean, magnitude, recording, turns, unit)
    noise = PoseNoise.of(sd, time, recording)
    found = _without_outliers(given, noise)
    own = _doubted(noise, found.doubtful)
    if found.residual_ratio > SEEN or own.misfits(found.used, found.residual) > SEEN:
        noise = own.estimated(found.used, *given.linearised(found.fitted.values))
        if noise.walk.any():
            noise = noise._replace(sd=np.asarray(sd))
            found = _without_outliers(given, noise)
            found = replace(found, residual_ratio=_ratio(given, noise, found))
    return found


class _Poses(NamedTuple):
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

    def linearised(self, p) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Misfit (P, A, 3), slopes (P, A, 3, n) of the averages, information on free lengths."""
        given = len(self.turns), self.magnitude, self.recording
        misfit, slopes = self.mean - np.asarray(_predict(p, *given)), _slopes(p, *given)
        lengths = np.asarray(_length_slopes(p, len(self.mean)))
        return misfit, np.asarray(slopes), lengths.T @ lengths


def _ratio(given: _Poses, noise: PoseNoise, found: TriadFit) -> float:
    """Residual over the readings' noise and the walk, without what else a triad scatters by."""
    plain = _doubted(noise._replace(factor=np.ones_like(noise.factor)), found.doubtful)
    misfit = np.moveaxis(found.residual, 0, -1)[..., None]
    freedom = 3 * int(found.used.sum()) + len(found.used) - len(found.fitted.values)
    square = np.sum((plain.whitening(found.used) @ misfit) ** 2)
    return float(np.sqrt(square / freedom)) if freedom > 0 else np.nan


def _without_outliers(given: _Poses, noise: PoseNoise, doubts: bool = True) -> TriadFit:
    """``doubts``: of whole poses, too; none where more stand out than the others can tell."""
    poses, triads = given.mean.shape[:2]
    used, doubtful = np.ones((poses, triads), bool), np.ones(poses)
    # nine unknowns are common to all triads
    most, start = min(int(MOST_LEFT_OUT * poses), (poses - 9) // 3), given.start()
    while True:
        found, gain, whole = _fit(given, noise, used, doubtful, start)
        start = found.fitted.values
        out = used & (gain > OUTLIER**2 * np.median(gain[used]))
        out[:, (~used).sum(axis=0) >= MOST_LEFT_OUT * poses] = False
        out[used.sum(axis=1) <= 1] = False
        beside, gain = whole - gain.max(axis=1), np.where(out, gain, 0.0)
        worst = int(np.argmax(gain.max(axis=1)))
        pose = _shared(out, worst, beside) if doubts and triads > 1 else -1
        if pose >= 0 and doubtful[pose] == 1:
            if (doubtful > 1).sum() >= most:
                return _without_outliers(given, noise, doubts=False)
            # all err alike, but count as if each erred by itself
            doubtful[pose], used[pose] = max(np.sqrt(whole[pose]), OUTLIER), True
        elif out.any():  # the worst of each triad, one in a pose, if nearly as bad as that of all
            own = gain.max(axis=0)
            bad = np.argsort(-own)[: np.sum(own > NEARLY * own.max())]
            place, first = np.unique(gain[:, bad].argmax(axis=0), return_index=True)
            used[place, bad[first]] = False
        else:
            return found


def _shared(out, worst: int, beside) -> int:
    """The pose that stands out in most triads, or -1.

    ``out`` (P, A) whose readings do, in the pose ``worst`` most; ``beside`` (P,) what leaving out a
    pose gains, beside the worst triad's.
    """
    if out.any() and 2 * out[worst].sum() <= out.shape[1]:
        return -1
    pose = worst if out.any() else int(np.argmax(beside))
    return pose if beside[pose] > SHARED * max(np.median(beside), out.shape[1]) else -1


def _doubted(noise: PoseNoise, doubtful) -> PoseNoise:
    return noise._replace(sd=noise.sd * doubtful[:, None, None])


def _turns(mean, labels) -> np.ndarray:
    """How far each triad is turned against the first, (A, 3, 3); small turns are the fit's own."""
    turns = np.array([procrustes(own, mean[:, 0]) for own in np.moveaxis(mean, 1, 0)])
    require_rotations(turns, labels, "accelerometer")
    small = (np.einsum("kii->k", turns) - 1) / 2 > np.cos(SMALL)
    turns[small] = np.eye(3)
    return turns


def _lengths(p, poses):
    """Fixes the directions' free lengths at 1; zero at the solution, so it costs nothing."""
    return jnp.sum(p[-3 * poses :].reshape(-1, 3) ** 2, axis=1) - 1.0


_predict = jax.jit(_predicted, static_argnums=1)
_slopes = jax.jit(jax.jacfwd(_predicted), static_argnums=1)
_length_slopes = jax.jit(jax.jacfwd(_lengths), static_argnums=1)


def _fit(
    given: _Poses, noise: PoseNoise, used, doubtful, start
) -> tuple[TriadFit, np.ndarray, np.ndarray]:
    """Least squares over the readings ``used``; also what leaving each, or a pose, out would gain.

    The gain (P, A), (P,) is how much the sum of squares would fall (by linear theory), so that a
    reading which bends the fit to itself is seen for what it is.
    """
    poses, triads = used.shape
    options = triads, given.magnitude, given.recording
    white = _doubted(noise, doubtful).whitening(used)

    def residual(p):
        misfit = np.moveaxis(given.mean - np.asarray(_predict(p, *options)), 0, -1)
        return np.concatenate([(white @ misfit[..., None]).ravel(), _lengths(p, poses)])

    def slopes(p):
        own = np.moveaxis(np.asarray(_slopes(p, *options)), 0, -2)
        return np.concatenate([-(white @ own).reshape(-1, len(p)), _length_slopes(p, poses)])

    values, left, right = _solved(residual, slopes, start, poses)
    rest, inverse = residual(values), np.linalg.inv(right)
    count = white.shape[0] * 3 * poses
    gain, whole = _gain(white, left[:count], rest[:count])
    freedom = 3 * int(used.sum()) + poses - values.size
    ratio = np.sqrt(rest @ rest / freedom) if freedom > 0 else np.nan
    scale = max(ratio, 1.0) if freedom > 0 else 1.0
    own = Fitted(values, scale**2 * inverse @ inverse.T, given.mean, given.magnitude)
    walk = np.sqrt(noise.walk)
    return _result(own, used, given.recording, float(ratio), walk, doubtful.copy()), gain, whole


def _solved(residual, slopes, start, poses: int):
    """Gauss-Newton: values (n,), and Q (m, n), R (n, n) of the slopes there.

    IdentifiabilityError where they do not determine all values.
    """
    values, rest = start, residual(start)
    for _ in range(MOST_STEPS):
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
        for share in 0.5 ** np.arange(HALVED):
            moved = values + share * whole / norm
            after = residual(moved)
            if after @ after <= rest @ rest:
                values, rest = moved, after
                break
        else:
            break
        if np.abs(whole).max() < CLOSE:
            break
    return values, left, right * norm


def _gain(white, left, misfit) -> tuple[np.ndarray, np.ndarray]:
    """What leaving out a triad's reading in a pose (P, A), or a pose (P,), takes off the squares.

    ``white`` (A, 3, P, P), left singular vectors and misfit of white averages, row by row.
    """
    back = np.swapaxes(white, -1, -2)
    rows = np.moveaxis(back @ left.reshape(*white.shape[:3], -1), 2, 0)
    misfit = np.moveaxis(back @ misfit.reshape(*white.shape[:3], 1), 2, 0)[..., 0]
    weight = np.moveaxis(np.sum(white**2, axis=2), 2, 0)
    size = np.sqrt(np.where(weight > 0, weight, 1.0))
    rows, misfit = rows / size[..., None], misfit / size
    poses = len(rows)
    return _spared(rows, misfit), _spared(rows.reshape(poses, -1, rows.shape[-1]),
                                          misfit.reshape(poses, -1))  # fmt: skip


def _spared(rows, misfit) -> np.ndarray:
    """(...) of misfits (..., m) with left singular vectors ``rows`` (..., m, n)."""
    free = np.eye(misfit.shape[-1]) - rows @ np.swapaxes(rows, -1, -2)
    # what alone determines something cannot be spared: its inverse is kept finite
    solved = np.linalg.solve(free + 1e-9 * np.eye(free.shape[-1]), misfit[..., None])[..., 0]
    return np.sum(misfit * solved, axis=-1)


def _places(triads: int) -> np.ndarray:
    """Where the matrices' and the first recording's offsets' parameters are among (12 A,)."""
    return np.concatenate(
        [3 * UPPER[0] + UPPER[1]]
        + [12 * k + np.arange(9) for k in range(1, triads)]
        + [12 * k + 9 + np.arange(3) for k in range(triads)]
    )


def _result(own: Fitted, used, recording, ratio: float, walk, doubtful) -> TriadFit:
    poses, triads = used.shape
    matrices, offsets, directions = (np.asarray(x) for x in _unpack(own.values, triads, poses))
    place = _places(triads)
    covariance = np.zeros((12 * triads, 12 * triads))
    covariance[np.ix_(place, place)] = own.covariance[: len(place), : len(place)]
    direction = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    residual = own.mean - np.asarray(_predict(own.values, triads, own.magnitude, recording))
    return TriadFit(
        matrices, offsets[0], direction, residual, covariance, ratio, used,
        own.covariance[-3 * poses :, -3 * poses :], recording, walk, doubtful, own,
    )  # fmt: skip
