"""Files of other tools, made of the document that `imuarray.analysis.export` describes."""

import re
from json import dumps
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import xarray as xr
from scipy.spatial.transform import Rotation

from imuarray.engine.directions import position_sds
from imuarray.errors import printable
from imuarray.firstorder.turns import nearest_orthogonal, upper_times_rotation
from imuarray.model.effects import KINDS
from imuarray.recording.record import by_kind

KALIBR = """\
T_i_b: p_i = T_i_b p_b, from the frame b of imu0 to that of imu i (m); IMU i is at -C' t in b, with
  C and t the rotation and the translation of T_i_b. A frame has x along its accelerometer's x axis,
  y in the plane of its x and y axes.
time_offset: a reading stamped t is of the time t + time_offset of imu0's clock (s); gyroscopes have
  their own beside it, where their filters lag: kalibr has one for both, the accelerometers'.
accelerometers: what the chip reads is M C u + bias, u the specific force at it in b (m/s^2), so
  corrected, in the axes of IMU i: M^-1 (reading - bias).
gyroscopes: M C_gyro_i C w + A C_gyro_i C u + bias, w the angular rate in b (rad/s), so corrected,
  in the axes of IMU i: C_gyro_i' M^-1 (reading - bias). A is not estimated.
bias: as in the recording that was calibrated; it is another after each start. kalibr has none.
noise: continuous, rms over the axes: the sd of one reading is noise_density * sqrt(update_rate).
A comment behind a number is its standard deviation."""


def left_of(calibration: xr.Dataset) -> dict[str, np.ndarray]:
    """Covariances by kind of the maps that first order has left."""
    left = calibration.get("map_covariance")
    return by_kind(None if left is None else left.to_numpy(), calibration.sizes["accelerometer"])


def frames_of(calibration: xr.Dataset, steps: dict, positions) -> list[dict]:
    """Place and turn of each IMU, and the readings of its chips, in their own axes."""
    sensed = {kind: _sensed(steps[kind], calibration.sizes[kind]) for kind in KINDS}
    chips = calibration.get("accelerometer_axes")
    axes = np.tile(np.eye(3), (len(positions), 1, 1)) if chips is None else chips.to_numpy()
    if steps[KINDS[0]] and steps[KINDS[0]][0]["from"] == "first-order":
        axes = nearest_orthogonal(np.linalg.inv(steps[KINDS[0]][0]["inverse"])) @ axes
    axes = np.where(np.abs(axes - np.round(axes)) < 1e-9, np.round(axes), axes) + 0.0
    matrices = np.swapaxes(axes, 1, 2) @ sensed[KINDS[0]][0]
    turns = np.array([upper_times_rotation(matrix)[1] for matrix in matrices])
    lower = [lower_times_rotation(matrix) for matrix in matrices]
    own, others = turn_sds(calibration, turns, np.array([turn for _, turn in lower]))
    sds = position_sds(calibration)
    frames: list[dict] = []
    for k, (scale, turn) in enumerate(lower):
        to = np.eye(4)
        if k:
            to[:3, :3], to[:3, 3] = turn @ lower[0][1].T, turn @ (positions[0] - positions[k])
        kalibr: dict[str, Any] = {"T_i_b": to, "T_i_b_turn_sd_rad": others[k]}
        kalibr[KINDS[0]] = {"M": scale, "bias": axes[k].T @ sensed[KINDS[0]][1][k]}
        if k < calibration.sizes[KINDS[1]]:
            matrix, bias = (part[k] for part in sensed[KINDS[1]])
            scale, whole = lower_times_rotation(axes[k].T @ matrix)
            kalibr[KINDS[1]] = {"M": scale, "C_gyro_i": whole @ turn.T, "bias": axes[k].T @ bias}
        frames.append({
            "position_m": positions[k], "position_sd_m": sds[k], "rotation": turns[k],
            "rotation_sd_rad": own[k], "axes": axes[k], "kalibr": kalibr,
        })  # fmt: skip
    return frames


