"""Accelerometer triads from still poses without the readings, and whole poses, that stand out."""

from dataclasses import replace

import numpy as np

from imuarray.errors import InputError
from imuarray.firstorder.pose_noise import PoseNoise
from imuarray.firstorder.settings import SETTINGS
from imuarray.firstorder.triads import Poses, TriadFit, doubted, least_squares, turns_of


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
        Where the mean over triads is nowhere near ``magnitude``, gravity was taken out, or a triad
        is mirrored.
    IdentifiabilityError
        Where the poses are too few or too alike to determine all parameters.
    """
    sizes = np.linalg.norm(mean, axis=2)
    size, alike = np.median(sizes), np.std(sizes) < SETTINGS.gravity_alike * np.mean(sizes)
    # of one size in all poses and triads it is gravity all the same, in another unit
    if 0 < size < SETTINGS.gravity_gone * magnitude and not alike:
        raise InputError(
            f"still poses: expected gravity in the readings, found {size:.2g} m/s^2: it was taken"
            " out (linear acceleration); log the raw accelerometers"
        )
    recording = np.zeros(len(mean), int) if recording is None else np.asarray(recording)
    time = np.zeros(len(mean)) if time is None else np.asarray(time)
    turns = turns_of(mean, labels or [str(k + 1) for k in range(mean.shape[1])])
    # all triads' mean in the frame of the first
    unit = np.einsum("kji,pkj->pki", turns, mean).mean(axis=1) / magnitude
    size = np.linalg.norm(unit, axis=1)
    wild = np.flatnonzero(~(np.abs(size - 1) < SETTINGS.gravity_off))
    if wild.size:
        raise InputError(
            f"still poses: expected specific forces of about {magnitude:g} m/s^2, found"
            f" {size[wild[0]] * magnitude:.3g} in pose {wild[0] + 1}; are unit and --gravity right?"
        )
    given = Poses(mean, magnitude, recording, turns, unit)
    noise = PoseNoise.of(sd, time, recording)
    found = _without_outliers(given, noise)
    own = doubted(noise, found.doubtful)
    if (
        found.residual_ratio > SETTINGS.walk_seen
        or own.misfits(found.used, found.residual) > SETTINGS.walk_seen
    ):
        noise = own.estimated(found.used, *given.linearised(found.fitted.values))
        if noise.walk.any():
            noise = noise._replace(sd=np.asarray(sd))
            found = _without_outliers(given, noise)
            found = replace(found, residual_ratio=_ratio(noise, found))
    return found


def _ratio(noise: PoseNoise, found: TriadFit) -> float:
    """Residual over the readings' noise and the walk, without what else a triad scatters by."""
    plain = doubted(noise._replace(factor=np.ones_like(noise.factor)), found.doubtful)
    misfit = np.moveaxis(found.residual, 0, -1)[..., None]
    freedom = 3 * int(found.used.sum()) + len(found.used) - len(found.fitted.values)
    square = np.sum((plain.whitening(found.used) @ misfit) ** 2)
    return float(np.sqrt(square / freedom)) if freedom > 0 else np.nan


def _without_outliers(given: Poses, noise: PoseNoise, doubts: bool = True) -> TriadFit:
    """``doubts``: of whole poses, too; none where more stand out than the others can tell."""
    poses, triads = given.mean.shape[:2]
    used, doubtful = np.ones((poses, triads), bool), np.ones(poses)
    # nine unknowns are common to all triads
    most, start = min(int(SETTINGS.poses_left_out * poses), (poses - 9) // 3), given.start()
    while True:
        found, rows, misfit = least_squares(given, noise, used, doubtful, start)
        gain = _spared(rows, misfit)
        whole = _spared(rows.reshape(poses, 3 * triads, -1), misfit.reshape(poses, -1))
        start = found.fitted.values
        out = used & (gain > SETTINGS.pose_outlier**2 * np.median(gain[used]))
        out[:, (~used).sum(axis=0) >= SETTINGS.poses_left_out * poses] = False
        out[used.sum(axis=1) <= 1] = False
        beside, gain = whole - gain.max(axis=1), np.where(out, gain, 0.0)
        worst = int(np.argmax(gain.max(axis=1)))
        pose = _shared(out, worst, beside) if doubts and triads > 1 else -1
        if pose >= 0 and doubtful[pose] == 1:
            if (doubtful > 1).sum() >= most:
                return _without_outliers(given, noise, doubts=False)
            # all err alike, but count as if each erred by itself
            doubtful[pose], used[pose] = max(np.sqrt(whole[pose]), SETTINGS.pose_outlier), True
        elif out.any():  # the worst of each triad, one in a pose, if nearly as bad as that of all
            own = gain.max(axis=0)
            bad = np.argsort(-own)[: np.sum(own > SETTINGS.pose_nearly * own.max())]
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
    return (
        pose if beside[pose] > SETTINGS.pose_shared * max(np.median(beside), out.shape[1]) else -1
    )


def _spared(rows, misfit) -> np.ndarray:
    """(...) that leaving out what has misfits (..., m) takes off the sum of squares.

    By linear theory, ``rows`` (..., m, n) of the left singular vectors: what bends the fit to
    itself is seen for what it is.
    """
    free = np.eye(misfit.shape[-1]) - rows @ np.swapaxes(rows, -1, -2)
    # what alone determines something cannot be spared: its inverse is kept finite
    solved = np.linalg.solve(free + 1e-9 * np.eye(free.shape[-1]), misfit[..., None])[..., 0]
    return np.sum(misfit * solved, axis=-1)
