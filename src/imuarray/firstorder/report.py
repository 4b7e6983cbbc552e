"""A first-order calibration in tables and in a file: parameters with sds, residuals, noise."""

from itertools import product

import numpy as np
import pandas as pd
import xarray as xr
from scipy.spatial.transform import Rotation

from imuarray.firstorder.correct import FirstOrder, correct
from imuarray.firstorder.gyroscopes import Gyroscopes
from imuarray.firstorder.settings import SETTINGS
from imuarray.firstorder.still import allan_deviation
from imuarray.firstorder.turns import TURNED, angle_of, nearest_orthogonal, parts_of, parts_sd_of
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording, write_recording
from imuarray.recording.record import FIRST_ORDER, KINDS, NUMBERS

MISALIGNMENT = ("xy", "xz", "yz")
UNITS = {"scale": "1", "misalignment": "1", "orientation": "rad"}


def parameter_table(found: FirstOrder, recording: Recording) -> pd.DataFrame:
    """One row a parameter: sensor, triad, parameter, component, value, sd, unit."""
    maps, rows = found.gyroscopes, []
    known = {"accelerometer": (parts_of(found.triads.matrix), found.triads.parts_sd())}
    known["gyroscope"] = {}, {}
    if maps is not None:
        known["gyroscope"] = parts_of(maps.matrix), parts_sd_of(maps.matrix, maps.blocks)
    for kind, (parts, sds) in known.items():
        own, units = found.at_rest[kind], UNITS | {"offset": NUMBERS[f"{kind}_noise_sd"]}
        parts, sds = parts | {"offset": own.offset}, sds | {"offset": own.offset_sd}
        for (k, label), name in product(enumerate(getattr(recording, f"{kind}_labels")), parts):
            for i, component in enumerate(MISALIGNMENT if name == "misalignment" else "xyz"):
                value, sd = parts[name][k, i], sds[name][k, i]
                rows.append((kind, label, name, component, value, sd, units[name]))
    names = ["sensor", "triad", "parameter", "component", "value", "sd", "unit"]
    return pd.DataFrame(rows, columns=names)


def summary_lines(found: FirstOrder, recording: Recording) -> list[str]:
    """For a person: poses, residuals and offsets, turned IMUs, gyroscopes, noise."""
    lines = [
        f"{len(found.poses)} still poses, {found.still_samples} samples, gravity"
        f" {found.gravity:g} m/s^2",
        "triad  residual mm/s^2  poses left out  offset mm/s^2",
    ]
    rows = residual_table(found, recording).itertuples()
    for row, offset in zip(rows, found.triads.offset, strict=True):
        shown = ", ".join(f"{1e3 * value:.0f}" for value in offset)
        lines.append(f"{row.triad:>5}  {1e3 * row.residual_rms:15.2f}  {row.left_out:14d}  {shown}")
    ratios = noise_table(found, recording).groupby("sensor").ratio.median()
    lines += [
        f"recording {number} of those beside it left out: still in two orientations at most"
        for number in found.left_out
    ]
    lines += doubtful_lines(found, recording) + walk_lines(found, recording)
    lines += turned_lines(found, recording) + gyroscope_lines(found.gyroscopes, recording)
    return lines + [
        f"noise of {sensor}: {ratio:.2f} times the declared one (median over axes)"
        for sensor, ratio in ratios.items()
    ]


def walk_lines(found: FirstOrder, recording: Recording) -> list[str]:
    """For a person: how far offsets walk in a minute, where they do, and whose most."""
    root, shown = np.sqrt(60.0), []
    for kind, scale, unit in (
        ("accelerometer", 1e3, "mm/s^2"),
        ("gyroscope", np.degrees(1), "deg/s"),
    ):
        walks = scale * found.at_rest[kind].walk
        most, usual = int(np.argmax(walks)), root * np.median(walks)
        if root * walks[most] > SETTINGS.walk_apart * usual:
            label = getattr(recording, f"{kind}_labels")[most]
            own = f"{kind} {label} {root * walks[most]:.2g} {unit}"
            shown.append(f"{own} (as a rule {usual:.2g})")
        elif walks[most]:
            shown.append(f"{kind}s {usual:.2g} {unit}")
    return [f"offsets drift, in a minute by some: {', '.join(shown)}"] if shown else []


