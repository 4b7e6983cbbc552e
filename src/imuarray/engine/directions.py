"""Widths of a calibration's positions, and the directions that it determines worst, by name."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from imuarray.engine.settings import SETTINGS

AXES = "xyz"


class Direction(NamedTuple):
    """A unit combination of the coordinates of r_2 ... r_A, and how well it is known."""

    sd: float  # m, of the combination
    vector: np.ndarray  # (A - 1, 3)
    words: str


def patterns(positions) -> dict[str, np.ndarray]:
    """Unit directions with a name, (3 (A - 1),) each: the array as a whole, its reference triad."""
    relative = np.asarray(positions, float)[1:] - positions[0]
    found = {}
    for i, axis in enumerate(AXES):
        # r_k - r_1 of all triads at once: it is the reference that lies elsewhere
        found[f"the reference triad along {axis}"] = np.tile(np.eye(3)[i], (len(relative), 1))
    found["the size of the array"] = relative
    for i, axis in enumerate(AXES):
        found[f"the array turned about {axis}"] = np.cross(np.eye(3)[i], relative)
        found[f"the array's extent along {axis}"] = relative * np.eye(3)[i]
    return {
        name: value.ravel() / np.linalg.norm(value)
        for name, value in found.items()
        if np.linalg.norm(value) > 1e-12
    }


def weak_directions(positions, covariance, labels, count: int = 3) -> list[Direction]:
    """The ``count`` worst known directions, the worst first.

    ``positions`` (A, 3) m, ``covariance`` (3 (A - 1),) squared of r_2 ... r_A, m^2; ``labels`` of
    all A triads. A direction is named after a pattern that makes up half of it, or a coordinate
    that makes up a quarter.
    """
    values, vectors = np.linalg.eigh(covariance)
    known = patterns(positions)
    found = []
    for value, vector in list(zip(values, vectors.T, strict=True))[::-1][:count]:
        shares = {name: float(pattern @ vector) ** 2 for name, pattern in known.items()}
        best = max(shares, key=shares.get)
        if shares[best] < SETTINGS.named_share:
            place = int(np.argmax(np.abs(vector)))
            best = "a mixture of all positions"
            if vector[place] ** 2 > SETTINGS.named_share / 2:
                best = f"IMU {labels[1 + place // 3]} along {AXES[place % 3]}, mostly"
        found.append(Direction(float(np.sqrt(max(value, 0.0))), vector.reshape(-1, 3), best))
    return found


def position_sds(calibration: xr.Dataset) -> np.ndarray:
    """Sds of the positions that `imuarray.calibrate` gave, (A, 3) m."""
    return np.sqrt(np.einsum("kaka->ka", calibration["position_covariance"].to_numpy()))


def weakest_of(calibration: xr.Dataset) -> list[Direction]:
    """`weak_directions` of what `imuarray.calibrate` gave."""
    positions = calibration["position"].to_numpy()
    size = 3 * (len(positions) - 1)
    covariance = calibration["position_covariance"].to_numpy()[1:, :, 1:].reshape(size, size)
    return weak_directions(positions, covariance, calibration["accelerometer"].to_numpy())
