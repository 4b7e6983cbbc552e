"""A calibration as other tools want it: one plain document, of which the file formats are made."""

from typing import Any

import numpy as np
import xarray as xr

from imuarray.analysis import formats, methods
from imuarray.errors import InputError, require, require_one_of
from imuarray.firstorder.noise import TERMS, StillNoise
from imuarray.geometry import Array
from imuarray.model import ArrayModel
from imuarray.model.effects import KINDS, Prediction
from imuarray.provenance import finite
from imuarray.recording.record import CORRECTION, NUMBERS
from imuarray.recording.validate import is_rotation
from imuarray.trust import effect_names, parameters_of, reasons_in, require_fit

BIASES = "accelerometer_bias", "gyroscope_bias"
MATRICES = ("accelerometer_scale", "accelerometer_misalignment", "gyroscope_scale",
            "gyroscope_misalignment")  # fmt: skip
# Of a triad's row of parameters, the entry that is a delay, and its sign.
TIMES: dict[str, tuple] = {"sensor_delay": (KINDS, (), 1), "sensor_clock": (KINDS, (3,), -1),
         "gyroscope_delay": (KINDS[1:], (), 1),
         "accelerometer_filter": (KINDS[:1], (0,), 1)}  # fmt: skip
FORMULAS = {
    "corrections": "for each step in turn x = inverse @ (x - offset), each component summed as"
    " (i0 x0 + i1 x1) + i2 x2; x begins as the recording's raw reading, which is axes @ the"
    " chip's, and ends as specific force or angular rate in the array's frame",
    "rotation": "from the array's frame to the IMU's: z along the accelerometer's z axis, y in the"
    " plane of its y and z axes; rotation_sd_rad about the IMU's x, y, z",
    "kalibr": "p_i = T_i_b p_b from the frame of IMU 0 to that of IMU i, which here have x along"
    " the accelerometer's x axis, y in the plane of x and y; the chip reads M C u + bias, with C"
    " the rotation of T_i_b, its gyroscope M C_gyro_i C omega + bias, u and omega in b",
    "time_offset_s": "a reading stamped t is of the time t + time_offset_s on the clock of the"
    " accelerometer of IMU 0; with a clock of its own, t + time_offset_s - drift (t - at_s)",
    "noise": "continuous: the sd of one reading is noise_density * sqrt(rate_hz)",
}


def export(calibration: xr.Dataset, format: str = "json", noise: StillNoise | None = None) -> str:
    """A calibration as the text of a file for other tools (docs/export.md).

    Parameters
    ----------
    calibration
        What `calibrate` gave.
    format
        "json": everything, with the formulas; "kalibr": its imu.yaml of several IMUs; "urdf":
        links and fixed joints; "csv": positions, turns and time offsets with sds.
    noise
        What `allan` found in a still recording of the same IMUs; without it the white noise is
        that of the calibration, and random walks are left open.

    InputError for another format, a calibration that is not whole, or noise of other IMUs.
    """
    require_one_of("format", format, methods.EXPORTS)
    return getattr(formats, format)(describe(calibration, noise))


def describe(calibration: xr.Dataset, noise: StillNoise | None = None) -> dict[str, Any]:
    """The document: plain data, None for what is not known; units in the keys or beside them."""
    require_fit(calibration)
    labels = {kind: [str(label) for label in calibration[kind].to_numpy()] for kind in KINDS}
    few = len(labels["gyroscope"]) <= len(labels["accelerometer"])
    require(few, "export", "no more gyroscopes than accelerometers", "more")
    attrs, positions = calibration.attrs, calibration["position"].to_numpy()
    effects = effect_names(calibration)
    array = Array(positions, tuple(labels["accelerometer"]), len(labels["gyroscope"]), "export")
    model = ArrayModel.isotropic(array, 1.0, 1.0, effects)
    _require_whole(calibration, model)
    try:
        steps, times = _steps(calibration, model), _times(calibration, model)
        frames = formats.frames_of(calibration, steps, positions)
    except np.linalg.LinAlgError:
        raise InputError("expected corrections that can be inverted, found singular ones") from None
    rate = attrs.get("rate", noise.rate_hz if noise else None)
    imus = []
    for k, frame in enumerate(frames):
        imu: dict[str, Any] = {"label": labels["accelerometer"][k], **_clock(calibration, k)}
        imu |= frame
        for kind in KINDS:
            if k < len(labels[kind]):
                value, sd = (part[k] for part in times[kind])
                imu[kind] = {
                    "label": labels[kind][k], "unit": NUMBERS[f"{kind}_noise_sd"],
                    "corrections": [
                        {name: part if name == "from" else part[k] for name, part in step.items()}
                        for step in steps[kind]
                    ],
                    "time_offset_s": value, "time_offset_sd_s": sd,
                    "noise": _noise(calibration, noise, kind, k, rate),
                }  # fmt: skip
        imus.append(imu | {"kalibr": imu.pop("kalibr")})
    return finite({
        "created_by": str(attrs.get("created_by", "")),
        "trusted": bool(attrs["trusted"]) if "trusted" in attrs else None,
        "reasons": reasons_in(calibration), "formulas": FORMULAS, "rate_hz": rate, "imus": imus,
        "position_covariance_m2": calibration["position_covariance"].to_numpy(),
        "parameters": parameters_of(calibration),
        "not_in_matrices": [name for name in effects if name not in (*MATRICES, *BIASES, *TIMES)],
    })  # fmt: skip


