"""The work behind `imuarray apply`: what calibration is for."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from imuarray.commands_model import assumed, model_of
from imuarray.errors import InputError
from imuarray.provenance import digest, stamp, write_netcdf
from imuarray.recording import Recording, load_dataset, read_recording

UNITS = {"angular_rate": "rad s-1", "angular_acceleration": "rad s-2", "specific_force": "m s-2"}


class Calibration(NamedTuple):
    """Positions (A, 3) m relative to the first triad, covariance of the others' coordinates."""

    positions: np.ndarray
    covariance: np.ndarray


def apply(arguments) -> None:
    """The calibrated array's motion with covariances; see `motion_dataset` for the output."""
    from imuarray.estimation.fusion import fuse

    recording = assumed(read_recording(arguments.recording), arguments)
    calibration = read_calibration(arguments.calibration, recording)
    saturated = recording.saturated_gyroscopes()
    found = fuse(
        model_of(recording), recording.specific_force, recording.angular_rate,
        calibration.positions, calibration.covariance, saturated,
    )  # fmt: skip
    lost = recording.saturated_accelerometers().any(axis=(1, 2))
    dataset = motion_dataset(recording, found, lost)
    data = digest(recording.specific_force, recording.angular_rate, *calibration)
    dataset.attrs |= stamp({"recording and calibration": data}, 0)
    write_netcdf(dataset, arguments.out)
    if not arguments.quiet:
        _report(recording, dataset, saturated.any(axis=(1, 2)) & ~lost, lost)


def read_calibration(path: Path, recording: Recording) -> Calibration:
    """Of ``cal.nc``, for a recording of the same triads; InputError says what does not fit."""
    found = load_dataset(path)
    for name in ("position", "position_covariance"):
        if name not in found:
            raise InputError(
                f"{path}: expected a calibration (imuarray calibrate), found no {name}"
            )
    if "effect_parameter" in found:
        raise InputError(
            f"{path}: expected a calibration without --effects, as the motion is that of the"
            " papers' model, found one with"
        )
    labels = tuple(map(str, found["accelerometer"].to_numpy()))
    if labels != recording.accelerometer_labels:
        raise InputError(
            f"{path}: expected positions of {', '.join(recording.accelerometer_labels)}, as in the"
            f" recording, found {', '.join(labels)}"
        )
    size = 3 * (len(labels) - 1)
    covariance = found["position_covariance"].to_numpy()[1:, :, 1:, :].reshape(size, size)
    positions = found["position"].to_numpy()
    if not (np.all(np.isfinite(positions)) and np.all(np.isfinite(covariance))):
        raise InputError(f"{path}: expected finite positions and covariances, found others")
    return Calibration(positions - positions[0], covariance)


def motion_dataset(recording: Recording, found, lost) -> xr.Dataset:
    """``motion.nc``: motion of the reference triad, its sds and covariances; NaN where ``lost``."""
    from imuarray.estimation.fusion import COMPONENTS

    covariance = np.where(lost[:, None, None], np.nan, found.covariance)
    sds = np.sqrt(np.einsum("tii->ti", covariance)).reshape(-1, 3, 3)
    variables = {
        "motion_covariance": (("time", "component", "component_other"), covariance),
        "converged": (("time",), found.estimate.converged & ~lost),
    }
    for number, (name, unit) in enumerate(UNITS.items()):
        values = np.where(lost[:, None], np.nan, getattr(found.estimate.motion, name))
        variables[name] = ("time", "axis"), values, {"units": unit}
        variables[f"{name}_sd"] = ("time", "axis"), sds[:, number], {"units": unit}
    shared = np.einsum("tii->ti", found.from_positions).reshape(-1, 3, 3)
    for number, (name, unit) in enumerate(UNITS.items()):
        part = np.sqrt(np.where(lost[:, None], np.nan, shared[:, number]))
        variables[f"{name}_sd_from_positions"] = ("time", "axis"), part, {"units": unit}
    coords = {"time": ("time", recording.time, {"units": "s"}), "axis": list("xyz"),
              "component": list(COMPONENTS), "component_other": list(COMPONENTS)}  # fmt: skip
    title = f"motion of triad {recording.accelerometer_labels[0]}, in the array's frame"
    return xr.Dataset(variables, coords, {"title": title})


def _report(recording: Recording, dataset: xr.Dataset, railed, lost) -> None:
    count = len(recording.time)
    print(f"{count} samples, {lost.sum()} left out with an accelerometer at its rail,"
          f" {railed.sum()} with a gyroscope at its")  # fmt: skip
    average = recording.gyroscope_noise_sd / np.sqrt(recording.angular_rate.shape[1])
    print(f"angular rate, gyroscopes averaged: sd {np.degrees(average):.3g} deg/s off the rail")
    for name, where in (("off the rail", ~railed & ~lost), ("at the rail", railed)):
        if not where.any():
            continue
        sds = [
            float(np.sqrt(np.mean(dataset[f"{field}_sd"].to_numpy()[where] ** 2)))
            for field in UNITS
        ]
        said = f"{np.degrees(sds[0]):.3g} deg/s, {np.degrees(sds[1]):.3g} deg/s^2, {sds[2]:.3g}"
        print(f"fused, {name}: sd {said} m/s^2 (angular rate, angular acceleration, force)")
    failed = int(np.sum(~dataset["converged"].to_numpy() & ~lost))
    if failed:
        print(f"NOT converged at {failed} samples")