def doubtful_lines(found: FirstOrder, recording: Recording) -> list[str]:
    """For a person: poses that fit the others in no triad."""
    begins = [recording.time[pose.start] for pose in found.poses]
    poses = [f"{begins[p]:.4g} s" for p in np.flatnonzero(found.triads.doubtful > 1)]
    if not poses:
        return []
    return [f"poses that fit in no triad, as if not quite still, count little: {', '.join(poses)}"]


def gyroscope_lines(maps: Gyroscopes | None, recording: Recording) -> list[str]:
    """For a person: what was done with the gyroscopes, and how each was turned and scaled."""
    if maps is None:
        return ["gyroscopes: offsets only"]
    relative, common = maps.relative, maps.common
    if isinstance(relative, str):
        lines = [f"gyroscopes: not compared with each other: {relative}"]
    else:
        lines = [f"gyroscopes: compared with each other in {relative.samples} moving samples"]
    if isinstance(common, str):
        lines.append(f"gyroscopes: no map common to all: {common}")
    else:
        before, after = np.degrees([common.before, np.median(common.error)])
        lines.append(
            f"gyroscopes: {len(common.first)} moves carry gravity from pose to pose to"
            f" {after:.2g} degrees ({before:.2g} before); together they read"
            f" {100 * (1 / common.scale - 1):+.3f} +- {100 * common.scale_sd:.3f} % of the rate"
        )
        if not np.allclose(common.turn, np.eye(3)):
            axes = Rotation.from_matrix(common.turn).as_rotvec(degrees=True).round()
            lines.append(f"gyroscopes: all turned against the accelerometers by {axes} degrees")
    parts = parts_of(maps.matrix)
    scale, skew = 100 * (parts["scale"] - 1), 100 * parts["misalignment"]
    lines.append("triad  turned deg           scale %                misalignment %")
    rows = zip(np.degrees(parts["orientation"]), scale, skew, strict=True)
    for label, shown in zip(recording.gyroscope_labels, rows, strict=True):
        text = [", ".join(f"{value:+.2f}" for value in row) for row in shown]
        lines.append(f"{label:>5}  {text[0]:19}  {text[1]:21}  {text[2]}")
    return lines


def turned_lines(found: FirstOrder, recording: Recording) -> list[str]:
    """One line for each IMU or sensor whose axes are off those declared by more than a mount is."""
    against, labels = found.drawing_turn, recording.accelerometer_labels
    maps = found.maps if found.gyroscopes is not None else {"accelerometer": found.triads.matrix}
    angles = {
        (kind, label): float(angle)
        for kind, matrices in maps.items()
        for label, angle in zip(
            getattr(recording, f"{kind}_labels"),
            angle_of(nearest_orthogonal(matrices) @ against.T), strict=True,
        )
    }  # fmt: skip
    lines = [_turned_words(kind, k, angle, angles) for (kind, k), angle in angles.items()]
    lines = list(dict.fromkeys(filter(None, lines)))
    if angle_of(against) > TURNED:
        lines.append(f"the drawing was turned into the axes of IMU {labels[0]}")
    return lines


def _turned_words(kind: str, label: str, angle: float, angles: dict) -> str:
    """Empty where it is not; an IMU's where both of its sensors are turned alike."""
    if angle < TURNED:
        return ""
    other = "gyroscope" if kind == "accelerometer" else "accelerometer"
    beside, whose, end = angles.get((other, label)), f"{kind} {label}", ""
    if beside is not None and abs(beside - angle) < TURNED:
        whose, angle = f"IMU {label}", angles["accelerometer", label]
    elif beside is not None and beside < TURNED:
        end = f" ({other} {label} is not)"
    return (
        f"{whose} is turned by {np.degrees(angle):.1f} degrees against its declared axes{end}:"
        " taken out; mend `axes` where they are declared"
    )


def residual_table(found: FirstOrder, recording: Recording) -> pd.DataFrame:
    """Residual of each accelerometer triad over the still poses, m/s^2."""
    fit = found.triads
    return pd.DataFrame({
        "triad": recording.accelerometer_labels, "poses": len(fit.used),
        "left_out": (~fit.relied).sum(axis=0), "residual_rms": fit.residual_rms,
        "residual_rms_all_poses": np.sqrt(np.mean(fit.residual**2, axis=(0, 2))),
    })  # fmt: skip


