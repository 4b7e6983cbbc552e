"""The page of `imuarray board`: how good, to be trusted or not and why, and what to do next."""

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.engine.directions import position_sds, weakest_of
from imuarray.firstorder.correct import FirstOrder
from imuarray.firstorder.report import parameter_table, turned_lines, write_corrected
from imuarray.model.effects import KINDS
from imuarray.pictures.board import SURE, levelled, missing
from imuarray.provenance import atomic_folder, trust, write_bytes, write_csv, write_netcdf
from imuarray.recording import Recording, write_recording
from imuarray.report.page import PICTURES, pictured, rendered
from imuarray.words import (
    DEGREE,
    first_up,
    lags_apart,
    meaning,
    number,
    plus_minus,
    quantity,
    sentences,
)

SLOW = np.radians(300.0)  # rad/s rms, of motion that says little of positions
MISFIT = 1.5  # times the noise: a residual that is looked into
SHAKEN = 1.2  # times the smooth samples' residual: that of all is clearly above
NOTHING = " Nothing speaks against them."


def verdict(board: "Board") -> str:
    """The quality of the positions, in a sentence."""
    sds = position_sds(board.calibration)[1:]
    rms, worst = (size_in_words(size) for size in (np.sqrt(np.mean(sds**2)), sds.max()))
    count = board.calibration.sizes["accelerometer"]
    good = "The positions" if not board.reasons else "If the answer could be trusted: positions"
    verb = "are known" if not board.reasons else "known"
    doubted = board.reasons or misfit(board.calibration) > MISFIT or turned(board)
    return (
        f"{good} of {count} IMUs {verb} to {rms} (rms of the standard deviations; the worst"
        f" coordinate {worst})." + ("" if doubted else NOTHING)
    )


def turned(board: "Board") -> list[str]:
    """Sensors whose axes are not those declared."""
    if isinstance(board.first_order, str):
        return []
    return [f"{first_up(line)}." for line in turned_lines(board.first_order, board.recording)]


def frame(calibration: xr.Dataset) -> str:
    """Words on the axes of the positions, and what taking the board's edges for them would cost."""
    far = float(np.linalg.norm(calibration["position"].to_numpy(), axis=1).max())
    first = calibration["accelerometer"].to_numpy()[0]
    return (
        f"The axes are those of IMU {first}'s accelerometer (its z, then the plane of its y and z),"
        f" not the board's edges: 0.1 degrees between them moves the IMU that is"
        f" {size_in_words(far)} away by {size_in_words(far * np.radians(0.1))}."
    )


def size_in_words(size: float) -> str:
    """A length (m) to two digits."""
    return quantity(float(f"{size:.2g}"), None, "m")


def facts(board: "Board") -> str:
    """The log in a line."""
    time, calibration = board.recording.time, board.calibration
    rate, count = 1 / np.median(np.diff(time)), len(board.recording.accelerometer_labels)
    found = board.first_order
    still, noise, where = "", "declared noise", ""
    if not isinstance(found, str):  # whose noise the corrected recording declares
        still, noise = f" {len(found.poses)} still poses;", "noise of the still poses"
    size, whole = misfit(calibration), float(calibration.attrs["residual_ratio"])
    if whole >= SHAKEN * size:
        where = (
            f" where the motion is smooth ({number(whole)} times over all: shocks are faster than"
            " the samples)"
        )
    return (
        f"{len(time)} samples of {count} IMUs at {rate:.4g} Hz, {time[-1] - time[0]:.1f} s;"
        f"{still} positions from {calibration.attrs['samples']} moving samples, whose"
        f" residual is {size:.2f} times the {noise}{where}."
    )


def misfit(calibration: xr.Dataset) -> float:
    """Residual over the declared noise, where motion is rough that of smooth samples."""
    if "gyroscope_smooth_residual" not in calibration:
        return float(calibration.attrs["residual_ratio"])
    return max(float(np.median(calibration[f"{kind}_smooth_residual"])) for kind in KINDS)


