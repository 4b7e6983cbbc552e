"""Still poses of a recording, found by itself, and the Allan deviation of their readings.

Still is where array-averaged readings only show noise; the deviation tells which part of it
averaging can remove.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.ndimage import uniform_filter1d

from imuarray.errors import InputError
from imuarray.firstorder.settings import SETTINGS
from imuarray.firstorder.turns import nearest_orthogonal
from imuarray.recording import Recording
from imuarray.recording.channels import require_live, require_once, runs
from imuarray.recording.record import KINDS
from imuarray.recording.units import GRAVITY, require_plausible_rate

TURNING = np.radians(2.0)  # rad/s of all gyroscopes: a steady turn, as offsets do not go together


@dataclass(frozen=True)
class Still:
    """A recording's P still poses, and what its sensors read in them."""

    recording: Recording
    poses: list[slice]

    @classmethod
    def of(cls, recording: Recording, shortest: float) -> Self:
        """With poses of ``shortest`` s at least; InputError also for dead or doubled channels."""
        require_live(recording)
        require_once(recording)
        return cls(recording, still_poses(recording, shortest))

    def pieces(self, kind: str) -> list[np.ndarray]:
        """Readings (n, K, 3) of a kind of sensor in each pose."""
        readings = getattr(self.recording, KINDS[kind])
        return [readings[pose] for pose in self.poses]

    @property
    def counts(self) -> np.ndarray:
        """(P,) of samples."""
        return np.array([pose.stop - pose.start for pose in self.poses])

    def means(self, kind: str) -> np.ndarray:
        """(P, K, 3) mean readings of a kind in each pose."""
        return np.array([piece.mean(axis=0) for piece in self.pieces(kind)])

    def noise(self, kind: str, of: Callable) -> np.ndarray:
        """(K, 3) noise of a kind, ``of`` pieces (n, K, 3) and a step (`reading_sd`, `averaged_sd`).

        The declared one of gyroscopes where most of their readings are exactly 0.
        """
        pieces = self.pieces(kind)
        sd = of(pieces, usual_step(self.recording.time))
        if kind == "accelerometer":  # one that is quantised and never changes has no spread
            return np.maximum(sd, 1e-6 * GRAVITY)
        dead = np.mean(np.concatenate(pieces) == 0.0, axis=0) > SETTINGS.dead_band
        return np.where(dead, self.recording.gyroscope_noise_sd, sd)

    @property
    def moving(self) -> np.ndarray:
        """(T,) bool: in no pose."""
        found = np.ones(len(self.recording.time), bool)
        found[np.r_[tuple(self.poses)]] = False
        return found

    @property
    def after_moving(self) -> np.ndarray:
        """(P,) s of the poses' middles after the moving samples', where offsets are wanted."""
        time, moving = self.recording.time, self.moving
        middle = np.median(time[moving]) if moving.any() else time[-1]
        return np.array([time[pose].mean() for pose in self.poses]) - middle

    @property
    def tells(self) -> bool:
        """True where poses say more than offsets of their own: in two orientations they do not."""
        means = self.means("accelerometer")[:, 0]
        sizes = np.linalg.svd(means - means.mean(axis=0), compute_uv=False)
        return len(means) > 2 and sizes[1] > SETTINGS.orientations * GRAVITY


