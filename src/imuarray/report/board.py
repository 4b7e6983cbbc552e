"""The page of `imuarray board`: how good, to be trusted or not and why, and what to do next."""

from __future__ import annotations

import warnings
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.estimation.informative import position_sds
from imuarray.firstorder.correct import FirstOrder
from imuarray.firstorder.report import parameter_table, write_corrected
from imuarray.model.effects import KINDS
from imuarray.provenance import atomic_folder, trust, write_bytes, write_csv, write_netcdf
from imuarray.recording import Recording, write_recording
from imuarray.report import pictures as pictured
from imuarray.report.page import CAPTIONS, Drawing, beside, rendered, saved
from imuarray.report.pictures import shown

SURE = 1.96  # sds: 95 %


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
    return rendered(
        "board.html.j2", board=board, verdict=verdict(board), facts=facts(board),
        advice=advice(board), causes=causes(board.calibration),
        turned=turn_table(board), positions=position_table(board.calibration), sure=SURE,
        prior=board.corrected.position_prior_sd, noise=noises(board), figures=draw(board),
        weakest=weakest(board.calibration), frame=frame(board.calibration),
        before=before(board), account=account(board),
        first_order=None if isinstance(board.first_order, str)
        else parameter_table(board.first_order, board.recording),
    )  # fmt: skip


def draw(board: Board) -> list[Drawing]:
    """The page's pictures in their order."""
    found, corrected = board.calibration, board.corrected
    pictures = (
        ("board", 3.1, [partial(pictured.board, found, plane) for plane in ("xy", "xz")], ""),
        ("timeline", 2.6, [partial(pictured.timeline, corrected, found)], ""),
        ("sphere", 3.4, [partial(pictured.sphere, corrected, found)], shown(corrected, found)),
        ("length", 2.5, [partial(pictured.length, found)], ""),
        ("course", 2.4, [partial(pictured.residual_course, found, kind) for kind in KINDS], ""),
    )
    return [
        Drawing(name, CAPTIONS[name][0], f"{CAPTIONS[name][1]} {more}",
                {"png": saved(beside(height, parts))})
        for name, height, parts, more in pictures
    ]  # fmt: skip


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


def turn_table(board: Board) -> pd.DataFrame | None:
    """How each triad is turned against the frame, deg: sensor, imu, x, y, z, sd_x, sd_y, sd_z."""
    if isinstance(board.first_order, str):
        return None
    table = parameter_table(board.first_order, board.recording)
    table = table[table.parameter == "orientation"]
    wide = table.pivot(index=["sensor", "triad"], columns="component", values=["value", "sd"])
    wide = np.degrees(wide.astype(float)).reindex(
        table[["sensor", "triad"]].drop_duplicates().itertuples(index=False, name=None)
    )
    wide.columns = [axis if kind == "value" else f"sd_{axis}" for kind, axis in wide.columns]
    return wide.rename_axis(["sensor", "imu"]).reset_index()


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
