"""The samplers side by side as a figure, from the table that `samplers.py` writes.

`python benchmarks/samplers_figure.py results/samplers.csv docs/images/samplers.png`
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from imuarray.pictures.style import BLACK, PAGE, look, new_figure, styled
from imuarray.provenance import atomic_write

CONVERGED = 1.05  # R-hat, as paper 2021 has it
SHORT = {  # how a method's name begins: what the figure calls it
    "PmMH, isotropic walk (27)": "PmMH, paper's walk",
    "the same, omega": "its omega centred",
    "NUTS": "NUTS",
    "emcee": "emcee",
}


def statistics(rows) -> pd.DataFrame:
    """A row per sampler, T and coordinate: what is drawn."""
    parts = []
    for row in rows:
        flat = row.draws.reshape(-1, row.draws.shape[-1])
        names = (short for start, short in SHORT.items() if row.method.startswith(start))
        parts.append(pd.DataFrame({
            "sampler": next(names), "samples": row.samples, "rhat": row.rhat, "ess": row.ess,
            "core_seconds": row.core_seconds, "coordinate": np.arange(flat.shape[1]),
            "mean_m": flat.mean(axis=0), "sd_m": flat.std(axis=0),
        }))  # fmt: skip
    return pd.concat(parts, ignore_index=True)


@styled
def draw(table: pd.DataFrame):
    """Effective draws per core second over T; means and sds against NUTS' at the largest T."""
    figure = new_figure(
        [
            "benchmarks/samplers.py: data of paper 2021, IV-A; smallest bulk ESS of 93 parameters."
            " Bars hold the 93 coordinates, markers are their medians. Hollow: R-hat above 1.05."
        ],
        width=PAGE,
        height=2.8,
    )
    speed, means, sds = figure.subplots(1, 3, width_ratios=[1.5, 1, 1])
    largest = table[table.samples == table.samples.max()]
    reference = largest[largest.sampler == "NUTS"]
    names = list(dict.fromkeys(table.sampler))
    for place, name in enumerate(names):
        rates = table[table.sampler == name].groupby("samples").first()
        heights = rates.ess / rates.core_seconds
        speed.plot(rates.index, heights, label=name, **look(place))
        doubtful = rates.rhat > CONVERGED
        speed.plot(
            rates.index[doubtful], heights[doubtful], linestyle="none", markerfacecolor="white",
            zorder=3, **look(place, "linestyle"),
        )  # fmt: skip
        own = largest[largest.sampler == name]
        apart = (own.mean_m.to_numpy() - reference.mean_m.to_numpy()) / reference.sd_m.to_numpy()
        ratio = own.sd_m.to_numpy() / reference.sd_m.to_numpy()
        for axes, values in ((means, apart), (sds, ratio)):
            color = look(place)["color"]
            axes.vlines(place, values.min(), values.max(), color=color)
            axes.plot(place, np.median(values), look(place)["marker"], color=color)
    speed.set(xscale="log", yscale="log", xlabel="Time samples $T$ (count)",
              ylabel="ESS per core second (1/s)")  # fmt: skip
    largest_t = f"$T$ = {table.samples.max()}"
    means.set(ylabel="mean less NUTS' (posterior sds)", xlabel=largest_t)
    sds.set(ylabel="sd over NUTS'", xlabel=largest_t)
    means.axhline(0.0, color=BLACK, linewidth=0.6)
    sds.axhline(1.0, color=BLACK, linewidth=0.6)
    for axes in (means, sds):
        axes.set_xticks([])
    figure.legend(*speed.get_legend_handles_labels(), loc="outside upper center", ncols=5)
    return figure


def write(table: pd.DataFrame, path: Path) -> None:
    """Draw it into a file."""
    with atomic_write(path) as temporary:
        draw(table).savefig(temporary, dpi=200, metadata={"Software": None})


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", type=Path)
    parser.add_argument("figure", type=Path)
    given = parser.parse_args()
    write(pd.read_csv(given.table), given.figure)