def _require_whole(calibration: xr.Dataset, model: ArrayModel) -> None:
    """InputError for numbers that are fit, but not those of rotations, or of the effects."""
    turns = calibration.get("accelerometer_axes")
    maps = [calibration[f"{kind}_inverse"] for kind in KINDS if f"{kind}_inverse" in calibration]
    rate = np.asarray(calibration.attrs.get("rate", 1.0))
    for right, what in (
        (calibration.sizes.get("parameter", 0) == model.effect_size, "all of its parameters"),
        (model.effect_size == 0 or {"effect_parameter", "effect_sd"} <= set(calibration), "values"),
        (calibration.sizes.get("recording", 1) > 0, "a recording"),
        (turns is None or is_rotation(turns.to_numpy()).all(), "rotations as axes"),
        (all((np.linalg.det(one) > 0).all() for one in maps), "inverses that mirror nothing"),
        (rate.dtype.kind == "f" and rate.size == 1 and rate > 0, "a rate in Hz"),
    ):
        require(right, "", f"a calibration with {what}", "others, or none")


def _steps(calibration: xr.Dataset, model: ArrayModel) -> dict[str, list[dict]]:
    """Corrections of each kind in turn, arrays with triads first."""
    out: dict[str, list[dict]] = {kind: [] for kind in KINDS}
    if set(CORRECTION) <= set(calibration):
        for kind in KINDS:
            out[kind] = [{"from": "first-order"}]
        for name in CORRECTION:
            kind, _, part = name.partition("_")
            out[kind][0][part] = calibration[name].isel(recording=0).to_numpy()
        for kind, left in formats.left_of(calibration).items():
            out[kind][0]["map_sd"] = np.sqrt(np.maximum(np.diag(left), 0)).reshape(-1, 3, 3)
    found = calibration.get("effect_parameter")
    values = model.split(np.empty(0) if found is None else found.to_numpy())
    for number, kind in enumerate(KINDS):
        if any(name.startswith(kind) for name in set(values) & {*MATRICES, *BIASES}):
            matrix, offset = _linear(model, values, number)
            step = {"from": "calibrate", "inverse": np.linalg.inv(matrix), "offset": offset}
            out[kind].append(step)
    return out


def _linear(model: ArrayModel, values: dict, kind: int) -> tuple[np.ndarray, np.ndarray]:
    """reading = matrix (n, 3, 3) @ truth + offset (n, 3) by the effects that are a matrix."""

    def read(truth, names):
        counts = model.array.accelerometers, model.array.gyroscopes
        seen = Prediction(*(np.broadcast_to(truth, (count, 3)) for count in counts))
        for item in model.chain:
            if item.id in names:
                seen = item.apply(values[item.id], None, seen)
        return np.asarray(seen[kind])

    columns = [read(unit, MATRICES) for unit in np.eye(3)]
    return np.stack(columns, axis=2), read(np.zeros(3), (*MATRICES, *BIASES))


def _times(calibration: xr.Dataset, model: ArrayModel) -> dict[str, tuple]:
    """Time offsets (n,) s of each kind against the first accelerometer, and their sds."""
    size = model.effect_size
    places: dict[str, Any] = model.split(np.arange(size))
    weights = {kind: np.zeros((calibration.sizes[kind], size)) for kind in KINDS}
    for name in set(places) & set(TIMES):
        kinds, inner, sign = TIMES[name]
        for kind in kinds:
            for k, row in enumerate(weights[kind]):
                row[places[name][(k, *inner)]] += sign
    found, covariance, out = np.zeros(size), np.zeros((size, size)), {}
    if size:
        found = calibration["effect_parameter"].to_numpy()
        covariance = np.diag(calibration["effect_sd"].to_numpy() ** 2)
    if size and "whole_covariance" in calibration:
        covariance = calibration["whole_covariance"].to_numpy()[-size:, -size:]
    own = np.zeros((2, calibration.sizes[KINDS[0]]))
    if "clock_offset" in calibration:
        own = np.array([calibration[f"clock_offset{part}"].to_numpy() for part in ("", "_sd")])
    for kind, rows in weights.items():
        against = rows - weights[KINDS[0]][0]
        clock, clock_sd = own[:, : len(rows)]
        variances = np.einsum("ki,ij,kj->k", against, covariance, against) + clock_sd**2
        # what was held fixed has no sd
        sds = np.sqrt(np.where(variances > 0, variances, np.nan))
        out[kind] = against @ found - clock, sds
    return out


def _clock(calibration: xr.Dataset, k: int) -> dict[str, Any]:
    """An IMU's rate, and what its clock gains, where it logged by itself."""
    if "clock_drift" not in calibration:
        return {"rate_hz": calibration.attrs.get("rate"), "clock": None}
    names = {"drift": "clock_drift", "drift_sd": "clock_drift_sd", "at_s": "clock_middle"}
    found = {name: calibration[own].to_numpy()[k] for name, own in names.items()}
    rate = float(f"{calibration['log_rate'].to_numpy()[k]:.10g}")
    return {"rate_hz": rate, "clock": found if k else None}


def _noise(calibration: xr.Dataset, noise: StillNoise | None, kind: str, k: int, rate) -> dict:
    """Terms of one triad, x, y, z each."""
    if noise is None:
        sds = calibration.get(f"{kind}_sd")
        density = np.nan if sds is None or not rate else sds.to_numpy()[k] / np.sqrt(rate)
        return {"from": "calibrate", TERMS[0]: {"value": np.broadcast_to(density, 3)}}
    sensor = "specific_force" if kind == KINDS[0] else "angular_rate"
    label = str(calibration[kind].to_numpy()[k])
    table = noise.terms[(noise.terms.sensor == sensor) & (noise.terms.triad == label)]
    require(not table.empty, "noise", f"that of {kind} {label}", "none")
    out: dict[str, Any] = {"from": "allan"}
    for term, part in table.groupby("term", sort=False):
        out[str(term)] = {name: part[name].to_numpy() for name in ("value", "sd", "below")}
        out[str(term)]["unit"] = part.unit.iloc[0]
    return out
