"""The whole first-order calibration of a recording, and the recording it corrects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from imuarray.firstorder.allan import lag_correlation, white_noise_sd
from imuarray.firstorder.still import still_poses
from imuarray.firstorder.triads import TriadFit, fit_triads
from imuarray.recording import Recording
from imuarray.recording.channels import require_live

STANDARD_GRAVITY = 9.80665  # m/s^2


@dataclass(frozen=True)
class FirstOrder:
    """Per triad calibration from the still poses of one recording.

    Attributes
    ----------
    poses : list of slice
    triads : TriadFit, accelerometers
    gyroscope_offset, gyroscope_offset_sd : (G, 3) rad/s
        Mean over poses, and its sd from the spread among poses, which holds drift and whatever
        depends on gravity.
    accelerometer_noise, gyroscope_noise : (A, 3) m/s^2, (G, 3) rad/s
        White noise of one reading, from differences of neighbours.
    accelerometer_correlation, gyroscope_correlation : (A, 3), (G, 3)
        Correlation of neighbouring readings.
    gravity : float, m/s^2, the assumed magnitude
    """

    poses: list[slice]
    triads: TriadFit
    gyroscope_offset: np.ndarray
    gyroscope_offset_sd: np.ndarray
    accelerometer_noise: np.ndarray
    gyroscope_noise: np.ndarray
    accelerometer_correlation: np.ndarray
    gyroscope_correlation: np.ndarray
    gravity: float


def calibrate_first_order(recording: Recording, gravity: float = STANDARD_GRAVITY) -> FirstOrder:
    """First-order model of every triad from the recording's still poses.

    InputError or IdentifiabilityError where there are none, too few or too similar ones, and for
    constant or copied channels.
    """
    require_live(recording)
    poses = still_poses(recording)
    force = [recording.specific_force[pose] for pose in poses]
    rate = [recording.angular_rate[pose] for pose in poses]
    noise = white_noise_sd(force)
    # a quantised reading that never changes has no spread of its own
    noise = np.maximum(noise, 1e-6 * gravity)
    counts = np.array([len(piece) for piece in force])
    mean = np.array([piece.mean(axis=0) for piece in force])
    sd = noise / np.sqrt(counts)[:, None, None]
    offsets = np.array([piece.mean(axis=0) for piece in rate])
    spread = offsets.std(axis=0, ddof=1) if len(poses) > 1 else np.full(offsets.shape[1:], np.nan)
    return FirstOrder(
        poses, fit_triads(mean, sd, gravity), np.average(offsets, axis=0, weights=counts),
        spread / np.sqrt(len(poses)), noise, white_noise_sd(rate), lag_correlation(force),
        lag_correlation(rate), gravity,
    )  # fmt: skip


def correct(recording: Recording, found: FirstOrder) -> Recording:
    """The recording with offsets, scales, misalignments and orientations taken out.

    Which readings were at a rail is kept as masks, as the corrected values no longer show it;
    the declared noise becomes the pooled noise found, the still poses become ``stationary``.
    """
    back = np.linalg.inv(found.triads.matrix)
    force = np.einsum("kij,tkj->tki", back, recording.specific_force - found.triads.offset)
    still = np.zeros(len(recording.time), bool)
    for pose in found.poses:
        still[pose] = True
    noise = np.einsum("kij,kj->ki", back**2, found.accelerometer_noise**2)
    # the rail after correction, at its nearest
    gain = np.abs(np.einsum("kii->ki", found.triads.matrix)).max()
    shift = np.abs(found.triads.offset).max()
    return replace(
        recording,
        specific_force=force,
        angular_rate=recording.angular_rate - found.gyroscope_offset,
        accelerometer_noise_sd=float(np.sqrt(noise.mean())),
        gyroscope_noise_sd=float(np.sqrt(np.mean(found.gyroscope_noise**2))),
        accelerometer_range=float((recording.accelerometer_range - shift) / gain),
        gyroscope_range=float(recording.gyroscope_range - np.abs(found.gyroscope_offset).max()),
        stationary=still,
        specific_force_saturated=recording.saturated_accelerometers(),
        angular_rate_saturated=recording.saturated_gyroscopes(),
    )
