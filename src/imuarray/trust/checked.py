"""Checks that a calibration is whole, and one of the recording's IMUs, before it is used.

A file may have been cut, edited, or belong to another board; what is computed with it would be
numbers all the same.
"""

import json

import numpy as np
import xarray as xr

from imuarray.errors import LARGEST, SMALLEST, InputError, one_line, require
from imuarray.model.effects import DATA_EFFECTS, EFFECTS, KINDS, own_version
from imuarray.recording import Recording
from imuarray.recording.record import CLOCKS, CORRECTION, DIMENSIONS, MATRICES
from imuarray.trust.settings import SETTINGS

_PLACE = ("accelerometer", "axis")
# Variables by whether they are needed: always, with effects, or not at all.
_ALWAYS = {
    "position": _PLACE, "position_covariance": (*_PLACE, "accelerometer_other", "axis_other"),
    "accelerometer_sd": _PLACE, "gyroscope_sd": ("gyroscope", "axis"),
}  # fmt: skip
_WITH_EFFECTS = {"effect_parameter": ("parameter",)}
_PERHAPS = {
    "nominal_position": _PLACE, "whole_covariance": ("unknown", "unknown_other"),
    **{name: DIMENSIONS[name] for name in MATRICES},
    **dict.fromkeys((*CLOCKS, "log_rate"), ("accelerometer",)),
    **{name: ("recording", *dims) for name, dims in CORRECTION.items() if name[-3:] != "_sd"},
}  # fmt: skip


def require_fit(calibration: xr.Dataset, recording: Recording | None = None) -> None:
    """InputError unless this is a whole calibration, of the IMUs of a recording if one is given."""
    needed = _ALWAYS | (_WITH_EFFECTS if "effect_parameter" in calibration else {})
    for name, dimensions in (needed | _PERHAPS).items():
        if name in calibration.variables:
            _require_numbers(calibration[name], dimensions)
        elif name in needed:
            raise InputError(f"expected a calibration (imuarray calibrate), found no {name}")
    for name in str(calibration.attrs.get("corrected_readings", "")).split():
        # mended in memory: the readings of the file are as they were
        right = name in DATA_EFFECTS and DATA_EFFECTS[name].left_out
        found = f"{name}: give the axes in columns.yaml, convert the log again, and calibrate that"
        require(right, "", "a calibration of readings with the right axes", found)
    if recording is not None:
        require_labels(calibration, recording)
    if "effect_parameter" in calibration:
        _require_effects(calibration)
    _require_sizes(calibration)
    for name in ("position_covariance", "whole_covariance"):
        if name in calibration:
            _require_covariance(calibration[name])
    if recording is not None:
        _require_board(calibration, recording)


def effect_names(calibration: xr.Dataset) -> list[str]:
    """The effects that a calibration has in its model; none of the papers' model."""
    return [name for name in str(calibration.attrs.get("effects", "")).split(",") if name]


def parameters_of(calibration: xr.Dataset) -> dict[str, dict[str, float]]:
    """Value and sd of each of the effects' parameters, by its name; none without effects."""
    if "effect_parameter" not in calibration:
        return {}
    names = "parameter", "effect_parameter", "effect_sd"
    rows = zip(*(calibration[name].to_numpy() for name in names), strict=True)
    return {str(name): {"value": value, "sd": sd} for name, value, sd in rows}


def values_of(calibration: xr.Dataset, start: str) -> dict[str, float]:
    """Values of the effects' parameters whose names ``start`` so: by component and IMU ("xy_3")."""
    if "effect_parameter" not in calibration:
        return {}
    names, values = (calibration[name].to_numpy() for name in ("parameter", "effect_parameter"))
    # "effect component_IMU unit", where the name of an IMU may have blanks
    return {
        str(name).split(" ", 1)[1].rpartition(" ")[0]: float(value)
        for name, value in zip(names, values, strict=True) if name.startswith(start)
    }  # fmt: skip


def reasons_in(calibration: xr.Dataset) -> list[str]:
    """Why a calibration is not to be trusted, as its file says; none for one that is."""
    try:
        return [one_line(str(reason)) for reason in json.loads(calibration.attrs["reasons"])]
    except KeyError:
        return []
    except (ValueError, TypeError):
        raise InputError("expected the attribute reasons as a JSON list, found another") from None


