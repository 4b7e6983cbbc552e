"""Positions of one board from several recordings, before and after the model was extended."""

from functools import partial

import numpy as np
import pandas as pd

from imuarray.figures.style import BLACK, PAGE, look, new_figure, panels, styled

NAMES = {
    "base": "papers' model, declared noise",
    "inflated": "papers' model, inflated noise",
    "extended": "extended model",
}


def figure_repeatability(documents: dict[str, dict], agreement: pd.DataFrame, group: str):
    """Left: each coordinate's spread over the recordings; right: found and claimed, coverage.

    ``documents``: diagnosis.json by recording of the board ``group``; ``agreement`` as
    `imuarray.diagnosis.repeatability.positions_agreement` returns it.
    """
    footer = [
        f"{len(documents)} recordings of board {group}; differences of all"
        " pairs in all coordinates. Pairs share recordings."
    ]
    parts = []
    for model in NAMES:
        found = np.array([d[model]["positions_m"] for d in documents.values()])[:, 1:]
        away = 1e6 * (found - found.mean(axis=0)).reshape(len(found), -1)
        recording, place = np.indices(away.shape).reshape(2, -1)
        parts.append(pd.DataFrame(
            {"model": model, "recording": np.array(list(documents))[recording],
             "coordinate": place, "away_um": away.ravel()}
        ))  # fmt: skip
    table = panels(agreement=agreement, coordinates=pd.concat(parts))
    return partial(_draw, footer=footer), table


@styled
def _draw(table, footer):
    agreement = table[table.panel == "agreement"]
    coordinates = table[table.panel == "coordinates"]
    count = int(coordinates.coordinate.max()) + 1
    figure = new_figure(footer, PAGE, 2.8)
    left, middle, right = figure.subplots(1, 3, width_ratios=[2.2, 1, 1])
    for index, model in enumerate(NAMES):
        style = look(index)
        own = coordinates[coordinates.model == model]
        left.plot(own.coordinate + 0.25 * (index - 1), own.away_um, color=style["color"],
                  marker=style["marker"], markersize=2, linestyle="")  # fmt: skip
        left.plot([], [], color=style["color"], marker=style["marker"], linestyle="",
                  label=NAMES[model])  # fmt: skip
        row = agreement[agreement.model == model].iloc[0]
        middle.plot(index, 1e6 * row.apart_rms_m, color=style["color"], marker=style["marker"])
        middle.plot(index, 1e6 * row.claimed_rms_m, color=style["color"], marker=style["marker"],
                    markerfacecolor="none")  # fmt: skip
        right.plot(index, 100 * row.coverage_95, color=style["color"], marker=style["marker"])
    left.axhline(0, color=BLACK, linewidth=0.5)
    left.set_xticks(np.arange(1, count, 3), range(2, count // 3 + 2))
    left.set(xlabel="IMU (x, y, z)", ylabel="from the recordings' mean (µm)")
    middle.set(
        yscale="log", ylabel="rms of differences (µm)", title="found (filled)\nclaimed (open)"
    )
    right.axhline(95, color=BLACK, linewidth=0.6)
    right.set(ylim=(0, 102), ylabel="covered (%)", title="95 % intervals")
    for axes in (middle, right):
        axes.set_xticks(range(3), ["declared", "inflated", "extended"], rotation=30)
        axes.set_xlim(-0.5, 2.5)
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure
