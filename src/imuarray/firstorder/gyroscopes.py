"""Gyroscopes in the accelerometers' frame: turns, scales and skews from poses and moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from imuarray.firstorder.moves import CommonMap, common_map, gather, prior_precision
from imuarray.firstorder.relative import Relative, compare
from imuarray.firstorder.triads import TriadFit
from imuarray.firstorder.turns import nearest_orthogonal
from imuarray.recording import Recording


@dataclass(frozen=True)
class Gyroscopes:
    """What the rates, and the poses between which they carry gravity, say of G gyroscopes.

    Attributes
    ----------
    matrix : (G, 3, 3), reading = matrix @ angular rate + offset
    covariance : (9 G, 9 G) of all, row by row
    relative, common : `Relative` and `CommonMap`, or the reason why there is none
    """

    matrix: np.ndarray
    covariance: np.ndarray
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


def calibrate_gyroscopes(
    recording: Recording, poses, triads: TriadFit, offsets, noise
) -> Gyroscopes:
    """Maps of all gyroscopes: relative to their mean, and one common map from the moves.

    Parameters
    ----------
    poses : P slices, ``offsets`` (P, G, 3) rad/s the mean readings in them
    triads : accelerometers; an IMU's gyroscope starts turned as its accelerometer is
    noise : (G, 3) rad/s

    InputError for a gyroscope that is mirrored or dead, for wrong units and for left-handed axes.
    """
    counts = [pose.stop - pose.start for pose in poses]
    rate = recording.angular_rate - np.average(offsets, axis=0, weights=counts)
    good = ~recording.saturated_gyroscopes().any(axis=(1, 2))
    free = good.copy()
    for pose in poses:
        free[pose] = False
    start = _start(recording, triads)
    relative = compare(rate, recording.time, free, start, recording.gyroscope_labels)
    if isinstance(relative, str):
        turn, maps = start, np.broadcast_to(np.eye(3), start.shape)
    else:
        turn, maps = relative.turn, relative.map
    back = np.linalg.inv(turn @ maps)
    count = len(back)
    mean = np.einsum("kij,tkj->ti", back, recording.angular_rate) / count
    still = np.einsum("kij,pkj->pi", back, offsets) / count
    sd = float(np.sqrt(np.mean(noise**2) / count))
    moves = gather(mean, recording.time, poses, still, good, sd)
    common = common_map(moves, triads.direction, triads.direction_covariance)
    return Gyroscopes(*_together(turn, maps, relative, common), relative, common)


def _start(recording: Recording, triads: TriadFit) -> np.ndarray:
    """Turns (G, 3, 3): of the accelerometer of the same label, or none."""
    turns = nearest_orthogonal(triads.matrix)
    own = dict(zip(recording.accelerometer_labels, turns, strict=True))
    return np.array([own.get(label, np.eye(3)) for label in recording.gyroscope_labels])


def _together(turn, maps, relative, common) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (G, 3, 3) and their covariance (9 G, 9 G); the prior's of what was not estimated."""
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
    own = block_diag(*own)
    return matrix, by_common @ spread @ by_common.T + by_map @ own @ by_map.T