def _allan(poses, recording: Recording, kind: str):
    """Averaging times (S,) s, Allan deviations (S, K, 3) of the still poses and their sds."""
    step, readings = float(np.median(np.diff(recording.time))), getattr(recording, KINDS[kind])
    taus, deviation = allan_deviation([readings[pose] for pose in poses], step)
    lengths = np.array([[step * (pose.stop - pose.start)] for pose in poses])
    apart = np.sum(np.maximum(lengths / taus - 1, 0), axis=0)[:, None, None]
    return taus, deviation, deviation / np.sqrt(2 * apart)  # sds: IEEE Std 952, C.1


def axes_table(columns: dict, recording: Recording, kind: str, **first) -> pd.DataFrame:
    """``columns`` (..., K, 3) with rows of every axis of every triad, for each of ``first``."""
    labels = getattr(recording, f"{kind}_labels")
    levels = {"sensor": [KINDS[kind]], **first, "triad": labels, "axis": list("xyz")}
    rows = pd.MultiIndex.from_product(levels.values(), names=list(levels))
    flat = {name: values.ravel() for name, values in columns.items()}
    return pd.DataFrame(flat, rows).reset_index()


def noise_table(found: FirstOrder, recording: Recording) -> pd.DataFrame:
    """Noise of each axis in SI units, beside what the recording declared.

    ``sd`` of one reading and ``correlation`` of neighbours; ``allan_1s`` the Allan deviation at
    the averaging time nearest to 1 s; ``floor`` the smallest one and ``floor_tau`` (s) where.
    """
    parts = []
    for kind in KINDS:
        taus, deviation, _ = _allan(found.poses, recording, kind)
        declared = getattr(recording, f"{kind}_noise_sd")
        own = found.at_rest[kind]
        columns = {
            "declared": np.full_like(own.noise, declared), "sd": own.noise,
            "ratio": own.noise / declared, "correlation": own.correlation,
            "allan_1s": deviation[np.argmin(np.abs(taus - 1.0))],
            "floor": deviation.min(axis=0), "floor_tau": taus[deviation.argmin(axis=0)],
        }  # fmt: skip
        parts.append(axes_table(columns, recording, kind))
    return pd.concat(parts, ignore_index=True)


def allan_table(poses, recording: Recording) -> pd.DataFrame:
    """Allan deviations of still poses: sensor, tau_s, triad, axis, deviation, sd (SI units)."""
    parts = []
    for kind in KINDS:
        taus, deviation, sd = _allan(poses, recording, kind)
        columns = {"deviation": deviation, "sd": sd}
        parts.append(axes_table(columns, recording, kind, tau_s=taus))
    return pd.concat(parts, ignore_index=True)


def write_corrected(recording: Recording, found: FirstOrder, path) -> None:
    """The corrected recording, with the calibration's numbers in a group of its own."""
    data = digest(recording.specific_force, recording.angular_rate)
    attrs = stamp({"recording": data, "gravity": found.gravity}, 0)
    groups = {FIRST_ORDER: _first_order_dataset(recording, found)}
    write_recording(correct(recording, found), path, attrs=attrs, groups=groups)


def _first_order_dataset(recording: Recording, found) -> xr.Dataset:
    """Matrix, offset and their covariance, poses, residuals, noise."""
    fit, (forces, rates) = found.triads, found.at_rest.values()
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
        "accelerometer_noise": (accelerometer, forces.noise, {"units": "m s-2"}),
        "gyroscope_offset": (gyroscope, rates.offset, {"units": "rad s-1"}),
        "gyroscope_offset_sd": (gyroscope, rates.offset_sd, {"units": "rad s-1"}),
        "accelerometer_walk": (("accelerometer",), fit.walk, {"units": "m s-2 s-0.5"}),
        "gyroscope_walk": (("gyroscope",), rates.walk, {"units": "rad s-1 s-0.5"}),
        "gyroscope_noise": (gyroscope, rates.noise, {"units": "rad s-1"}),
        "accelerometer_smoothing": (accelerometer, forces.smoothing, {"units": "1"}),
        "gyroscope_smoothing": (gyroscope, rates.smoothing, {"units": "1"}),
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
