"""Positions to begin with where nobody has drawn the board: from the motion itself."""

import numpy as np
from scipy.signal import savgol_filter

from imuarray.errors import InputError

WINDOW, ORDER = 7, 3  # samples and degree of the polynomial that gives the rates' derivative
FAST = 0.5  # of the rates' root mean square: slower samples say little of positions
SD = 0.05  # of the board's size, what gyroscopes and axes as bought leave uncertain
SURE = 0.1  # of the board's size, beyond which the motion says too little


def rough_positions(time, force, rate) -> tuple[np.ndarray, float]:
    """(positions (A, 3) m relative to the first triad, sd m) from readings as logged.

    ``force`` (T, A, 3) m/s^2, ``rate`` (T, G, 3) rad/s, axes nearly parallel. Each triad's force is
    a map of the first one's, an offset, and what rate and angular acceleration make of its lever
    arm: linear least squares. InputError where the motion does not determine the arms.
    """
    step = np.median(np.diff(time))
    mean = rate.mean(axis=1) - np.median(rate.mean(axis=1), axis=0)
    mean, turning = (
        savgol_filter(mean, WINDOW, ORDER, deriv=deriv, delta=step, axis=0) for deriv in (0, 1)
    )
    force = savgol_filter(force, WINDOW, ORDER, axis=0)
    speed = np.linalg.norm(mean, axis=1)
    used = speed > FAST * np.sqrt(np.mean(speed**2))
    x, y, z = np.eye(3)
    arms = np.stack(
        [
            np.cross(turning[used], axis) + np.cross(mean[used], np.cross(mean[used], axis))
            for axis in (x, y, z)
        ],
        axis=-1,
    )  # (M, 3, 3)
    first = force[used, 0]
    maps = np.einsum("ij,tk->tijk", np.eye(3), first).reshape(len(first), 3, 9)
    offsets = np.broadcast_to(np.eye(3), arms.shape)
    design = np.concatenate([arms, maps, offsets], axis=2).reshape(-1, 15)
    positions, variance = np.zeros((force.shape[1], 3)), 0.0
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    inverse = np.linalg.pinv((design / scale).T @ (design / scale))
    for k in range(1, force.shape[1]):
        right = force[used, k].ravel()
        found = inverse @ ((design / scale).T @ right)
        left = right - (design / scale) @ found
        positions[k] = (found / scale)[:3]
        own = np.diag(inverse)[:3] / scale[:3] ** 2 * np.mean(left**2)
        variance = max(variance, float(own.max()))
    size = float(np.ptp(positions, axis=0).max())
    sd = float(np.hypot(np.sqrt(variance), SD * size))
    if not np.sqrt(variance) < SURE * size:
        raise InputError(
            "positions: expected those of a drawing, or motion from which they follow, found motion"
            f" that leaves them open by {1e3 * sd:.2g} mm: twist the board faster, about all axes,"
            " or measure them with a ruler, from any point"
        )
    return positions, sd
