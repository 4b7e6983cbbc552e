"""What every command costs as recordings get longer and boards larger: one table and one figure.

`python -m benchmarks.growth [results/growth.png] [--commands ...] [--out results/growth.md]`, from
the project's root: boards of `benchmarks.board` go through the commands from their log to the
answers; core seconds (user and system) and peak memory of each, compiled code cached, with the
growth's exponent between the two largest sizes. Other jobs change core seconds little.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, StrMethodFormatter

from benchmarks.board import GRAVITY, Options, draw_board
from benchmarks.cost import cost
from benchmarks.written import publish
from imuarray.pictures.style import BLACK, GREY, LOOKS, PAGE, new_figure, styled
from imuarray.provenance import atomic_write

LENGTHS, IMUS = (1, 2, 4), (4, 8, 16)  # times a minute and a half; 4 IMUs grow longer
DRAWN = 100  # samples that are sampled from, times length: more need another sampler
LINES = (  # a look for each command
    *LOOKS,
    {"color": BLACK, "marker": "X", "linestyle": "-."},
    {"color": GREY, "marker": "*", "linestyle": ":"},
)
FIRST = ("convert", "first-order")  # what all others go on from
COMMANDS = {
    "convert": "convert csv log.csv --columns columns.yaml --out rec.nc",
    "first-order": f"first-order rec.nc --gravity {GRAVITY} --out corrected.nc",
    "select": "select corrected.nc --out moving.nc",
    "calibrate --model papers": "calibrate corrected.nc --model papers --out papers.nc",
    "calibrate": "calibrate corrected.nc --out cal.nc",
    "apply": "apply cal.nc corrected.nc --out motion.nc",
    "sample": "sample few.nc --out posterior.nc",
    "diagnose": "diagnose corrected.nc --out diagnosis",
}


def spent(line: str, folder: Path) -> tuple[float, float]:
    """(core seconds, peak memory in GB) of a command in a folder, BLAS with one thread."""
    alone = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    found = cost(line.split(), folder, os.environ | alone)
    return found.cores, found.memory


def board(imus: int, length: float, commands, folder: Path) -> list[dict]:
    """A row for each command, on one board's recording."""
    options = Options(imus=imus, still=5 * length, move=1 + length / 2, twisting=15 * length)
    draw_board(5, options).write(folder)
    rows = []
    for name, line in COMMANDS.items():
        if name not in commands:
            if name in FIRST or (name == "calibrate" and "apply" in commands):
                spent(line, folder)
            continue
        if name == "sample":
            spent(f"select corrected.nc --samples {round(DRAWN * length)} --out few.nc", folder)
        for _ in range(2 if length == LENGTHS[0] else 1):  # the first one may have to compile
            seconds, memory = spent(line, folder)
        with xr.open_dataset(folder / "rec.nc") as recording:
            samples = recording.sizes["time"]
        samples = round(DRAWN * length) if name == "sample" else samples
        rows.append({"command": name, "imus": imus, "length": length, "samples": samples,
                     "seconds": seconds, "memory": memory})  # fmt: skip
    return rows


def measured(commands, folder: Path) -> pd.DataFrame:
    """Rows of all boards."""
    sizes = [(IMUS[0], length) for length in LENGTHS] + [(imus, LENGTHS[0]) for imus in IMUS[1:]]
    found = []
    for imus, length in sizes:
        (folder / f"{imus}_{length:g}").mkdir()
        found += board(imus, length, commands, folder / f"{imus}_{length:g}")
    return pd.DataFrame(found)


def growing(rows: pd.DataFrame):
    """(what grows, its rows) of both kinds."""
    yield "samples", rows[rows.imus == IMUS[0]]
    yield "imus", rows[rows.length == LENGTHS[0]]


def table(rows: pd.DataFrame) -> str:
    """A line for each command and kind of growth."""
    lines = ["| what | core seconds, peak memory | last exponent |", "|---|---|---|"]
    for name, own in rows.groupby("command", sort=False):
        for what, part in growing(own):
            n, s, m = (part[key].to_numpy() for key in (what, "seconds", "memory"))
            exponent = np.log(s[-1] / s[-2]) / np.log(n[-1] / n[-2])
            listed = ", ".join(
                f"{size}: {seconds:.1f} s, {memory:.2f} GB"
                for size, seconds, memory in zip(n, s, m, strict=True)
            )
            words = what.replace("imus", "IMUs")
            lines.append(f"| `{name}`, growth in {words} | {listed} | {exponent:.2f} |")
    return "\n".join(lines) + "\n"


def _plain(axis, ticks) -> None:
    """Numbers as they are, at these ticks alone: few decades."""
    axis.set_major_locator(ticks)
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


@styled
def draw(rows: pd.DataFrame):
    """Core seconds and peak memory over samples and over IMUs."""
    figure = new_figure(["benchmarks/growth.py: a line for each command"],
                        width=PAGE, height=4.6)  # fmt: skip
    grid = figure.subplots(2, 2, sharey="row", sharex="col")
    kinds = ("seconds", "core seconds"), ("memory", "peak memory [GB]")
    for column, (what, part) in enumerate(growing(rows)):
        for line, (key, words) in enumerate(kinds):
            axes = grid[line, column]
            for place, (name, own) in enumerate(part.groupby("command", sort=False)):
                axes.loglog(own[what], own[key], label=name, **LINES[place])
            axes.set_ylabel(words if column == 0 else "")
            _plain(axes.yaxis, LogLocator(subs=(1, 2, 5)))
        axes.set_xlabel(what.replace("imus", "IMUs"))
    _plain(grid[1, 1].xaxis, FixedLocator(IMUS))
    labels = grid[0, 1].get_legend_handles_labels()
    figure.legend(*labels, loc="outside upper center", ncols=4, fontsize=6)
    return figure


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("figure", type=Path, nargs="?", default=Path("results/growth.png"))
    parser.add_argument("--out", type=Path, default=Path("results/growth.md"))
    parser.add_argument("--commands", nargs="+", choices=COMMANDS, default=list(COMMANDS))
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = measured(chosen.commands, Path(folder))
    publish(table(rows), chosen.out)
    with atomic_write(chosen.figure) as temporary:
        draw(rows).savefig(temporary)


if __name__ == "__main__":
    main()
