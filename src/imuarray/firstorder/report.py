"""Tables of a first-order calibration: parameters with their sds, residuals, noise."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.firstorder.allan import allan_deviation
from imuarray.firstorder.correct import FirstOrder
from imuarray.recording import Recording

MISALIGNMENT = ("xy", "xz", "yz")
SENSORS = {"specific_force": "accelerometer", "angular_rate": "gyroscope"}


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


def _allan(found: FirstOrder, recording: Recording, sensor: str):
    """Averaging times (S,) s and Allan deviations (S, K, 3) of the still poses."""
    step = float(np.median(np.diff(recording.time)))
    readings = getattr(recording, sensor)
    return allan_deviation([readings[pose] for pose in found.poses], step)


def noise_table(found: FirstOrder, recording: Recording) -> pd.DataFrame:
    """Noise of each axis in SI units, beside what the recording declared.

    ``sd`` of one reading and ``correlation`` of neighbours; ``allan_1s`` the Allan deviation at
    the averaging time nearest to 1 s; ``floor`` the smallest one and ``floor_tau`` (s) where.
    """
    parts = []
    for sensor, kind in SENSORS.items():
        taus, deviation = _allan(found, recording, sensor)
        declared = getattr(recording, f"{kind}_noise_sd")
        sd = getattr(found, f"{kind}_noise").ravel()
        index = pd.MultiIndex.from_product(
            [[sensor], getattr(recording, f"{kind}_labels"), list("xyz")],
            names=["sensor", "triad", "axis"],
        )
        columns = {
            "declared": declared, "sd": sd, "ratio": sd / declared,
            "correlation": getattr(found, f"{kind}_correlation").ravel(),
            "allan_1s": deviation[np.argmin(np.abs(taus - 1.0))].ravel(),
            "floor": deviation.min(axis=0).ravel(),
            "floor_tau": taus[deviation.argmin(axis=0)].ravel(),
        }  # fmt: skip
        parts.append(pd.DataFrame(columns, index).reset_index())
    return pd.concat(parts, ignore_index=True)


def allan_table(found: FirstOrder, recording: Recording) -> pd.DataFrame:
    """Allan deviations: sensor, triad, axis, tau_s, deviation (SI units)."""
    parts = []
    for sensor, kind in SENSORS.items():
        taus, deviation = _allan(found, recording, sensor)
        labels = getattr(recording, f"{kind}_labels")
        index = pd.MultiIndex.from_product(
            [[sensor], taus, labels, list("xyz")], names=["sensor", "tau_s", "triad", "axis"]
        )
        parts.append(pd.DataFrame({"deviation": deviation.ravel()}, index).reset_index())
    return pd.concat(parts, ignore_index=True)
