"""The extended model of a diagnosis as a calibration, for the pictures that both pages have."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.engine.course import course
from imuarray.engine.parameters import POSITION
from imuarray.engine.widths import widths
from imuarray.model.effects import KINDS
from imuarray.report import pictures
from imuarray.report.excitation import shown
from imuarray.report.page import CAPTIONS, Drawing, beside, files

if TYPE_CHECKING:
    from imuarray.diagnosis.document import Diagnosis


def as_calibration(diagnosis: Diagnosis) -> xr.Dataset:
    """What `imuarray.report.pictures` draws of a calibration: positions, its course in time."""
    found = diagnosis.extended.robust
    readings = found.recorded[0].readings
    array, labels = readings.array, list(readings.labels)
    place = np.full(found.active.shape, -1)
    place[found.active] = found.places[0]
    mine = place[: array.accelerometers, found.columns.of(POSITION)].ravel()
    covariance = np.zeros((len(mine),) * 2)
    free = np.flatnonzero(mine >= 0)
    covariance[np.ix_(free, free)] = widths(found)[0][np.ix_(mine[free], mine[free])]
    time = readings.time + readings.origin
    variables, coordinates = course(found, time)
    variables["angular_rate"] = ("time", "axis"), found.recorded[0].state.motion[:, :3]
    own, other = ("accelerometer", "axis"), ("accelerometer_other", "axis_other")
    shape = (array.accelerometers, 3) * 2
    variables |= {
        "position": (own, found.positions),
        "nominal_position": (own, array.positions - array.positions[0]),
        "position_covariance": ((*own, *other), covariance.reshape(shape)),
    }
    coordinates |= {
        "accelerometer": labels[: array.accelerometers], "gyroscope": labels[: array.gyroscopes],
        "axis": list("xyz"), "time": time,
    }  # fmt: skip
    return xr.Dataset(variables, coordinates)


def drawn_alike(diagnosis: Diagnosis, footer) -> list[Drawing]:
    """The board, the recording and the residual in time, as `imuarray board` has them."""
    found, recording = as_calibration(diagnosis), diagnosis.recording
    residuals = [f"{kind}_residual" for kind in KINDS]
    parts = {
        "board": (
            3.1, [partial(pictures.board, found, plane) for plane in ("xy", "xz")],
            found[["nominal_position", "position"]].to_dataframe(),
        ),
        "timeline": (
            2.6, [partial(pictures.timeline, recording, found)], found["shaken"].to_dataframe(),
        ),
        "sphere": (
            3.4, [partial(pictures.sphere, recording, found)],
            found["angular_rate"].to_dataframe(),
        ),
        "course": (
            2.4, [partial(pictures.residual_course, found, kind) for kind in KINDS],
            pd.concat([found[name].to_dataframe() for name in residuals]),
        ),
    }  # fmt: skip
    more = {"sphere": f" {shown(recording, found)}"}
    return [
        Drawing(name, CAPTIONS[name][0], CAPTIONS[name][1] + more.get(name, ""),
                files(beside(height, drawings, footer), table.reset_index()))
        for name, (height, drawings, table) in parts.items()
    ]  # fmt: skip
