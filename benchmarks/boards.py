"""README's commands on simulated small boards (`board`), beside the truth.

`python -m benchmarks.boards walk --boards 20` draws boards and runs convert, first-order and
calibrate on each, and further commands by `--commands`; `kinds` does so with boards of 2 to 16
IMUs, 50 Hz to 1 kHz, slow and fast; `mounts` at growing angles of the mounts, `mistakes`
(`board_mistakes`) on logs that are wrong. From the project's root.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import tempfile
import time
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
import xarray as xr  # noqa: E402

from benchmarks.board import GRAVITY, Board, Options, draw_board  # noqa: E402
from imuarray.cli import main as imuarray  # noqa: E402

SWITCHES = [(0.3, 0.0), (2.0, 0.0), (0.3, 37.0), (0.3, 90.0), (0.3, 180.0)]  # mounts, last IMU
LINES = {
    "convert": "convert csv log.csv --columns columns.yaml --out rec.nc",
    "first-order": f"first-order rec.nc --gravity {GRAVITY} --out corrected.nc",
    "select": "select corrected.nc --samples 500 --out subset.nc",
    "calibrate": "calibrate corrected.nc --out cal.nc",
    "subset": "calibrate subset.nc --out cal.nc",
    "sample": "sample subset.nc --out posterior.nc",
    "apply": "apply cal.nc corrected.nc --out motion.nc",
    "diagnose": "diagnose corrected.nc --out diagnosis",
}


def run(line: str, folder: Path) -> tuple[int, str]:
    """One command in a folder: its status, and the last line that it printed or complained."""
    text = io.StringIO()
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stdout(text),
        contextlib.redirect_stderr(text),
    ):
        status = imuarray(line.split())
    # a progress bar's states end in a carriage return
    said = text.getvalue().replace("\r", "\n").strip().splitlines()
    return status, said[-1] if said else ""


def grade(positions, sds, truth) -> dict[str, float]:
    """Error rms and claimed sd (um), error of the size (%), share within 1.96 sds; IMU 1 apart."""
    error, sds = (positions - positions[0] - truth)[1:], np.asarray(sds)[1:]
    size = np.sum((positions - positions[0]) * truth) / np.sum(truth**2) - 1
    return {
        "error_um": 1e6 * np.sqrt(np.mean(error**2)), "claimed_um": 1e6 * np.sqrt(np.mean(sds**2)),
        "size_%": 100 * size, "within": np.mean(np.abs(error) < 1.96 * sds),
    }  # fmt: skip


def _calibrated(folder: Path, board: Board) -> dict[str, float]:
    with xr.open_dataset(folder / "cal.nc") as found:
        sds = np.sqrt(np.einsum("kaka->ka", found["position_covariance"].to_numpy()))
        graded = grade(found["position"].to_numpy(), sds, board.truth.positions)
        return graded | {"residual": float(found.attrs["residual_ratio"])}


def _sampled(folder: Path, board: Board) -> dict[str, float]:
    with xr.open_datatree(folder / "posterior.nc") as tree:
        draws = tree["posterior"]["position"].to_numpy()
    draws = draws.reshape(-1, *draws.shape[2:])
    first = np.zeros((1, 3))
    mean, sds = (np.vstack([first, part]) for part in (draws.mean(axis=0), draws.std(axis=0)))
    return grade(mean, sds, board.truth.positions)


def _diagnosed(folder: Path, board: Board) -> dict[str, float]:
    document = json.loads((folder / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))
    found = document["extended"]
    positions, sds = (np.array(found[name]) for name in ("positions_m", "positions_sd_m"))
    named = ",".join(cause["effect"] for cause in document["causes"]) or "nothing"
    graded = grade(positions, sds, board.truth.positions)
    return graded | {"named": named, "unexplained": document["unexplained"]}


def _applied(folder: Path, board: Board) -> dict[str, float]:
    """Angular rate while the board is twisted, deg/s; the calibrated samples' rates count alike."""
    with xr.open_dataset(folder / "motion.nc", decode_times=False) as found:
        times = found["time"].to_numpy()
        rate = found["angular_rate"].to_numpy()
        sds = found["angular_rate_sd"].to_numpy()
    twisted = times > board.time[-1] - board.options.twisting + 1
    index = np.searchsorted(board.time, times[twisted] - 1e-6)
    error, sds = rate[twisted] - board.truth.rate[index], sds[twisted]
    return {
        "rate_error_dps": np.degrees(np.sqrt(np.mean(error**2))),
        "rate_claimed_dps": np.degrees(np.sqrt(np.mean(sds**2))),
        "rate_within": np.mean(np.abs(error) < 1.96 * sds),
    }


GRADES = {
    "calibrate": _calibrated, "subset": _calibrated, "sample": _sampled, "apply": _applied,
    "diagnose": _diagnosed,
}  # fmt: skip


