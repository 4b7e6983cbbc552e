"""Gyroscopes in the accelerometers' frame: turns, scales and skews from poses and moves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from imuarray.firstorder.moves import CommonMap, Move, common_map, gather, prior_precision
from imuarray.firstorder.relative import Relative, compare
from imuarray.firstorder.triads import TriadFit
from imuarray.firstorder.turns import nearest_orthogonal
from imuarray.recording import Recording

APART = 1000.0  # s, between recordings that are looked at as one


@dataclass(frozen=True)
class Gyroscopes:
    """What the rates, and the poses between which they carry gravity, say of G gyroscopes.

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
        count = len(self.matrix)
        split = self.covariance.reshape(count, 9, count, 9)
        return split[range(count), :, range(count)]

    @property
    def common_scale_sd(self) -> float:
        """Sd of the scale that all gyroscopes share; NaN where the moves did not tell it."""
        return np.nan if isinstance(self.common, str) else self.common.scale_sd


class Still(NamedTuple):
    """A recording's P still poses, and what the gyroscopes read in them.

    ``offsets`` (P, G, 3) rad/s the mean readings, ``noise`` (G, 3) rad/s.
    """

    recording: Recording
    poses: list[slice]
    offsets: np.ndarray
    noise: np.ndarray

    def pieces(self, readings) -> list[np.ndarray]:
        """Readings (T, K, 3) of each pose."""
        return [readings[pose] for pose in self.poses]

    def rate(self) -> np.ndarray:
        """Angular rates (T, G, 3) rad/s without their offsets."""
        counts = [pose.stop - pose.start for pose in self.poses]
        return self.recording.angular_rate - np.average(self.offsets, axis=0, weights=counts)

    def good(self) -> np.ndarray:
        """(T,) bool: no gyroscope is at its rail."""
        return ~self.recording.at_rail("gyroscope")

    def free(self) -> np.ndarray:
        """(T,) bool: nor is the board still."""
        free = self.good()
        for pose in self.poses:
            free[pose] = False
        return free


def calibrate_gyroscopes(every: Sequence[Still], triads: TriadFit) -> tuple[Gyroscopes, TriadFit]:
    """Maps of all gyroscopes: relative to their mean, and one common map from the moves.

    And the accelerometers' fit, which learns of the moves what directions the poses have.

    An IMU's gyroscope starts turned as its accelerometer is. ``every``: recordings of one board,
    the one to be corrected first; ``triads`` are of all their poses, one recording after the other.

    InputError for a gyroscope that is mirrored or dead, for wrong units and for left-handed axes.
    """
    own, begun = every[0], 0.0
    times = []
    for one in every:  # one after the other, far apart
        times.append(one.recording.time - one.recording.time[0] + begun)
        begun = times[-1][-1] + APART
    rate = np.concatenate([one.rate() for one in every])
    free = np.concatenate([one.free() for one in every])
    start = _start(own.recording, triads)
    labels = own.recording.gyroscope_labels
    relative = compare(rate, np.concatenate(times), free, start, labels)
    if isinstance(relative, str):
        turn, maps = start, np.broadcast_to(np.eye(3), start.shape)
    else:
        turn, maps = relative.turn, relative.map
    common = _common([(one, _moves(one, turn @ maps)) for one in every], triads)
    matrix, covariance, by_common = _together(turn, maps, relative, common)
    maps_only = np.arange(12 * len(triads.matrix)).reshape(-1, 12)[:, :9].ravel()
    beside = np.zeros((len(covariance), len(maps_only)))
    if not isinstance(common, str):
        own = triads.beside_directions()[maps_only]
        beside = -by_common @ (own @ common.beside).T
        triads = triads.carried(common.score, common.information)
    return Gyroscopes(matrix, covariance, beside, relative, common), triads


def _moves(one: Still, matrix) -> list[Move]:
    """Its moves, of the mean of rates with maps (G, 3, 3) taken out."""
    back = np.linalg.inv(matrix)
    count = len(back)
    mean = np.einsum("kij,tkj->ti", back, one.recording.angular_rate) / count
    still = np.einsum("kij,pkj->pi", back, one.offsets) / count
    sd = float(np.sqrt(np.mean(one.noise**2) / count))
    return gather(mean, one.recording.time, one.poses, still, one.good(), sd)


def _common(several, triads: TriadFit) -> CommonMap | str:
    """The map common to all gyroscopes from [(recording, moves)]; its moves are the first one's."""
    moves, poses = [], 0
    for one, own in several:
        moves += [move._replace(first=move.first + poses) for move in own]
        poses += len(one.poses)
    found = common_map(moves, triads.direction, triads.direction_covariance)
    if isinstance(found, str):
        return found
    own = found.first < len(several[0][0].poses)
    return replace(found, first=found.first[own], error=found.error[own], weight=found.weight[own])


def _start(recording: Recording, triads: TriadFit) -> np.ndarray:
    """Turns (G, 3, 3): of the accelerometer of the same label, or none."""
    turns = nearest_orthogonal(triads.matrix)
    own = dict(zip(recording.accelerometer_labels, turns, strict=True))
    return np.array([own.get(label, np.eye(3)) for label in recording.gyroscope_labels])


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
