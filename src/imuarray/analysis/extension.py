"""The extended model of a diagnosis as a calibration: what `imuarray.apply` can use."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.analysis.model import model_of
from imuarray.diagnosis.extension import extended_model, read_extension
from imuarray.errors import InputError
from imuarray.model.names import parameter_ids, parameter_names
from imuarray.recording import Recording


def diagnosed(diagnosis: str | PathLike, recording: Recording) -> xr.Dataset:
    """Positions and effects of a ``diagnosis.json``, as `calibrate` would give them.

    ``recording`` is the one that was diagnosed, or a part of it: clocks and drifts are its own. The
    diagnosis states sds but not how positions and effects go together, without which they tell
    nothing of the motion's error: ``whole_covariance`` is not there. InputError for another
    file, or other IMUs.
    """
    extension = read_extension(Path(diagnosis))
    labels = recording.accelerometer_labels, recording.gyroscope_labels
    model = extended_model(extension, model_of(recording), labels)
    positions, sds = extension.positions, extension.positions_sd.copy()
    names = parameter_names(model, labels)
    # 0 where the diagnosis states none
    effect_sds = np.array([
        extension.values[effect].get(name, (0.0, None))[1] or 0.0
        for effect, name in parameter_ids(model, labels)
    ])  # fmt: skip
    count = len(labels[0])
    if not positions.shape == sds.shape == (count, 3):
        raise InputError(
            f"{diagnosis}: expected positions of {count} accelerometers, as in the recording, found"
            f" {len(positions)}"
        )
    sds[0] = 0.0  # the reference's
    covariance = np.diag(sds.ravel() ** 2).reshape(count, 3, count, 3)
    noise = [
        np.sqrt(np.diag(part)).reshape(-1, 3)
        for part in (model.noise.accelerometer, model.noise.gyroscope)
    ]
    place = ("accelerometer", "axis")
    variables = {
        "position": (place, positions - positions[0], {"units": "m", "relative_to": labels[0][0]}),
        "nominal_position": (place, recording.relative_positions(), {"units": "m"}),
        "position_covariance": (
            (*place, "accelerometer_other", "axis_other"), covariance, {"units": "m2"},
        ),
        "effect_parameter": (("parameter",), model.effect_start),
        "effect_sd": (("parameter",), effect_sds),
        "accelerometer_sd": (place, noise[0], {"units": "m s-2"}),
        "gyroscope_sd": (("gyroscope", "axis"), noise[1], {"units": "rad s-1"}),
    }  # fmt: skip
    coords = {
        "accelerometer": list(labels[0]), "gyroscope": list(labels[1]), "axis": list("xyz"),
        "accelerometer_other": list(labels[0]), "axis_other": list("xyz"), "parameter": names,
    }  # fmt: skip
    attrs = {
        "effects": ",".join(model.effects), "time_origin": extension.clock[0],
        "span": extension.clock[1],
    }  # fmt: skip
    return xr.Dataset(variables, coords, attrs)
