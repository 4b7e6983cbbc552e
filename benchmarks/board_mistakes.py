"""Logs that are wrong, each in one way, and what README's commands say of them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.board import GRAVITY, Options, draw_board, write
from benchmarks.boards import LINES, run

DEGREE = np.pi / 180

# What is different in the board itself.
BOARDS: dict[str, dict] = {
    "nothing": {},
    "one gyroscope axis of the wrong sign": {"flipped": 1},
    "an IMU one sample late": {"late": 0.005},
    "an IMU at 37 degrees": {"turned": 37.0},
    "an IMU at 90 degrees": {"turned": 90.0},
    "poses of 3 s": {"still": 3.0},
    "two IMUs": {"imus": 2},
}


def _scaled(kind: str, factor: float, range_too: bool = True):
    def change(table, columns):
        columns[kind]["scale"] *= factor
        if range_too:
            columns[kind]["range"] *= factor

    return change


def _without_position_unit(table, columns):
    del columns["position_unit"]


def _in_g_declared_metres(table, columns):
    _scaled("accelerometers", 1 / GRAVITY)(table, columns)


def _every_other_blank(table, columns):
    of_last = [name for name in table.columns if name.endswith(str(len(_triads(columns))))]
    table[of_last] = table[of_last].astype(float)
    table.loc[1::2, of_last] = np.nan


def _triads(columns) -> dict:
    return columns["accelerometers"]["triads"]


def _exchanged(table, columns):
    """The drawing's IMUs 2 and 3."""
    second, third = (_triads(columns)[label] for label in ("2", "3"))
    second["position"], third["position"] = third["position"], second["position"]


def _negated(letters: str):
    def change(table, columns):
        names = [name for name in table.columns if name[:2] in letters.split()]
        table[names] *= -1

    return change


def _given_twice(table, columns):
    for kind in ("accelerometers", "gyroscopes"):
        triads = columns[kind]["triads"]
        triads["3"] = triads["3"] | {"columns": list(triads["2"]["columns"])}


def _constant(table, columns):
    table["gx2"] = 0


def _doubled(table, columns):
    again = table.assign(t=table["t"] + table["t"].iloc[-1] + 0.005)
    return pd.concat([table, again], ignore_index=True)


# What is different in the log or its description, changed in place or given back.
LOGS: dict[str, Callable] = {
    "gyroscopes in rad/s declared deg/s": _scaled("gyroscopes", DEGREE, False),
    "gyroscopes in deg/s declared rad/s": _scaled("gyroscopes", 1 / DEGREE),
    "gyroscopes 2.4 % too large": _scaled("gyroscopes", 1.024),
    "accelerometers in g declared m/s^2": _in_g_declared_metres,
    "position_unit forgotten": _without_position_unit,
    "an IMU at half the rate": _every_other_blank,
    "two IMUs exchanged": _exchanged,
    "specific force of the wrong sign": _negated("ax ay az"),
    "z of both sensors flipped": _negated("az gz"),
    "one IMU's columns given twice": _given_twice,
    "a constant channel": _constant,
    "the log twice": _doubled,
}


def try_all(seed: int, options: Options, commands, keep: Path | None) -> None:
    """Print, for each mistake, every command's status and its last line."""
    for name, different in BOARDS.items():
        board = draw_board(seed, replace(options, **different))
        _try(name, board.table(), board.columns(), commands, keep)
    board = draw_board(seed, options)
    for name, change in LOGS.items():
        table, columns = board.table(), board.columns()
        changed = change(table, columns)
        _try(name, table if changed is None else changed, columns, commands, keep)


def _try(name: str, table, columns, commands, keep: Path | None) -> None:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) if keep is None else keep / name.replace(" ", "_").replace("/", "")
        write(table, columns, folder)
        said = []
        for command in commands:
            status, last = run(LINES[command], folder)
            said.append(f"{command} {status}")
            if status not in (0, 3):
                break
    print(f"{name}: {', '.join(said)}: {last}", flush=True)