def walk(board, commands, folder: Path, lines=LINES, grades=GRADES) -> list[dict]:
    """A row a graded command; the last one is the command that failed, if one did.

    ``board`` writes itself into a folder and has a truth; ``lines`` are commands by name,
    ``grades`` what (folder, board) makes a row.
    """
    board.write(folder)
    rows = []
    for name in commands:
        start = time.process_time()
        status, said = run(lines[name], folder)
        row = {"command": name, "status": status}
        if status not in (0, 3):
            return [*rows, row | {"says": said}]
        if name in grades:
            row |= grades[name](folder, board)
            rows.append(row | {"cpu_s": time.process_time() - start})
    return rows


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Over boards, by command: median and worst errors, coverage."""
    found = {}
    for name, part in rows.groupby("command", sort=False):
        found[name] = {
            "boards": len(part), "failed": int((~part.status.isin([0, 3])).sum()),
            "median_error_um": part.error_um.median(), "worst_error_um": part.error_um.max(),
            "worst_size_%": part["size_%"].abs().max(), "coverage_%": 100 * part.within.mean(),
        }  # fmt: skip
        if "residual" in part:
            found[name]["worst_residual"] = part.residual.max()
        if "rate_within" in part:
            found[name]["rate_error_dps"] = part.rate_error_dps.median()
            found[name]["rate_coverage_%"] = 100 * part.rate_within.mean()
    return pd.DataFrame(found).T


def walks(
    seeds, draw, commands, keep: Path | None, name: str, lines=LINES, grades=GRADES
) -> pd.DataFrame:
    """Rows of `walk` for what ``draw`` makes of each seed, printed as they come."""
    rows = []
    for seed in seeds:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary) if keep is None else keep / f"{name}{seed}"
            found = walk(draw(seed), commands, folder, lines, grades)
        for row in found:
            rows.append({"board": f"{name}{seed}"} | row)
            shown = (f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}"
                     for k, v in rows[-1].items())  # fmt: skip
            print("  ".join(shown), flush=True)
    return pd.DataFrame(rows).reindex(columns=_columns(rows))


def draw_kind(seed: int, options: Options) -> Board:
    """A clean board of any kind: IMUs, rate, motion, poses and mounts are drawn."""
    rng = np.random.default_rng([seed, 60])
    rate = float(rng.choice([50, 100, 200, 400, 500, 1000]))
    kind = replace(
        options, imus=int(rng.choice([2, 3, 4, 5, 6, 8, 12, 16])), sampling_rate=rate,
        poses=int(rng.integers(12, 17)), still=rng.uniform(3.5, 5.0), move=rng.uniform(0.6, 2.0),
        twisting=rng.uniform(18.0, 30.0), twist_dps=rng.uniform(300.0, 900.0),
        bandwidth=min(float(rng.choice([2, 4, 8, 16])), rate / 16),
        mount=float(rng.choice([0.3, 1.0, 2.0])),
    )  # fmt: skip
    print({k: v for k, v in vars(kind).items() if v != getattr(options, k)}, flush=True)
    return draw_board(seed, kind)


def _columns(rows) -> list[str]:
    """Those that there are, and the four of a position's grade in any case."""
    needed = ["error_um", "size_%", "within", "claimed_um"]
    return list(dict.fromkeys([key for row in rows for key in row] + needed))


def parser(what, many: str, options=Options) -> argparse.ArgumentParser:
    """The command line: what to do, how many boards or rigs, and every option of one."""
    found = argparse.ArgumentParser()
    found.add_argument("what", choices=what)
    found.add_argument(f"--{many}", type=int, default=3)
    found.add_argument("--first", type=int, default=1, help="seed of the first of them")
    commands = "convert,first-order,calibrate"
    found.add_argument("--commands", default=commands, help=f"of {', '.join(LINES)}")
    found.add_argument("--out", type=Path, help="folder to keep logs and results in")
    for item in fields(options):
        kind = type(item.default) if item.default is not None else int
        name = "--" + item.name.replace("_", "-")
        if kind is bool:
            found.add_argument(name, action="store_true")
        else:
            found.add_argument(name, type=kind, default=item.default)
    return found


def main() -> None:
    """Run what was asked for, and print."""
    given = parser(["make", "walk", "kinds", "mounts", "mistakes"], "boards").parse_args()
    options = Options(**{item.name: getattr(given, item.name) for item in fields(Options)})
    seeds, commands = range(given.first, given.first + given.boards), given.commands.split(",")
    keep = None if given.out is None else given.out.resolve()
    if given.what == "make":
        for seed in seeds:
            draw_board(seed, options).write((keep or Path.cwd()) / f"board{seed}")
    elif given.what in ("walk", "kinds"):
        draw = draw_board if given.what == "walk" else draw_kind
        found = walks(seeds, partial(draw, options=options), commands, keep, "board")
        print(summary(found).to_string())
    elif given.what == "mounts":
        for mount, turned in SWITCHES:
            own = partial(draw_board, options=replace(options, mount=mount, turned=turned))
            found = walks(seeds, own, commands, keep, f"mount{mount:g}_turned{turned:g}_")
            print(summary(found).to_string())
    else:
        from benchmarks.board_mistakes import try_all

        try_all(given.first, options, commands, keep)


if __name__ == "__main__":
    main()