def allan_deviation(pieces, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Overlapping Allan deviation pooled over still pieces.

    Parameters
    ----------
    pieces : list of (n, ...) arrays, readings of still poses, equally spaced
    step : float, s, between samples

    Returns
    -------
    taus (S,) s, octaves up to a third of the longest piece, and deviations (S, ...) in the
    readings' unit. Each piece counts with its number of overlapping differences; pieces shorter
    than 2 tau + 1 samples do not count.
    """
    longest = max(len(piece) for piece in pieces)
    widths = 2 ** np.arange(int(np.log2(max(longest / 3, 1))) + 1)
    widths = widths[2 * widths <= longest]
    sums = [_sums(piece) for piece in pieces]
    return widths * step, np.array([_deviation(sums, n) for n in widths])


def _sums(piece) -> np.ndarray:
    """Sums of a piece's readings less their mean, before each of them and after all."""
    return np.concatenate([np.zeros((1, *piece.shape[1:])), np.cumsum(piece - piece.mean(0), 0)])


def _deviation(sums, width: int) -> np.ndarray:
    """Deviation of averages over ``width`` samples, from the pieces that are long enough."""
    total, count = 0.0, 0
    for s in sums:
        if len(s) > 2 * width:
            second = (s[2 * width :] - 2 * s[width:-width] + s[: -2 * width]) / width
            total, count = total + np.sum(second**2, axis=0), count + len(second)
    return np.sqrt(total / (2 * count))


def reading_sd(pieces, step: float) -> np.ndarray:
    """Noise sd of one reading, (...), within AVERAGED: blind to what drifts more slowly."""
    squares, freedom = 0.0, 0
    for piece in pieces:
        count = max(round(len(piece) * step / SETTINGS.averaged), 1)
        for part in np.array_split(piece, count):
            squares = squares + np.sum((part - part.mean(axis=0)) ** 2, axis=0)
            freedom += len(part) - 1
    return np.sqrt(squares / max(freedom, 1))


def averaged_sd(pieces, step: float) -> np.ndarray:
    """Sd of white noise of which averages scatter as those of BLOCK do, (...).

    Behind a filter neighbours are alike: averages scatter more than one reading's sd says.
    """
    usual = int(np.median([len(piece) for piece in pieces]))
    width = max(min(round(SETTINGS.average_block / step), usual // 4), 1)
    return _deviation([_sums(piece) for piece in pieces], width) * np.sqrt(width)


def lag_correlation(pieces) -> np.ndarray:
    """Correlation of neighbouring readings, (...); zero for white noise."""
    return _neighbours([piece - piece.mean(axis=0) for piece in pieces], 0.0)


def smoothing(pieces) -> np.ndarray:
    """Correlation of neighbouring readings in the fastest noise, (...): 0 white, 1 averaged.

    Of their differences, which no drift moves: -1/2 for white noise, -(1 - r) / 2 for noise of
    correlation r, 0 for a moving average.
    """
    return 1 + 2 * _neighbours([np.diff(piece, axis=0) for piece in pieces], -0.5)


def _neighbours(pieces, constant: float) -> np.ndarray:
    """Correlation of neighbours about zero, (...); ``constant`` where all are zero."""
    products = np.concatenate([x[1:] * x[:-1] for x in pieces]).mean(axis=0)
    squares = np.concatenate([x**2 for x in pieces]).mean(axis=0)
    return np.where(squares > 0, products / np.where(squares > 0, squares, 1.0), constant)


def window_spread(readings: np.ndarray, window: int) -> np.ndarray:
    """Root mean variance over axes of readings (T, 3) in a centred window of samples, (T,)."""
    # sums of centred values keep the rounding far below the noise
    centred = readings - readings.mean(axis=0)
    mean, square = (uniform_filter1d(x, window, axis=0) for x in (centred, centred**2))
    spread = np.sqrt(np.maximum(square - mean**2, 0.0).mean(axis=1))
    inside = window // 2, len(readings) - window + window // 2
    return spread[np.clip(np.arange(len(readings)), *inside)]


def still_poses(recording: Recording, shortest=SETTINGS.shortest) -> list[slice]:
    """Index ranges in which the array does not move, in the order of time.

    The spread of the array-averaged specific force and angular rate in a sliding window is
    compared with its floor, the recording's own quietest windows. A window that touches a motion
    is not quiet, so half a window at each end of a pose is left out; up to as much again is cut as
    a margin, from what is longer than KEPT. ``shortest`` (s) is a pose with all of its ends. A
    declared mask ``stationary`` is used instead, as it is, where the recording has one. A gap
    longer than BRIDGED or a step of the specific force ends a pose.

    Where all gyroscopes read another rate than in most poses the board turns steadily.

    Raises
    ------
    InputError
        Where nothing is still: no run long enough (with the longest found), or a floor far above
        the declared noise; where stamps come in bursts.
    """
    require_plausible_rate(recording.time, "recording: time")
    step = usual_step(recording.time)
    width = max(int(round(SETTINGS.window / step)), 2)
    if len(recording.time) < 2 * width:
        raise InputError(
            f"recording: expected at least {2 * SETTINGS.window:g} s to look for still poses in,"
            f" found {np.ptp(recording.time) if len(recording.time) else 0.0:.3g} s"
        )
    if recording.stationary is not None:
        still, half = (recording.stationary & ~_steps(recording, step)), 0
    else:
        still, half = _quiet(recording, width), width // 2
    # a long gap ends a pose: what happened meanwhile is not known
    breaks = (
        np.flatnonzero(np.diff(recording.time) > max(SETTINGS.missed * step, SETTINGS.bridged)) + 1
    )
    still[breaks] = False
    found, least = runs(still), shortest - (2 * half + 0.5) * step
    lasts = [recording.time[b - 1] - recording.time[a] + step for a, b in found]
    poses, kept = [], int(round(SETTINGS.kept / step))
    for (a, b), length in zip(found, lasts, strict=True):
        if b - a >= 2 and length > least:
            margin = min(half, max(b - a - kept, 0) // 2)
            poses.append(slice(a + margin, b - margin))
    if recording.stationary is None:
        poses = _not_turning(recording, poses)
    if not poses:
        longest = max(lasts, default=0.0) + 2 * half * step * bool(lasts)
        before = "; it is corrected already: give it as `convert` wrote it"
        raise InputError(
            f"recording: expected still poses of at least {shortest:g} s for the first-order"
            f" calibration, found none; the longest lasts {longest:.2g} s"
            f"{before if recording.correction is not None else ''}"
        )
    return poses


def usual_step(time) -> float:
    """The usual step of the stamps (T,) s; InputError where they come in bursts."""
    if len(time) < 2:
        return np.inf
    steps = np.diff(time)
    usual, counted = float(np.median(steps)), steps[steps < SETTINGS.lost]
    mean = float(counted.mean()) if counted.size else usual
    if mean > SETTINGS.bursts * usual:
        raise InputError(
            f"recording: expected stamps in even steps, found bursts: {1e3 * usual:.3g} ms as a"
            f" rule, {1e3 * mean:.3g} in the mean; does the log have the times at which packets"
            " came? declare the sensors' rate (`time: {rate: ...}`)"
        )
    return usual


def _not_turning(recording: Recording, poses: list[slice]) -> list[slice]:
    """The poses in which not all gyroscopes read another rate than in most, a steady turn's.

    One or two gyroscopes may both warm up as much.
    """
    if len(poses) < 3 or recording.angular_rate.shape[1] < 3:
        return poses
    levels = np.array([recording.angular_rate[pose].mean(axis=0) for pose in poses])
    off = np.linalg.norm(levels - np.median(levels, axis=0), axis=2)
    usual = np.median(off, axis=1)
    apart = np.median(np.abs(off - usual[:, None]), axis=1)
    turning = (usual > TURNING) & (apart < SETTINGS.turning_together * usual)
    if 3 * turning.sum() > len(poses):
        return poses
    return [pose for pose, turns in zip(poses, turning, strict=True) if not turns]


def _together(readings) -> np.ndarray:
    """Mean (T, 3) of triads (T, K, 3), each turned as the first is where it is turned far."""
    few = readings[:: len(readings) // SETTINGS.enough + 1]
    few = few - few.mean(axis=0)
    turns = nearest_orthogonal(np.einsum("tki,tj->kij", few, few[:, 0]))
    turns[np.linalg.norm(turns - np.eye(3), axis=(1, 2)) < SETTINGS.turn_far] = np.eye(3)
    if np.array_equal(turns, np.broadcast_to(np.eye(3), turns.shape)):
        return readings.mean(axis=1)
    return np.einsum("kij,tki->tj", turns, readings) / len(turns)


def _steps(recording: Recording, step: float) -> np.ndarray:
    """Near where the specific force of a declared pose jumps to another level, (T,) bool."""
    width = max(int(round(SETTINGS.step_time / step)), 1)
    levels = np.column_stack([_together(recording.specific_force), recording.stationary])
    sums = np.cumsum(np.vstack([np.zeros(4), levels]), axis=0)
    means = (sums[width:] - sums[:-width]) / width
    before, after = means[:-width], means[width:]
    within = np.minimum(before[:, 3], after[:, 3]) > 1 - 1e-9
    found = np.zeros(len(recording.time), bool)
    change = np.linalg.norm(after[:, :3] - before[:, :3], axis=1)
    found[width : width + len(change)] = (within & (change > SETTINGS.step))[: len(found) - width]
    return found


def _quiet(recording: Recording, width: int) -> np.ndarray:
    """Samples whose window shows no more than THRESHOLD times the floor, (T,) bool."""
    still = np.ones(len(recording.time), bool)
    for kind, name in KINDS.items():
        readings, declared = getattr(recording, name), getattr(recording, f"{kind}_noise_sd")
        spread = window_spread(_together(readings), width)
        floor = np.quantile(spread, SETTINGS.floor)
        if floor > SETTINGS.moving * declared:
            raise InputError(
                f"recording: expected still poses for the first-order calibration, found {name}"
                f" to vary by {floor:.3g} in its quietest second, more than {SETTINGS.moving:g}"
                f" times the declared noise of {declared:.3g}; was it never still,"
                f" or is the unit wrong?"
            )
        still &= spread <= SETTINGS.threshold * max(
            floor, 0.1 * declared / np.sqrt(readings.shape[1])
        )
    return still


def steps_sd(pieces) -> np.ndarray:
    """Sds (P, A, 3) of the means of P still pieces (n, A, 3) whose readings are one or two steps.

    0 where they are more: noise then carries the mean between the steps.
    """
    whole, out = np.concatenate(pieces), np.zeros((len(pieces), *pieces[0].shape[1:]))
    for k, axis in np.ndindex(whole.shape[1:]):
        found = [np.unique(piece[:, k, axis]) for piece in pieces]
        if min(map(len, found)) > 2:
            continue
        levels = np.unique(whole[:, k, axis])
        step = np.diff(levels).min(initial=np.inf)
        few = np.array([len(values) for values in found]) <= 2
        out[few, k, axis] = step / np.sqrt(12) if np.isfinite(step) else 0.0
    return out
