"""A calibration as a labelled dataset: of the engine's estimate, or of a diagnosis."""

import json
from collections.abc import Sequence

import numpy as np
import xarray as xr

from imuarray.engine.course import changes, course
from imuarray.engine.estimate import Estimate
from imuarray.engine.parameters import POSITION, model_of
from imuarray.engine.widths import widths
from imuarray.model import ArrayModel, Noise
from imuarray.model.array_model import parameter_names
from imuarray.model.effects import DATA_EFFECTS, EFFECTS, KINDS
from imuarray.motion.state import UNITS
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording
from imuarray.recording.record import CLOCKS, DIMENSIONS, MATRICES

PLACE = ("accelerometer", "axis")


def positions_dataset(recording: Recording, positions, covariance) -> xr.Dataset:
    """Positions (A, 3) m and the covariance (3 (A - 1),) squared m^2 of r_2 ... r_A."""
    count = len(positions)
    labels = list(recording.accelerometer_labels)
    whole = np.zeros((count, 3, count, 3))
    whole[1:, :, 1:, :] = covariance.reshape(count - 1, 3, count - 1, 3)
    variables = {
        "position": (PLACE, positions, {"units": "m", "relative_to": labels[0], "scope": "board"}),
        "nominal_position": (PLACE, recording.relative_positions(), {"units": "m"}),
        "position_covariance": (
            (*PLACE, "accelerometer_other", "axis_other"), whole, {"units": "m2"}
        ),
    }  # fmt: skip
    coords = {
        "accelerometer": labels, "axis": list("xyz"), "accelerometer_other": labels,
        "axis_other": list("xyz"), "gyroscope": list(recording.gyroscope_labels),
    }  # fmt: skip
    return xr.Dataset(variables, coords, {"position_prior_sd": recording.position_prior_sd})


def with_readings(dataset: xr.Dataset, recordings: Sequence[Recording]) -> xr.Dataset:
    """A calibration that knows its readings: axes, corrections, what these left, and the rate."""
    first = recordings[0]
    known = {name: getattr(first, name) for name in MATRICES if getattr(first, name) is not None}
    dataset = dataset.assign({n: (DIMENSIONS[n], x, {"units": "1"}) for n, x in known.items()})
    corrections = [one.correction for one in recordings if one.correction is not None]
    if len(corrections) == len(recordings):
        dataset = dataset.merge(xr.concat(corrections, "recording").reset_coords(drop=True))
    if first.alignment is not None:
        clocks = {name: first.alignment[name].to_numpy() for name in (*CLOCKS, "rate")}
        dataset = dataset.assign({n: ("accelerometer", clocks[n]) for n in CLOCKS})
        dataset["log_rate"] = "accelerometer", clocks["rate"][:, 0]
    if len(first.time) > 1 and not first.selected:
        dataset.attrs["rate"] = float(f"{1 / np.median(np.diff(first.time)):.10g}")
    return dataset


def noise_variables(noise: Noise) -> dict:
    """The sds of triads and axes, m/s^2 and rad/s, as variables."""
    force, rate = (
        np.sqrt(np.diag(part)).reshape(-1, 3) for part in (noise.accelerometer, noise.gyroscope)
    )
    return {
        "accelerometer_sd": (PLACE, force, {"units": "m s-2"}),
        "gyroscope_sd": (("gyroscope", "axis"), rate, {"units": "rad s-1"}),
    }


def motion_variables(fields) -> dict:
    """angular rate, angular acceleration and specific force, (T, 3) each, as variables."""
    return {
        name: (("time", "axis"), field, {"units": unit})
        for (name, unit), field in zip(UNITS.items(), fields, strict=True)
    }


