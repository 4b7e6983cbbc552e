"""Tables of a first-order calibration: parameters with their sds, residuals, noise."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.firstorder.allan import allan_deviation
from imuarray.firstorder.correct import FirstOrder
from imuarray.recording import Recording

MISALIGNMENT = ("xy", "xz", "yz")


def parameter_table(found: FirstOrder, recording: Recording) -> pd.DataFrame:
    """One row a parameter: sensor, triad, parameter, component, value, sd, unit."""
    parts, sds = found.triads.parts(), found.triads.parts_sd()
    parts["offset"] = found.triads.offset
    units = {"scale": "1", "misalignment": "1", "orientation": "rad", "offset": "m s-2"}
    rows = []
    for k, label in enumerate(recording.accelerometer_labels):
        for name, unit in units.items():
            components = MISALIGNMENT if name == "misalignment" else "xyz"
            for i, component in enumerate(components):
                value, sd = parts[name][k, i], sds[name][k, i]
                rows.append(("accelerometer", label, name, component, value, sd, unit))
    for k, label in enumerate(recording.gyroscope_labels):
        for i, axis in enumerate("xyz"):
            value, sd = found.gyroscope_offset[k, i], found.gyroscope_offset_sd[k, i]
            rows.append(("gyroscope", label, "offset", axis, value, sd, "rad s-1"))
    names = ["sensor", "triad", "parameter", "component", "value", "sd", "unit"]
    return pd.DataFrame(rows, columns=names)


def residual_table(found: FirstOrder, recording: Recording) -> pd.DataFrame:
    """Residual of each accelerometer triad over the still poses, m/s^2."""
    fit = found.triads
    return pd.DataFrame({
        "triad": recording.accelerometer_labels, "poses": len(fit.used),
        "left_out": (~fit.used).sum(axis=0), "residual_rms": fit.residual_rms,
        "residual_rms_all_poses": fit.residual_rms_all,
    })  # fmt: skip


def noise_table(found: FirstOrder, recording: Recording) -> pd.DataFrame:
    """Noise of each axis in SI units, beside what the recording declared.

    ``sd`` of one reading and ``correlation`` of neighbours; ``allan_1s`` the Allan deviation at
    the averaging time nearest to 1 s; ``floor`` the smallest one and ``floor_tau`` (s) where.
    """
    step = float(np.median(np.diff(recording.time)))
    parts = []
    for sensor, declared, sd, correlation in (
        ("specific_force", recording.accelerometer_noise_sd, found.accelerometer_noise,
         found.accelerometer_correlation),
        ("angular_rate", recording.gyroscope_noise_sd, found.gyroscope_noise,
         found.gyroscope_correlation),
    ):  # fmt: skip
        readings = getattr(recording, sensor)
        taus, deviation = allan_deviation([readings[pose] for pose in found.poses], step)
        lowest = deviation.argmin(axis=0)
        labels = recording.accelerometer_labels
        labels = labels if sensor == "specific_force" else recording.gyroscope_labels
        table = pd.DataFrame(
            [(sensor, label, axis) for label in labels for axis in "xyz"],
            columns=["sensor", "triad", "axis"],
        )
        parts.append(table.assign(
            declared=declared, sd=sd.ravel(), ratio=sd.ravel() / declared,
            correlation=correlation.ravel(),
            allan_1s=deviation[np.argmin(np.abs(taus - 1.0))].ravel(),
            floor=deviation.min(axis=0).ravel(), floor_tau=taus[lowest].ravel(),
        ))  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def allan_table(found: FirstOrder, recording: Recording) -> pd.DataFrame:
    """Allan deviations: sensor, triad, axis, tau_s, deviation (SI units)."""
    step = float(np.median(np.diff(recording.time)))
    parts = []
    for sensor in ("specific_force", "angular_rate"):
        readings = getattr(recording, sensor)
        taus, deviation = allan_deviation([readings[pose] for pose in found.poses], step)
        kind = "accelerometer" if sensor == "specific_force" else "gyroscope"
        labels = getattr(recording, f"{kind}_labels")
        index = pd.MultiIndex.from_product(
            [[sensor], taus, labels, list("xyz")], names=["sensor", "tau_s", "triad", "axis"]
        )
        parts.append(pd.DataFrame({"deviation": deviation.ravel()}, index).reset_index())
    return pd.concat(parts, ignore_index=True)
