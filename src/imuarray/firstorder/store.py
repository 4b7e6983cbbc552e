"""A first-order calibration in a file: the corrected recording with the numbers in a group."""

import numpy as np
import xarray as xr

from imuarray.firstorder.correct import FirstOrder, correct
from imuarray.firstorder.gyroscopes import Gyroscopes
from imuarray.firstorder.turns import nearest_orthogonal
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording, write_recording
from imuarray.recording.record import FIRST_ORDER


def write_corrected(recording: Recording, found: FirstOrder, path) -> None:
    """The corrected recording, with the calibration's numbers in a group of its own."""
    data = digest(recording.specific_force, recording.angular_rate)
    attrs = stamp({"recording": data, "gravity": found.gravity}, 0)
    groups = {FIRST_ORDER: _first_order_dataset(recording, found)}
    write_recording(correct(recording, found), path, attrs=attrs, groups=groups)


def _first_order_dataset(recording: Recording, found) -> xr.Dataset:
    """Matrix, offset and their covariance, poses, residuals, noise."""
    fit = found.triads
    accelerometer, gyroscope = ("accelerometer", "axis"), ("gyroscope", "axis")
    times = recording.time
    limits = [(times[pose.start], times[pose.stop - 1]) for pose in found.poses]
    variables = {
        "matrix": (("accelerometer", "axis", "axis_other"), fit.matrix, {"units": "1"}),
        "offset": (accelerometer, fit.offset, {"units": "m s-2"}),
        "covariance": (
            ("parameter", "parameter_other"), fit.covariance,
            {"long_name": "of (matrix row by row, offset), triad by triad"},
        ),
        "residual": (("pose", "accelerometer", "axis"), fit.residual, {"units": "m s-2"}),
        "used": (("pose", "accelerometer"), fit.relied),
        "pose_time": (("pose", "edge"), np.array(limits), {"units": "s"}),
        "accelerometer_noise": (accelerometer, found.accelerometer_noise, {"units": "m s-2"}),
        "gyroscope_offset": (gyroscope, found.gyroscope_offset, {"units": "rad s-1"}),
        "gyroscope_offset_sd": (gyroscope, found.gyroscope_offset_sd, {"units": "rad s-1"}),
        "accelerometer_walk": (("accelerometer",), fit.walk, {"units": "m s-2 s-0.5"}),
        "gyroscope_walk": (("gyroscope",), found.gyroscope_walk, {"units": "rad s-1 s-0.5"}),
        "gyroscope_noise": (gyroscope, found.gyroscope_noise, {"units": "rad s-1"}),
    }  # fmt: skip
    coords = {
        "accelerometer": list(recording.accelerometer_labels),
        "gyroscope": list(recording.gyroscope_labels), "axis": list("xyz"),
        "axis_other": list("xyz"),
    }  # fmt: skip
    attrs = {"gravity": found.gravity, "residual_ratio": fit.residual_ratio}
    if found.gyroscopes is not None:
        more, told = _gyroscopes(found.gyroscopes, np.array(limits))
        variables |= more
        attrs |= told
    return xr.Dataset(variables, coords, attrs)


def _gyroscopes(maps: Gyroscopes, limits) -> tuple[dict, dict]:
    """Variables and attributes: maps of all and common, the moves; why one of them is not there."""
    square, rows = ("gyroscope", "axis", "axis_other"), {"long_name": "of a matrix row by row"}
    variables = {
        "gyroscope_matrix": (square, maps.matrix, {"units": "1"}),
        "gyroscope_covariance": (("gyroscope", "entry", "entry_other"), maps.blocks, rows),
        "gyroscope_turn": (square, nearest_orthogonal(maps.matrix), {"units": "1"}),
    }
    attrs = {}
    if isinstance(maps.relative, str):
        attrs["gyroscope_relative"] = maps.relative
    else:
        own = maps.relative
        variables |= {
            "gyroscope_relative": (square, own.map, {"units": "1"}),
            "gyroscope_relative_covariance": (
                ("gyroscope", "entry", "entry_other"), own.covariance, rows,
            ),
        }  # fmt: skip
    if isinstance(maps.common, str):
        attrs["gyroscope_common"] = maps.common
    else:
        common = maps.common
        times = np.stack([limits[common.first, 1], limits[common.first + 1, 0]], axis=1)
        variables |= {
            "gyroscope_common": (("axis", "axis_other"), common.map, {"units": "1"}),
            "gyroscope_common_covariance": (("entry", "entry_other"), common.covariance, rows),
            "move_time": (("move", "edge"), times, {"units": "s"}),
            "move_error": ("move", common.error, {"units": "rad"}),
            "move_weight": ("move", common.weight, {"units": "1"}),
        }
        attrs["gyroscope_common_scale_sd"] = common.scale_sd
    return variables, attrs