def advice(board: "Board", folder: Path = Path()) -> list[str]:
    """Advice, the most urgent first; ``folder``: where the files are.

    The motion of an answer that is not to be trusted is no ground for advice.
    """
    corrected, found = folder / "recording.nc", folder / "cal.nc"
    said = [f"Mend this first: {reason}" for reason in board.reasons[:1]]
    if isinstance(board.first_order, str):
        said.append(
            "Record again with still poses: a dozen or more directions, ten seconds each, the"
            " logger on while the board is turned from one to the next, then a minute of hard"
            " twisting. Without them offsets, scales and axes of the sensors are taken as read."
        )
    if board.reasons or misfit(board.calibration) > MISFIT:
        said.append(
            "Check units, signs, which IMU is which and the drawing in columns.yaml; then let"
            f" `imuarray diagnose {corrected} --out diagnosis` name what the model misses."
        )
    if board.reasons:
        return said
    return [
        *said,
        *_wanting(board),
        f"Use it: `imuarray apply {found} {corrected} --out motion.nc` makes one sensor of the"
        f" array, `imuarray export {found} --format kalibr --out imu.yaml` a file for other tools.",
        "Record a second time and calibrate both (`imuarray calibrate`): what two recordings"
        " agree on is what can be relied on.",
    ]


def _wanting(board: "Board") -> Iterator[str]:
    """Words on what a better recording would have, by the motion that was found."""
    calibration = board.calibration
    gyroscopes = None if isinstance(board.first_order, str) else board.first_order.gyroscopes
    if gyroscopes and isinstance(gyroscopes.common, str):
        yield (
            "Leave the logger on while the board is turned from pose to pose: the size of the"
            " array is as uncertain as the gyroscopes' scale, which is not known"
            f" ({gyroscopes.common})."
        )
    yield from (f"Record what is missing: {x}." for x in missing(board.corrected, calibration))
    speed = np.sqrt(np.mean(np.sum(calibration["angular_rate"].to_numpy() ** 2, axis=1)))
    if speed < SLOW:
        yield (
            f"Twist it harder: {np.degrees(speed):.0f} deg/s (rms) is slow, aim for"
            f" {np.degrees(SLOW):.0f}; what is said of the positions grows with the square of the"
            " angular rate."
        )
    worst = weakest_of(calibration)[0]
    if worst.sd > board.corrected.position_prior_sd:
        yield f"Turn the board faster, and about all axes: {worst.words} is hardly known."
    if levelled(calibration):
        yield (
            "More motion of this kind gains little: what first order leaves of the sensors' scales"
            " limits the positions. More still poses, and moves between them, would help."
        )


def weakest(calibration: xr.Dataset) -> str:
    """The direction known worst, in words."""
    worst = weakest_of(calibration)[0]
    return f"{worst.words}, to {size_in_words(worst.sd)}"


def causes(calibration: xr.Dataset) -> list[str]:
    """Words on what the sensors do beside measuring, from the calibration's own parameters."""
    labels = [str(k) for k in calibration["accelerometer"].to_numpy()]
    found: dict[str, dict] = {}
    if "effect_parameter" in calibration:
        columns = (
            calibration[n].to_numpy() for n in ("parameter", "effect_parameter", "effect_sd")
        )
        for name, value, sd in zip(*columns, strict=True):
            effect, part, _ = str(name).split(" ", 2)
            found.setdefault(effect, {})[part] = value, sd
    found, said = lags_apart(found, labels)
    for effect, values in found.items():
        said += sentences(effect, values, labels) or meaning(effect)
    return [f"{first_up(line)}." for line in said]


