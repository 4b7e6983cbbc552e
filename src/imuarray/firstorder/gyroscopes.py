"""Gyroscopes against each other, and in the accelerometers' frame from poses and moves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from scipy.linalg import block_diag
from scipy.special import gammaln, stdtr

from imuarray.errors import InputError
from imuarray.firstorder.moves import CommonMap, Move, common_map, gather, prior_precision
from imuarray.firstorder.settings import SETTINGS
from imuarray.firstorder.still import Still, averaged_sd
from imuarray.firstorder.triads import TriadFit
from imuarray.firstorder.turns import nearest_orthogonal, require_rotations
from imuarray.linear import diagonal_blocks
from imuarray.tails import MEDIAN, t4

SLOWEST = np.radians(20.0)  # rad/s; slower samples say little of scales


class Relative(NamedTuple):
    """Each gyroscope's reading, free of its offset, is ``turn @ map @ mean``.

    ``turn`` (G, 3, 3) rotations onto the mean's frame, ``map`` (G, 3, 3) of mean the identity,
    ``covariance`` (G, 9, 9) of the maps row by row, ``samples`` how many they are from.
    """

    turn: np.ndarray
    map: np.ndarray
    covariance: np.ndarray
    samples: int


def compare(rate, time, usable, turn, labels) -> Relative | str:
    """Relative maps by least squares, or why there are none.

    Parameters
    ----------
    rate : (T, G, 3) rad/s, offsets taken out
    time : (T,) s
    usable : (T,) bool, neither still nor at a rail
    turn : (G, 3, 3) how far each is believed to be turned against the array's frame
    labels : of the gyroscopes

    InputError for one that is mirrored, or whose readings are no rates like the others'.
    """
    first = np.einsum("kji,tkj->tki", turn, rate)
    usable = usable & (np.linalg.norm(np.median(first, axis=1), axis=1) > SLOWEST)
    # a derivative needs both neighbours
    near = np.diff(time) < 1.5 * np.median(np.diff(time))
    usable[1:-1] &= near[1:] & near[:-1]
    usable[[0, -1]] = False
    if usable.sum() < SETTINGS.least_moving:
        return f"fewer than {SETTINGS.least_moving} moving samples off the rails"
    sizes = np.linalg.eigvalsh(np.einsum("tki,tkj->kij", first[usable], first[usable]))
    if np.median(sizes[:, 0] / sizes[:, 2]) < SETTINGS.weakest_axis:
        return "the array was turned about one or two axes only"
    turn = turn @ _turns(first[usable], turn, labels)
    aligned = np.einsum("kji,tkj->tki", turn, rate)
    maps, covariance = _maps(aligned, time, usable)
    return Relative(turn, maps, covariance, int(usable.sum()))


def _turns(rate, turn, labels) -> np.ndarray:
    """Rotation (G, 3, 3) of each against the one that agrees best with all, by their rates."""
    count = rate.shape[1]
    flat = rate.reshape(len(rate), -1)
    products = (flat.T @ flat).reshape(count, 3, count, 3).swapaxes(1, 2)
    own = products[range(count), range(count)]
    # how l's rates become k's, by least squares; a dead axis has no inverse
    maps = np.einsum("klij,ljm->klim", products, np.linalg.pinv(own, hermitian=True))
    middle = np.argmin(np.median(np.linalg.norm(maps - np.eye(3), axis=(2, 3)), axis=1))
    seen = maps[:, middle]
    sizes = np.linalg.norm(turn @ seen, axis=2)
    wrong = np.argwhere((sizes < SETTINGS.same_size[0]) | (sizes > SETTINGS.same_size[1]))
    if len(wrong):
        k, axis = wrong[0]
        raise InputError(
            f"gyroscope {labels[k]!r}: expected angular rates like the others', found its"
            f" {'xyz'[axis]} axis to read {round(sizes[k, axis], 3):.3g} times theirs"
        )
    found = nearest_orthogonal(seen)
    require_rotations(turn @ found @ np.swapaxes(turn, 1, 2), labels, "gyroscope")
    return found


def _maps(rate, time, usable) -> tuple[np.ndarray, np.ndarray]:
    """Each gyroscope on the mean of all, robustly.

    The mean's derivatives are beside it: a gyroscope that is read late would seem too small.
    """
    mean = rate.mean(axis=1)
    slope = np.gradient(mean, time, axis=0)
    columns = np.hstack([mean, slope, np.gradient(slope, time, axis=0)])[usable]
    columns /= np.sqrt(np.mean(columns**2, axis=0))
    size = np.sqrt(np.mean(mean[usable] ** 2, axis=0))
    block = (time[usable] // SETTINGS.gyroscope_block).astype(int)
    found = [_regress(columns, rate[usable, k], block) for k in range(rate.shape[1])]
    maps = np.array([solution[:, :3] / size for solution, _ in found])
    back = np.tile(1 / size, 3)
    return maps, np.array([cov * np.outer(back, back) for _, cov in found])


def _regress(columns, wanted, block) -> tuple[np.ndarray, np.ndarray]:
    """Rows (3, 9) with wanted = columns @ rows', by Student-t weights; covariance of their first 3.

    The covariance allows residuals within one block of time to be alike.
    """
    weight = np.ones(len(wanted))
    for _ in range(SETTINGS.robust_steps):
        normal = (columns * weight[:, None]).T @ columns
        inverse = np.linalg.pinv(normal, hermitian=True)
        rows = (inverse @ (columns * weight[:, None]).T @ wanted).T
        left = wanted - columns @ rows.T
        squares = np.sum(left**2, axis=1)
        weight, bend = t4(squares, np.median(squares) / MEDIAN)
    inverse = np.linalg.pinv((columns * bend[:, None]).T @ columns, hermitian=True)
    _, block = np.unique(block, return_inverse=True)
    scores = np.zeros((block.max() + 1, 3, columns.shape[1]))
    np.add.at(scores, block, weight[:, None, None] * left[:, :, None] * columns[:, None])
    scores = scores @ inverse
    covariance = np.einsum("bim,bjn->imjn", scores[..., :3], scores[..., :3]).reshape(9, 9)
    return rows, covariance * len(scores) / max(len(scores) - 9, 1)


@dataclass(frozen=True)
class Gyroscopes:
    """Maps of G gyroscopes by the rates, and by the poses between which they carry gravity.

    Attributes
    ----------
    matrix : (G, 3, 3), reading = matrix @ angular rate + offset
    covariance : (9 G, 9 G) of all, row by row
    beside : (9 G, 9 A), covariance with the accelerometers' matrices
    relative, common : `Relative` and `CommonMap`, or the reason why there is none
    """

    matrix: np.ndarray
    covariance: np.ndarray
    beside: np.ndarray
    relative: Relative | str
    common: CommonMap | str

    @property
    def blocks(self) -> np.ndarray:
        """(G, 9, 9) covariance of each matrix, row by row."""
        return diagonal_blocks(self.covariance, 9)

    @property
    def common_scale_sd(self) -> float:
        """Sd of the scale that all gyroscopes share; NaN where the moves did not tell it."""
        return np.nan if isinstance(self.common, str) else self.common.scale_sd

    def time_base_sd(self, declared: bool) -> float:
        """Relative sd of the log's time: a scale that all axes share may be a clock's that is off.

        As likely as it is the clock's, by the prior odds of a rate that is ``declared`` or of
        stamps (`SETTINGS.wrong_rate`, `wrong_stamps`); 0 where that is unlikely.
        """
        if isinstance(self.common, str):
            return 0.0
        mean, sd = mean_scale(self.matrix)
        sd = np.hypot(sd, self.common.scale_sd)
        odds = SETTINGS.wrong_rate if declared else SETTINGS.wrong_stamps
        odds *= shift_odds(mean, sd, self.matrix[..., 0].size - 1, SETTINGS.wrong_by)
        share = odds / (1.0 + odds)
        return float(np.sqrt(share * (mean**2 + sd**2))) if share > SETTINGS.unlikely else 0.0

    def between(self, poses: range) -> Self:
        """The maps with the moves between some of the poses, numbered from the first of them."""
        if isinstance(self.common, str):
            return self
        own = np.isin(self.common.first, poses)
        moves = {name: getattr(self.common, name)[own] for name in ("error", "weight")}
        first = self.common.first[own] - poses.start
        return replace(self, common=replace(self.common, first=first, **moves))


def mean_scale(matrices) -> tuple[float, float]:
    """Mean of the scales of axes, less one, of maps (G, 3, 3), and its sd by how they scatter."""
    scales = np.linalg.norm(matrices, axis=1).ravel() - 1
    return float(scales.mean()), max(float(scales.std(ddof=1)) / np.sqrt(scales.size), 1e-300)


def shared_chance(matrices) -> float:
    """Chance (t distribution) of such a mean of the scales of axes, of maps (G, 3, 3)."""
    mean, sd = mean_scale(matrices)
    return float(2 * stdtr(matrices[..., 0].size - 1, -abs(mean) / sd))


def shift_odds(mean: float, sd: float, freedom: int, shift: float) -> float:
    """Bayes factor of a normal shift of sd ``shift`` in a mean, its ``sd`` of so much ``freedom``.

    Density of the mean with the shift, normal, over that without, Student's t.
    """
    wide = np.hypot(sd, shift)
    t = gammaln((freedom + 1) / 2) - gammaln(freedom / 2) - np.log(freedom / 2) / 2
    t -= (freedom + 1) / 2 * np.log1p((mean / sd) ** 2 / freedom)
    return float(np.exp(np.log(sd / wide) - (mean / wide) ** 2 / 2 - t))


def calibrate_gyroscopes(every: Sequence[Still], triads: TriadFit) -> tuple[Gyroscopes, TriadFit]:
    """Maps of all gyroscopes: relative to their mean, and one common map from the moves.

    And the accelerometers' fit, which learns of the moves what directions the poses have.

    An IMU's gyroscope starts turned as its accelerometer is. ``every``: recordings of one board;
    ``triads`` are of all their poses, one recording after the other.

    InputError for a gyroscope that is mirrored or dead, for wrong units and for left-handed axes.
    """
    first, begun = every[0].recording, 0.0
    times, rates = [], []
    for one in every:  # one after the other, far apart
        times.append(one.recording.time - one.recording.time[0] + begun)
        begun = times[-1][-1] + SETTINGS.recordings_apart
        offset = np.average(one.means("gyroscope"), axis=0, weights=one.counts)
        rates.append(one.recording.angular_rate - offset)
    free = np.concatenate([one.moving & ~one.recording.at_rail("gyroscope") for one in every])
    labels, turns = first.gyroscope_labels, nearest_orthogonal(triads.matrix)
    turned = dict(zip(first.accelerometer_labels, turns, strict=True))
    start = np.array([turned.get(label, np.eye(3)) for label in labels])
    relative = compare(np.concatenate(rates), np.concatenate(times), free, start, labels)
    if isinstance(relative, str):
        turn, maps = start, np.broadcast_to(np.eye(3), start.shape)
    else:
        turn, maps = relative.turn, relative.map
    moves = _moves(every, turn @ maps)
    own = slice(-triads.direction.size, None)
    common = common_map(moves, triads.direction, triads.fitted.covariance[own, own])
    matrix, covariance, by_common = _together(turn, maps, relative, common)
    beside = np.zeros((len(covariance), 9 * len(triads.matrix)))
    if not isinstance(common, str):
        beside = -by_common @ (triads.beside_directions() @ common.beside).T
        triads = triads.carried(common.score, common.information)
    return Gyroscopes(matrix, covariance, beside, relative, common), triads


def _moves(every: Sequence[Still], matrix) -> list[Move]:
    """Moves of the mean of rates, maps (G, 3, 3) taken out; the poses of all are numbered on."""
    back, moves, poses = np.linalg.inv(matrix), [], 0
    count = len(back)
    for one in every:
        mean = np.einsum("kij,tkj->ti", back, one.recording.angular_rate) / count
        still = np.einsum("kij,pkj->pi", back, one.means("gyroscope")) / count
        sd = float(np.sqrt(np.mean(one.noise("gyroscope", averaged_sd) ** 2) / count))
        good = ~one.recording.at_rail("gyroscope")
        own = gather(mean, one.recording.time, one.poses, still, good, sd)
        moves += [move._replace(first=move.first + poses) for move in own]
        poses += len(one.poses)
    return moves


def _together(turn, maps, relative, common) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrices (G, 3, 3) and their covariance (9 G, 9 G), the prior's of what was not estimated.

    Also (9 G, 9), minus their derivatives in the common map.
    """
    unknown = np.linalg.inv(prior_precision())
    axes, change, spread = np.eye(3), np.eye(3), unknown
    if not isinstance(common, str):
        axes, change, spread = common.turn, common.map, common.covariance
    own = [unknown] * len(turn) if isinstance(relative, str) else relative.covariance
    back = np.linalg.inv(change)
    behind = axes.T @ back
    matrix = turn @ maps @ behind
    count = len(turn)
    # of relative maps the mean is known
    apart = np.kron(np.eye(count) - 1 / count, np.eye(9))
    by_map = block_diag(*(np.kron(t, behind.T) for t in turn)) @ apart
    by_common = np.vstack([np.kron(m, back.T) for m in matrix])
    # residuals against a mean that they are part of are smaller than the noise
    own = block_diag(*own) * (1.0 if isinstance(relative, str) else count / max(count - 1, 1))
    return matrix, by_common @ spread @ by_common.T + by_map @ own @ by_map.T, by_common