def engine_dataset(recordings, found: Estimate) -> xr.Dataset:
    """Calibration of the engine's estimate."""
    first, readings = recordings[0], found.recorded[0].readings
    covariance, *sds = widths(found)
    effects = effects_of(found)
    place, size = places_among(found, effects)
    count = 3 * (readings.array.accelerometers - 1)
    whole = np.zeros((size, size))
    used = np.flatnonzero(place >= 0)
    whole[np.ix_(place[used], place[used])] = covariance[np.ix_(used, used)]
    dataset = positions_dataset(first, found.positions, whole[:count, :count])
    variables: dict[str, tuple] = {
        f"position_sd_{name}": (PLACE, _by_triad(place, sd, count), {"units": "m"})
        for name, sd in zip(("formal", "jackknife"), sds, strict=True)
    }
    counts = readings.array.accelerometers, readings.array.gyroscopes
    own = (part[:n] for part, n in zip(found.noise_sd().T, counts, strict=True))
    variables |= noise_variables(Noise.of(*counts, *own))
    variables["step"] = (("iteration",), np.array(found.steps))
    coords: dict[str, object] = {}
    if len(recordings) == 1:
        motion = found.recorded[0].state.motion[:, :9]
        variables |= motion_variables(np.split(motion, 3, axis=1))
        coords["time"] = readings.time + readings.origin
        more = course(found, first.time[~first.still()])
        variables, coords = variables | more[0], coords | more[1]
    if effects:
        model = model_of(first, effects)
        labels = first.accelerometer_labels, first.gyroscope_labels
        sd = np.sqrt(np.diag(whole))[count:]
        variables |= {
            "effect_parameter": (("parameter",), parameters_of(found, model)),
            "effect_sd": (("parameter",), sd),
            # of r_2 ... r_A, then the effects' parameters
            "whole_covariance": (("unknown", "unknown_other"), whole),
        }
        coords["parameter"] = names = parameter_names(model, labels)
        scope = [EFFECTS[name.split()[0]].scope for name in names]
        coords["scope"] = "parameter", scope
        theirs = np.flatnonzero(np.array(scope) == "recording")
        if len(recordings) > 1 and len(theirs):
            variables |= _of_recordings(found, model, theirs, np.sqrt(np.diag(covariance)))
            coords["own"] = [names[number] for number in theirs]
    growth, (imu, move) = changes(found)
    dataset.attrs["size_growth"], dataset.attrs["size_growth_sd"] = growth
    dataset.attrs["farthest_moved"], dataset.attrs["farthest_move"] = readings.labels[imu], move
    for kind, (chance, imus) in found.maps_hold.items():
        dataset.attrs[f"{kind}_maps_hold"] = chance
        dataset.attrs[f"{kind}_maps_farthest"] = ", ".join(readings.labels[k] for k in imus)
    smooth = found.smooth_ratio()
    if smooth is not None:
        for which, kind in enumerate(KINDS):
            variables[f"{kind}_smooth_residual"] = (kind,), smooth[: counts[which], which]
    dataset = dataset.assign(variables).assign_coords(coords)
    dataset.attrs |= {
        "converged": int(found.converged), "residual_ratio": found.residual_ratio(),
        "student_t": [float(nu) for nu in found.freedoms], "effects": ",".join(effects),
        "gyroscope_common_scale_sd": found.scale_sd, "time_origin": readings.origin,
        "span": readings.span,
        "samples": sum(len(one.readings.time) for one in found.recorded),
    }  # fmt: skip
    return dataset


def _of_recordings(found: Estimate, model: ArrayModel, own, sds) -> dict:
    """Each recording's ``own`` ones of the parameters as variables; ``sds`` (n,) of all."""
    values, widths = [], []
    for number in range(len(found.recorded)):
        place, size = places_among(found, model.effects, number)
        sd = np.zeros(size)
        sd[place[place >= 0]] = sds[place >= 0]
        values.append(parameters_of(found, model, number)[own])
        widths.append(sd[size - model.effect_size :][own])
    dims = ("recording", "own")
    return {"own_parameter": (dims, np.array(values)), "own_sd": (dims, np.array(widths))}


def effects_of(found: Estimate) -> tuple[str, ...]:
    """The effects with free parameters, or with values, in the model's order."""
    values = found.columns.model.split(found.recorded[0].state.parameters)
    free = set(np.array(found.columns.names)[found.active.any(axis=0)])
    return tuple(
        item.id for item in found.columns.model.chain
        if item.id in free or np.asarray(values[item.id]).any()
    )  # fmt: skip


def parameters_of(found: Estimate, model: ArrayModel, number: int = 0) -> np.ndarray:
    """Flat, in a model's order; a recording's own ones are those of the recording ``number``."""
    values = found.columns.model.split(found.recorded[number].state.parameters)
    return model.join({item.id: values[item.id] for item in model.chain})


def places_among(found: Estimate, effects, recording: int = 0) -> tuple[np.ndarray, int]:
    """Places of the n parameters among r_2 ... r_A and the effects'; -1 for none.

    Another recording's own ones have none. Also the number of places.
    """
    array, columns = found.recorded[0].readings.array, found.columns
    offset, shapes = 3 * (array.accelerometers - 1), {}
    for item, shape in zip(columns.model.chain, columns.model.shapes, strict=True):
        if item.id in effects:
            shapes[item.id] = offset, shape
            offset += int(np.prod(shape))
    out = np.full(len(found.values), -1)
    for number, (imu, column) in enumerate(np.argwhere(found.active)):
        name, inner = columns.names[column], columns.places[column]
        if name == POSITION:
            place = 3 * (imu - 1) + inner[0]
        else:
            first, shape = shapes[name]
            place = first + np.ravel_multi_index((imu, *inner), shape)
        out[found.places[recording][number]] = place
    return out, offset


def _by_triad(place, values, count) -> np.ndarray:
    """(A, 3) of the positions' values among all; zero for the reference."""
    out = np.zeros(count + 3)
    mine = (place >= 0) & (place < count)
    out[3 + place[mine]] = values[mine]
    return out.reshape(-1, 3)


def diagnosed(diagnosis) -> xr.Dataset:
    """The extended model that `imuarray.diagnose` came to, as `imuarray.calibrate` would give it.

    Attribute ``corrected_readings``: effects whose readings were put right in memory, or left out.
    """
    recording, document = diagnosis.recording, diagnosis.document
    found = with_readings(engine_dataset([recording], diagnosis.extended.robust), [recording])
    named = [cause["effect"] for cause in document["causes"] if cause["effect"] in DATA_EFFECTS]
    corrected = [name for name in named if DATA_EFFECTS[name].kind == "readings"]
    data = recording.specific_force, recording.angular_rate
    return found.assign_attrs(
        model="diagnosis", corrected_readings=" ".join(corrected),
        reasons=json.dumps(document.get("reasons", [])),
        **stamp({"recording": digest(*data)}, document["seed"]),
    )  # fmt: skip
