"""The calibrated array as one sensor: what calibration is for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from imuarray.analysis.model import assumed, model_of
from imuarray.errors import InputError
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording

UNITS = {"angular_rate": "rad s-1", "angular_acceleration": "rad s-2", "specific_force": "m s-2"}


class Placed(NamedTuple):
    """Positions (A, 3) m relative to the first triad, covariance of the others' coordinates."""

    positions: np.ndarray
    covariance: np.ndarray


def apply(
    calibration: xr.Dataset, recording: Recording, accelerometer_noise: float | None = None
) -> xr.Dataset:
    """Motion of the reference triad at each sample, with covariances.

    ``calibration``: what `calibrate` gave for a recording of the same triads;
    ``accelerometer_noise``: assumed sd in m/s^2, by default what the recording declares.

    Returns ``angular_rate`` (time, axis) rad/s, ``angular_acceleration`` rad/s^2 and
    ``specific_force`` m/s^2, each with ``_sd`` and the part of it that is due to the positions,
    ``_sd_from_positions``; ``motion_covariance`` (time, component, component_other);
    ``converged``, and the flags ``gyroscope_at_rail`` and ``accelerometer_at_rail`` (time; the
    motion is NaN where an accelerometer is). InputError says what does not fit together.
    """
    from imuarray.estimation.fusion import fuse

    recording = assumed(recording, accelerometer_noise)
    placed = placed_triads(calibration, recording)
    saturated = recording.saturated_gyroscopes()
    found = fuse(
        model_of(recording), recording.specific_force, recording.angular_rate,
        placed.positions, placed.covariance, saturated,
    )  # fmt: skip
    lost = recording.saturated_accelerometers().any(axis=(1, 2))
    dataset = motion_dataset(recording, found, lost)
    dataset["gyroscope_at_rail"] = (("time",), saturated.any(axis=(1, 2)))
    dataset["accelerometer_at_rail"] = (("time",), lost)
    data = digest(recording.specific_force, recording.angular_rate, *placed)
    dataset.attrs |= stamp({"recording and calibration": data}, 0)
    return dataset


def placed_triads(calibration: xr.Dataset, recording: Recording) -> Placed:
    """The calibration's positions, for a recording of the same triads."""
    for name in ("position", "position_covariance"):
        if name not in calibration:
            raise InputError(f"expected a calibration (imuarray calibrate), found no {name}")
    if "effect_parameter" in calibration:
        raise InputError(
            "expected a calibration without --effects, as the motion is that of the papers'"
            " model, found one with"
        )
    labels = tuple(map(str, calibration["accelerometer"].to_numpy()))
    if labels != recording.accelerometer_labels:
        raise InputError(
            f"expected positions of {', '.join(recording.accelerometer_labels)}, as in the"
            f" recording, found {', '.join(labels)}"
        )
    size = 3 * (len(labels) - 1)
    covariance = calibration["position_covariance"].to_numpy()[1:, :, 1:, :].reshape(size, size)
    positions = calibration["position"].to_numpy()
    if not (np.all(np.isfinite(positions)) and np.all(np.isfinite(covariance))):
        raise InputError("expected finite positions and covariances, found others")
    return Placed(positions - positions[0], covariance)


def motion_dataset(recording: Recording, found, lost) -> xr.Dataset:
    """Motion of the reference triad, its sds and covariances; NaN where ``lost``."""
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
