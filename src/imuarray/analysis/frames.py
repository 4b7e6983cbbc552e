"""Where each IMU of a calibration sits, how it is turned, and what its chips read."""

from typing import Any

import numpy as np
import xarray as xr

from imuarray.estimation.informative import position_sds
from imuarray.firstorder.turns import nearest_orthogonal, upper_times_rotation
from imuarray.model.effects import KINDS
from imuarray.recording.record import by_kind


def left_of(calibration: xr.Dataset) -> dict[str, np.ndarray]:
    """Covariances by kind of the maps that first order has left."""
    left = calibration.get("map_covariance")
    return by_kind(None if left is None else left.to_numpy(), calibration.sizes["accelerometer"])


def frames_of(calibration: xr.Dataset, steps: dict, positions) -> list[dict]:
    """Of each IMU its place, its turn, and what its chips read, in their own axes."""
    sensed = {kind: _sensed(steps[kind], calibration.sizes[kind]) for kind in KINDS}
    chips = calibration.get("accelerometer_axes")
    axes = np.tile(np.eye(3), (len(positions), 1, 1)) if chips is None else chips.to_numpy()
    if steps[KINDS[0]] and steps[KINDS[0]][0]["from"] == "first-order":
        axes = nearest_orthogonal(np.linalg.inv(steps[KINDS[0]][0]["inverse"])) @ axes
    axes = np.where(np.abs(axes - np.round(axes)) < 1e-9, np.round(axes), axes) + 0.0
    matrices = np.swapaxes(axes, 1, 2) @ sensed[KINDS[0]][0]
    turns = np.array([upper_times_rotation(matrix)[1] for matrix in matrices])
    lower = [lower_times_rotation(matrix) for matrix in matrices]
    own, others = turn_sds(calibration, turns, np.array([turn for _, turn in lower]))
    sds = position_sds(calibration)
    frames: list[dict] = []
    for k, (scale, turn) in enumerate(lower):
        to = np.eye(4)
        if k:
            to[:3, :3], to[:3, 3] = turn @ lower[0][1].T, turn @ (positions[0] - positions[k])
        frame: dict[str, Any] = {"position_m": positions[k], "position_sd_m": sds[k]}
        frame |= {"rotation": turns[k], "rotation_sd_rad": own[k], "axes": axes[k]}
        frame |= {"T_i_b": to, "T_i_b_turn_sd_rad": others[k]}
        frame[KINDS[0]] = {"M": scale, "bias": axes[k].T @ sensed[KINDS[0]][1][k]}
        if k < calibration.sizes[KINDS[1]]:
            matrix, bias = (part[k] for part in sensed[KINDS[1]])
            scale, whole = lower_times_rotation(axes[k].T @ matrix)
            frame[KINDS[1]] = {"M": scale, "C_gyro_i": whole @ turn.T, "bias": axes[k].T @ bias}
        frames.append(frame)
    return frames


def _sensed(steps: list[dict], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Reading = matrix (n, 3, 3) @ truth + bias (n, 3), of all corrections together."""
    matrix, bias = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    for step in reversed(steps):
        own = np.linalg.inv(step["inverse"])
        matrix, bias = own @ matrix, (own @ bias[..., None])[..., 0] + step["offset"]
    return matrix, bias


def lower_times_rotation(matrix) -> tuple[np.ndarray, np.ndarray]:
    """matrix (3, 3) = L R: L lower triangular, R a rotation."""
    upper, turn = upper_times_rotation(matrix[::-1, ::-1])
    return upper[::-1, ::-1] + 0.0, turn[::-1, ::-1] + 0.0


def turn_sds(calibration: xr.Dataset, turns, others) -> tuple[np.ndarray, np.ndarray]:
    """Sds (A, 3) of turns about the IMUs' axes, and of ``others`` against the first's of these.

    From the maps 1 + d that first order has left: of U R (1 + d) what is beneath the diagonal of
    R d R' turns R, of L R (1 + d) what is above.
    """
    left, count = left_of(calibration).get("accelerometer"), len(turns)
    if left is None:
        return (np.full((count, 3), np.nan),) * 2
    sds, places, signs = [], ([7, 6, 3], [5, 2, 1]), ([1, -1, 1], [-1, 1, -1])
    for relative, (frames, place, sign) in enumerate(
        zip((turns, others), places, signs, strict=True)
    ):
        slopes = np.zeros((count, 3, count, 9))
        for k, turn in enumerate(frames):
            slopes[k, :, k] = np.array(sign)[:, None] * np.kron(turn, turn)[place]
        if relative:
            apart = others @ others[0].T
            slopes = slopes - np.einsum("kij,jlm->kilm", apart, slopes[0])
        rows = slopes.reshape(3 * count, 9 * count)
        variances = np.einsum("ri,ij,rj->r", rows, left, rows)
        sds.append(np.sqrt(np.maximum(variances, 0.0)).reshape(count, 3))
    return sds[0], sds[1]
