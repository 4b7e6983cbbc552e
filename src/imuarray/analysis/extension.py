"""The extended model of a diagnosis as a calibration: what `imuarray.apply` can use."""

import json
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.analysis.calibration_dataset import noise_variables, positions_dataset
from imuarray.analysis.checked import require_right_axes
from imuarray.analysis.model import model_of
from imuarray.diagnosis.extension import extended_model, read_extension
from imuarray.errors import InputError
from imuarray.model.array_model import parameter_ids, parameter_names
from imuarray.recording import Recording


def diagnosed(diagnosis: str | PathLike, recording: Recording) -> xr.Dataset:
    """Positions and effects of a ``diagnosis.json``, as `calibrate` would give them.

    ``recording`` should be the one that was diagnosed: clocks and drifts are its own; the
    attribute ``of_diagnosed`` says whether it is. The diagnosis states sds but not how positions
    and effects go together, without which they tell nothing of the motion's error:
    ``whole_covariance`` is not there. InputError for another file, or other IMUs, and where the
    diagnosis has found exchanged axes.
    """
    extension = read_extension(Path(diagnosis))
    require_right_axes(extension.before)
    labels = recording.accelerometer_labels, recording.gyroscope_labels
    model = extended_model(extension, model_of(recording), labels)
    positions, sds = extension.positions, extension.positions_sd
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
    found = positions_dataset(recording, positions - positions[0], np.diag(sds[1:].ravel() ** 2))
    found = found.assign(
        effect_parameter=("parameter", model.effect_start), effect_sd=("parameter", effect_sds),
        **noise_variables(model.noise),
    ).assign_coords(parameter=names)  # fmt: skip
    origin, span = extension.clock
    begins, lasts = recording.time[0], np.ptp(recording.time)
    document = json.loads(Path(diagnosis).read_text(encoding="utf-8"))
    return found.assign_attrs(
        effects=",".join(model.effects), time_origin=origin, span=span,
        of_diagnosed=int(np.allclose([begins, lasts], extension.clock, rtol=1e-9, atol=1e-9)),
        reasons=json.dumps(document.get("reasons", [])),
    )  # fmt: skip