def before(board: "Board") -> Iterator[str]:
    """Words on what first order found."""
    if isinstance(board.first_order, str):
        yield f"First order was left out: {board.first_order}."
        return
    found, gyroscopes = board.first_order, board.first_order.gyroscopes
    worst = 1e3 * float(np.max(found.triads.residual_rms))
    yield (
        f"{len(found.poses)} still poses show gravity to {number(worst, 2)} mm/s² at the worst"
        " accelerometer; a few mm/s² is what good poses leave. Gravity is taken as"
        f" {found.gravity:.6g} m/s²: 0.1 % off, it makes the array 0.1 % off."
    )
    yield from turned(board)
    if gyroscopes is not None and not isinstance(gyroscopes.common, str):
        common = gyroscopes.common
        before_, after = (
            number(np.degrees(x), 2) for x in (common.before, np.median(common.error))
        )
        scale = 1 / common.scale - 1
        error = plus_minus(100 * abs(scale), 100 * common.scale_sd)
        yield (
            f"{len(common.first)} moves carry gravity from pose to pose to {after} degrees"
            f" ({before_} before the gyroscopes were calibrated); together the gyroscopes read"
            f" {error} % too {'much' if scale > 0 else 'little'}."
        )


class Board(NamedTuple):
    """All that was found of a log: what the page shows.

    ``account``: what became of the logs; ``first_order``: or why there is none; ``corrected``: the
    recording that was calibrated; ``reasons``: why the answer is not to be trusted.
    """

    source: str
    account: list[str]
    recording: Recording
    first_order: FirstOrder | str
    corrected: Recording
    calibration: xr.Dataset
    reasons: list[str]


def write_board(board: Board, folder: Path) -> None:
    """recording.nc, cal.nc, positions.csv and, last, report.html: all of them or none."""
    page = html(board).encode()
    with atomic_folder(folder, last="report.html") as made, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a recording that was warned of when it was read
        if isinstance(board.first_order, str):
            write_recording(board.corrected, made / "recording.nc")
        else:
            write_corrected(board.recording, board.first_order, made / "recording.nc")
        write_netcdf(board.calibration.assign_attrs(trust(board.reasons)), made / "cal.nc")
        write_csv(position_table(board.calibration), made / "positions.csv")
        write_bytes(page, made / "report.html")


def html(board: Board) -> str:
    """report.html, every text escaped."""
    left_out, found = isinstance(board.first_order, str), board.calibration
    account = [
        f"{line.replace('+-', '±').replace('^2', '²').replace(' -', ' −')}."
        for line in board.account
    ]
    return rendered(
        "board.html.j2", board=board, sure=SURE, degree=DEGREE, account=account,
        figures=pictured(board.corrected, found, PICTURES, suffixes=["png"]),
        first_order=None if left_out else parameter_table(board.first_order, board.recording),
        **{part.__name__: part(board) for part in (verdict, facts, advice, before, noises)},
        **{part.__name__: part(found) for part in (causes, position_table, weakest, frame)},
    )  # fmt: skip


def position_table(calibration: xr.Dataset) -> pd.DataFrame:
    """imu, then x, y, z in m: the position, its sd, the nominal one; relative to the first IMU."""
    parts = {
        "": calibration["position"].to_numpy(), "sd_": position_sds(calibration),
        "nominal_": calibration["nominal_position"].to_numpy(),
    }  # fmt: skip
    columns = {
        f"{name}{axis}_m": values[:, number]
        for name, values in parts.items() for number, axis in enumerate("xyz")
    }  # fmt: skip
    return pd.DataFrame({"imu": calibration["accelerometer"].to_numpy()} | columns)


def noises(board: Board) -> pd.DataFrame:
    """sensor, imu: sd of a reading as declared and as the calibration finds it; in its unit.

    Of logs brought together, as declared for each and carried to the common instants.
    """
    rows, own = [], board.recording.alignment
    for which, (kind, unit) in enumerate(zip(KINDS, ("m s-2", "rad s-1"), strict=True)):
        found = np.sqrt(np.mean(board.calibration[f"{kind}_sd"].to_numpy() ** 2, axis=1))
        same = np.full(len(found), getattr(board.recording, f"{kind}_noise_sd"))
        declared = same if own is None else own["interpolated_noise"].to_numpy()[:, which]
        labels = map(str, board.calibration[kind].to_numpy())
        rows += zip([kind] * len(found), labels, declared, found, [unit] * len(found), strict=True)
    return pd.DataFrame(rows, columns=["sensor", "imu", "declared", "found", "unit"])