def _sensed(steps: list[dict], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Reading = matrix (n, 3, 3) @ truth + bias (n, 3), of all corrections together."""
    matrix, bias = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    for step in reversed(steps):
        own = np.linalg.inv(step["inverse"])
        matrix, bias = own @ matrix, (own @ bias[..., None])[..., 0] + step["offset"]
    return matrix, bias


def lower_times_rotation(matrix) -> tuple[np.ndarray, np.ndarray]:
    """matrix (3, 3) = L R: L lower triangular, R a rotation."""
    upper, turn = upper_times_rotation(matrix[::-1, ::-1])
    return upper[::-1, ::-1] + 0.0, turn[::-1, ::-1] + 0.0


def turn_sds(calibration: xr.Dataset, turns, others) -> tuple[np.ndarray, np.ndarray]:
    """Sds (A, 3) of turns about the IMUs' axes, and of ``others`` against the first's of these.

    From the maps 1 + d that first order has left: of U R (1 + d) what is beneath the diagonal of
    R d R' turns R, of L R (1 + d) what is above.
    """
    left = left_of(calibration).get("accelerometer")
    if left is None:
        return (np.full((len(turns), 3), np.nan),) * 2
    own = _slopes(turns, [7, 6, 3], [1, -1, 1])
    relative = _slopes(others, [5, 2, 1], [-1, 1, -1])
    relative -= np.einsum("kij,jlm->kilm", others @ others[0].T, relative[0])
    rows = (slopes.reshape(-1, len(left)) for slopes in (own, relative))
    variances = (np.einsum("ri,ij,rj->r", part, left, part).reshape(-1, 3) for part in rows)
    first, second = (np.sqrt(np.maximum(part, 0.0)) for part in variances)
    return first, second


def _slopes(turns, place, sign) -> np.ndarray:
    """(A, 3, A, 9) of the ``turns`` to the IMUs' own maps, by entries of R d R' and their signs."""
    slopes = np.zeros((len(turns), 3, len(turns), 9))
    for k, turn in enumerate(turns):
        slopes[k, :, k] = np.array(sign)[:, None] * np.kron(turn, turn)[place]
    return slopes


def json(document: dict[str, Any]) -> str:
    """Everything."""
    return dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def csv(document: dict[str, Any]) -> str:
    """A row for each IMU: place, turn (rotation vector, array to IMU) and times, with sds."""
    rows = []
    for imu in document["imus"]:
        row = {"imu": imu["label"]}
        turn = Rotation.from_matrix(imu["rotation"]).as_rotvec().tolist()
        for name, unit, values, sds in (
            ("", "m", imu["position_m"], imu["position_sd_m"]),
            ("turn_", "rad", turn, imu["rotation_sd_rad"]),
        ):
            row |= {f"{name}{axis}_{unit}": x for axis, x in zip("xyz", values, strict=True)}
            row |= {f"{name}{axis}_sd_{unit}": x for axis, x in zip("xyz", sds, strict=True)}
        for kind in ("accelerometer", "gyroscope"):
            for name in ("time_offset_s", "time_offset_sd_s"):
                row[f"{kind}_{name}"] = imu.get(kind, {}).get(name)
        reasons = "; ".join(document["reasons"])
        rows.append(row | {"trusted": document["trusted"], "reasons": reasons})
    return pd.DataFrame(rows).to_csv(index=False, lineterminator="\n")


def urdf(document: dict[str, Any]) -> str:
    """A link for the array's frame, a link and a fixed joint for each IMU."""
    robot = ElementTree.Element("robot", name="imuarray")
    for line in _heads(document):
        robot.append(ElementTree.Comment(f" {line.replace('--', '- -')} "))
    ElementTree.SubElement(robot, "link", name="imuarray")
    names = _link_names([imu["label"] for imu in document["imus"]])
    for name, imu in zip(names, document["imus"], strict=True):
        sds = ", ".join(f"{1e6 * sd:.3g}" for sd in imu["position_sd_m"])
        ElementTree.SubElement(robot, "link", name=name)
        robot.append(ElementTree.Comment(f" {name}: sd {sds} um "))
        joint = ElementTree.SubElement(robot, "joint", name=f"{name}_joint", type="fixed")
        ElementTree.SubElement(joint, "parent", link="imuarray")
        ElementTree.SubElement(joint, "child", link=name)
        turn = Rotation.from_matrix(np.array(imu["rotation"]).T)
        rpy = turn.as_euler("xyz", suppress_warnings=True)  # about the array's fixed x, y, z
        ElementTree.SubElement(joint, "origin", xyz=_row(imu["position_m"]), rpy=_row(rpy))
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def _link_names(labels: list[str]) -> list[str]:
    """A link's name for each IMU: letters, digits and underscores, no two alike."""
    names = ["imuarray"]
    for label in labels:
        name = re.sub(r"\W+", "_", label, flags=re.ASCII).strip("_")
        name = name if name.lower().startswith("imu") else f"imu_{name}"
        names.append(f"{name}_{len(names)}" if name in names else name)
    return names[1:]


def kalibr(document: dict[str, Any]) -> str:
    """Kalibr's imu.yaml of several IMUs, model scale-misalignment."""
    lines = [f"# {line}" for line in (*_heads(document), *KALIBR.splitlines())]
    for number, imu in enumerate(document["imus"]):
        label, force, own = printable(imu["label"]), imu["accelerometer"], imu["kalibr"]
        lines += [f"imu{number}: # {label}", "  model: scale-misalignment"]
        lines += _matrix("  T_i_b", own["T_i_b"])
        turn, place = _sds(own["T_i_b_turn_sd_rad"]), _sds(imu["position_sd_m"])
        lines[-1] += f" # C: {turn} rad; place: {place} m"
        lines += [_scalar("  time_offset", force["time_offset_s"], force["time_offset_sd_s"])]
        if imu["clock"]:
            drift, sd, at = (imu["clock"][name] for name in ("drift", "drift_sd", "at_s"))
            falls = f"it falls by {drift:.4g} (sd {sd:.2g}) a second"
            lines.append(f"  # that is at the stamp {at:.6f}; {falls}")
        lines += [_scalar("  update_rate", imu["rate_hz"] or document["rate_hz"])]
        topic = label if label.startswith("/") else f"/imu{number}"
        lines += [f"  rostopic: {dumps(topic)}"]
        for kind in ("accelerometer", "gyroscope"):
            if kind not in imu:
                continue
            for term in ("noise_density", "random_walk"):
                lines.append(_noise(f"  {kind}_{term}", imu[kind]["noise"].get(term)))
            lines += [f"  {kind}s:", *_matrix("    M", own[kind]["M"])]
            sds = [step["map_sd"] for step in imu[kind]["corrections"] if "map_sd" in step]
            lines[-1] += f" # sd of entries up to {np.max(sds):.2g}" if sds else ""
            if kind == "gyroscope":
                lines += _matrix("    A", np.zeros((3, 3)))
                lines += _matrix("    C_gyro_i", own[kind]["C_gyro_i"])
                times = imu[kind]["time_offset_s"], imu[kind]["time_offset_sd_s"]
                lines += [_scalar("    time_offset", *times)]
            lines.append(f"    bias: [{', '.join(map(_number, own[kind]['bias']))}]")
    return "\n".join(lines) + "\n"


def _heads(document: dict[str, Any]) -> list[str]:
    """Where a file comes from, and whether it is to be trusted."""
    heads = [f"made by {document['created_by']}"] if document["created_by"] else []
    heads += [f"NOT TO BE TRUSTED: {reason}" for reason in document["reasons"]]
    if document["not_in_matrices"]:
        names = ", ".join(document["not_in_matrices"])
        heads.append(f"the calibration has more than this file can hold: {names}")
    return [printable(line) for line in heads]


def _number(value) -> str:
    """A number as YAML 1.1 reads it back: an exponent wants a decimal point before it."""
    text = repr(float(value))
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _row(values) -> str:
    return " ".join(repr(float(value)) for value in values)


def _sds(values) -> str:
    return ", ".join("?" if value is None else f"{value:.2g}" for value in values)


def _matrix(name: str, rows) -> list[str]:
    indent = " " * (len(name) - len(name.lstrip()) + 2)
    text = (f"{indent}- [{', '.join(map(_number, row))}]" for row in np.asarray(rows))
    return [f"{name}:", *text]


def _scalar(name: str, value, sd=None) -> str:
    if value is None:
        return f"  # {name.strip()}: not known"
    return f"{name}: {_number(value)}" + ("" if sd is None else f" # {sd:.2g}")


def _noise(name: str, term: dict | None) -> str:
    """Rms over the axes that have a value."""
    values, sds, below = (
        np.array((term or {}).get(part, [None] * 3), float) for part in ("value", "sd", "below")
    )
    shown = np.isfinite(values)
    if shown.any():
        size = np.sqrt(np.mean(values[shown] ** 2))
        sd = np.sqrt(np.sum((values * sds)[shown] ** 2)) / (size * shown.sum())
        return _scalar(name, size, sd if np.isfinite(sd) else None)
    why = f"below {np.nanmax(below):.2g}" if np.isfinite(below).any() else "not estimated"
    return f"  # {name.strip()}: left open, {why}; kalibr wants a number: see docs/noise.md"
