"""How a recording has excited its board: directions of still poses, axes of rotation."""

from __future__ import annotations

import numpy as np
import xarray as xr

from imuarray.diagnosis.plain import fixed, joined, number
from imuarray.recording import Recording
from imuarray.recording.channels import runs

GAP = 80.0  # deg, from a pose, of a direction that is missed; six faces leave 55
LITTLE = 0.1  # of the squared rate about an axis; a third is even
NEAR = 25.0  # deg, within which a direction has an axis' name


def poses_of(recording: Recording) -> np.ndarray:
    """Where up was in each still pose, in the board's frame: unit vectors (P, 3)."""
    if recording.stationary is None:
        return np.zeros((0, 3))
    force = np.median(recording.specific_force, axis=1)
    means = [force[a:b].mean(axis=0) for a, b in runs(recording.stationary)]
    ups = np.array(means).reshape(-1, 3)
    return ups / np.linalg.norm(ups, axis=1, keepdims=True)


def gap_of(poses) -> tuple[float, np.ndarray]:
    """(deg, unit vector (3,)) of the direction farthest from all poses (P, 3)."""
    tried = spiral(2000)
    apart = np.degrees(np.arccos(np.clip(tried @ poses.T, -1, 1))).min(axis=1)
    return float(apart.max()), tried[int(np.argmax(apart))]


def spiral(count: int) -> np.ndarray:
    """Directions spread evenly over the sphere, (count, 3)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    return np.stack([np.cos(angle), np.sin(angle), 0 * z], axis=1) * np.sqrt(1 - z**2)[:, None] + (
        z[:, None] * np.array([0, 0, 1])
    )


def turning_of(calibration: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Shares (3,) of the squared angular rate about its own axes (3, 3), the least first."""
    rate = calibration["angular_rate"].to_numpy()
    values, vectors = np.linalg.eigh(rate.T @ rate)
    return values / values.sum(), vectors.T


def missing(recording: Recording, calibration: xr.Dataset) -> list[str]:
    """What has not been excited yet, in words; nothing where all has."""
    said, poses = [], poses_of(recording)
    if len(poses):
        angle, where = gap_of(poses)
        if angle > GAP:
            components = ", ".join(fixed(value, 1) for value in where)
            said.append(f"no still pose within {angle:.0f} degrees of ({components}) up")
    shares, axes = turning_of(calibration)
    if shares[0] < LITTLE:
        share = number(100 * shares[0], 2)
        said.append(f"hardly any turning about {direction(axes[0])}: {share} % of the squared rate")
    return said


def shown(recording: Recording, calibration: xr.Dataset) -> str:
    """The same as a sentence of a caption."""
    said = missing(recording, calibration)
    if said:
        return f"Not yet excited: {joined(said)}."
    rate = calibration["angular_rate"].to_numpy() ** 2
    parts = [f"{name} {100 * share:.0f} %" for name, share in
             zip("xyz", rate.sum(axis=0) / rate.sum(), strict=True)]  # fmt: skip
    turned = f"it was turned about all axes ({', '.join(parts)} of the squared rate)"
    poses = poses_of(recording)
    if not len(poses):
        return f"There are no still poses; {turned}."
    return f"No direction is more than {gap_of(poses)[0]:.0f} degrees from a still pose; {turned}."


def direction(vector) -> str:
    """'−z' of a unit vector near an axis, else its components."""
    place = int(np.argmax(np.abs(vector)))
    if np.degrees(np.arccos(min(abs(vector[place]), 1.0))) < NEAR:
        return f"{'−' if vector[place] < 0 else '+'}{'xyz'[place]}"
    return f"({', '.join(fixed(value, 1) for value in vector)})"