def _require_numbers(variable: xr.DataArray, dimensions: tuple[str, ...]) -> None:
    name, numeric = str(variable.name), variable.dtype.kind in "fiu"
    found = f"{variable.dtype} by {', '.join(map(str, variable.dims)) or 'nothing'}"
    wanted = f"numbers by {', '.join(dimensions)}"
    require(numeric and variable.dims == dimensions, name, wanted, found)
    values = np.asarray(variable.to_numpy(), float)
    least = SMALLEST if name in ("accelerometer_sd", "gyroscope_sd") else -LARGEST
    wrong = values[~((values >= least) & (values <= LARGEST))]  # NaN, too
    wanted = f"finite numbers from {least:g} to {LARGEST:g}"
    require(not wrong.size, name, wanted, str(wrong[0]) if wrong.size else "")


def require_labels(calibration: xr.Dataset, recording: Recording) -> None:
    """InputError where a calibration's sensors are not the recording's."""
    for kind in KINDS:
        expected = getattr(recording, f"{kind}_labels")
        coordinate = calibration.coords.get(kind)
        labels = () if coordinate is None else tuple(map(str, coordinate.to_numpy().ravel()))
        wanted = f"{kind}s {', '.join(expected)}, as in the recording"
        require(labels == expected, "", wanted, ", ".join(labels) or "none")


def _require_sizes(calibration: xr.Dataset) -> None:
    count = calibration.sizes["accelerometer"]
    unknown = 3 * (count - 1) + calibration.sizes.get("parameter", 0)
    expected = {
        "axis": 3, "axis_other": 3, "accelerometer_other": count, "unknown": unknown,
        "unknown_other": unknown,
    }  # fmt: skip
    maps = 9 * count, 9 * (count + calibration.sizes.get("gyroscope", count))
    entries = maps[calibration.sizes.get("map_entry") != maps[0]]
    expected |= {"map_entry": entries, "map_entry_other": entries}
    for name, size in expected.items():
        if calibration.sizes.get(name, size) != size:
            raise InputError(f"expected {size} of {name}, found {calibration.sizes[name]}")


def _require_covariance(variable: xr.DataArray) -> None:
    values = variable.to_numpy().astype(float)
    matrix = values.reshape((int(round(values.size**0.5)),) * 2)
    variances = np.diag(matrix)
    scale = np.sqrt(np.where(variances > 0, variances, 1.0))
    correlation = matrix / np.outer(scale, scale)
    proper = np.allclose(correlation, correlation.T, atol=SETTINGS.indefinite)
    proper &= not np.any(matrix[variances <= 0])  # what is known, such as the reference's place
    if not proper or np.linalg.eigvalsh(correlation)[0] < -SETTINGS.indefinite:
        raise InputError(f"{variable.name}: expected a covariance, found a matrix that is none")


def _require_board(calibration: xr.Dataset, recording: Recording) -> None:
    """Labels are numbers on most boards; the drawing tells one board from another."""
    if "nominal_position" not in calibration:
        return
    drawn = calibration["nominal_position"].to_numpy()
    apart = np.abs(drawn - drawn[0] - recording.relative_positions()).max(axis=1)
    prior = max(recording.position_prior_sd, _number(calibration, "position_prior_sd", 0.0))
    k = int(np.argmax(apart))
    off = f"{recording.accelerometer_labels[k]} is {1e3 * apart[k]:.3g} mm off in its drawing"
    other = f"one of another: accelerometer {off}"
    same = not apart[k] > SETTINGS.same_board * prior
    require(same, "", "a calibration of the recording's board", other)


def _require_effects(calibration: xr.Dataset) -> None:
    """InputError unless the calibration's effects are here, a user's own with the same text."""
    for name, least in (("time_origin", -LARGEST), ("span", SMALLEST)):
        if not least <= _number(calibration, name, np.nan) <= LARGEST:
            raise InputError(f"expected the attribute {name} in s, found none or no such number")
    effects = str(calibration.attrs.get("effects", "")).split(",")
    missing = [name for name in effects if name not in EFFECTS]
    remedy = "name the file that defines them (--effect-file, imuarray.read_effects)"
    found = f"no {', '.join(missing)}: {remedy}"
    require(not missing, "", "the effects of the calibration", found)
    try:
        known = " ".join(map(str, json.loads(calibration.attrs.get("versions", "{}")).values()))
    except (ValueError, TypeError, AttributeError):
        raise InputError("expected the attribute versions as JSON, found another text") from None
    for name in effects:
        text = own_version(name)
        same = text is None or text in known
        require(same, "", f"the effect {name} as it was at the calibration", "another text")


def _number(calibration: xr.Dataset, name: str, default: float) -> float:
    """An attribute as a number, NaN where it is none."""
    value = np.asarray(calibration.attrs.get(name, default))
    return float(value.item()) if value.dtype.kind in "fiu" and value.size == 1 else np.nan
