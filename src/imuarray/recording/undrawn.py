"""Positions to begin with where nobody has drawn the board: from the motion itself."""

from functools import partial

import numpy as np
from scipy.signal import savgol_filter

from imuarray.errors import require
from imuarray.motion.state import lever
from imuarray.recording.record import Recording
from imuarray.recording.settings import SETTINGS

UNKNOWNS = 15  # of a triad: arm, map of the first triad's force, offset


def rough_positions(recording: Recording) -> tuple[np.ndarray, float]:
    """(positions (A, 3) m relative to the first triad, sd m) from readings as logged.

    Each triad's force is a map of the first one's, an offset, and what rate and angular
    acceleration make of its lever arm: linear least squares, axes nearly parallel. InputError where
    the motion does not determine the arms.
    """
    count = recording.specific_force.shape[1]
    design, right = _equations(recording)
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    found, _, rank, _ = np.linalg.lstsq(design / scale, right, rcond=None)
    positions, sd = np.zeros((count, 3)), np.inf
    if rank == UNKNOWNS:
        positions[1:] = (found / scale[:, None])[:3].T
        left = np.mean((right - design @ (found / scale[:, None])) ** 2, axis=0).max()
        spread = np.diag(np.linalg.inv((design / scale).T @ (design / scale)))[:3]
        sd = float(np.sqrt(left * np.max(spread / scale[:3] ** 2)))
    size = float(np.ptp(positions, axis=0).max())
    require(
        sd < SETTINGS.rough_sure * size, "positions",
        "those of a drawing, or motion from which they follow",
        "motion that leaves them open: twist the board faster, about all axes, or measure them with"
        " a ruler, from any point",
    )  # fmt: skip
    return positions, float(np.hypot(sd, SETTINGS.rough_sd * size))


def _equations(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (n, `UNKNOWNS`) and forces (n, A - 1) of fast samples off the rails."""
    lost = recording.at_rail("gyroscope") | recording.at_rail("accelerometer")
    expected = "readings off their rails, from which they follow"
    found = f"none of {len(lost)}: is a range, a unit or a scale wrong?"
    require(not lost.all(), "positions", expected, found)
    rate = recording.angular_rate.mean(axis=1)
    if len(rate) < SETTINGS.slope_window:
        return np.zeros((1, UNKNOWNS)), np.zeros((1, recording.specific_force.shape[1] - 1))
    step = np.median(np.diff(recording.time))
    smooth = partial(
        savgol_filter, window_length=SETTINGS.slope_window, polyorder=SETTINGS.slope_order,
        delta=step, axis=0,
    )  # fmt: skip
    rate = rate - np.median(rate, axis=0)
    force, rate, turning = smooth(recording.specific_force), smooth(rate), smooth(rate, deriv=1)
    speed = np.linalg.norm(rate, axis=1)
    used = (speed > SETTINGS.fast * np.sqrt(np.mean(speed**2))) & ~lost
    arms = lever(rate[used, None], turning[used, None], np.eye(3)).swapaxes(1, 2)
    maps = np.einsum("ij,tk->tijk", np.eye(3), force[used, 0]).reshape(-1, 3, 9)
    offsets = np.broadcast_to(np.eye(3), arms.shape)
    design = np.concatenate([arms, maps, offsets], axis=2).reshape(-1, UNKNOWNS)
    return design, force[used, 1:].swapaxes(1, 2).reshape(-1, force.shape[1] - 1)
