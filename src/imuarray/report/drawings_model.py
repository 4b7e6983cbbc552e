"""Each cause, the extended model's positions, and which effects a recording can distinguish."""

import numpy as np
import pandas as pd

from imuarray.diagnosis.settings import SETTINGS
from imuarray.pictures.board import SURE
from imuarray.pictures.style import BLACK, BLUE, LOOKS, PAGE, VERMILLION, new_figure, shade, styled
from imuarray.report.drawings import MODELS, NAMES, imu_ticks, legend_above, plain
from imuarray.words import spelled

ALIKE = SETTINGS.alike  # squared correlation from which two effects are one class
DARK = 0.75  # from which numbers are white


@styled
def position_figure(table: pd.DataFrame, footer=()):
    """Where the extended model puts each triad, from where the plain model does, with 95 %.

    ``table``: `imuarray.report.numbers.position_table`.
    """
    figure = new_figure(footer, PAGE, 2.4)
    panels = figure.subplots(1, 3, sharey=True)
    labels = list(dict.fromkeys(table.imu))
    factor, unit = (1e6, "µm") if table.change.abs().max() < 2e-3 else (1e3, "mm")
    for axes, axis in zip(panels, "xyz", strict=True):
        part = table[table["axis"] == axis]
        places = np.array([labels.index(name) for name in part.imu])
        size = imu_ticks(axes, labels, 10)
        for model, shift, centre in (
            ("base", -0.15, 0 * part.change),
            ("extended", 0.15, part.change),
        ):
            axes.errorbar(places + shift, factor * centre, factor * SURE * part[f"{model}_sd"],
                          linestyle="", markersize=0.8 * size, elinewidth=0.9, label=NAMES[model],
                          **MODELS[model])  # fmt: skip
        axes.axhline(0, color=BLACK, linewidth=0.5)
        axes.set_title(axis)
    panels[0].set_ylabel(f"change of position ({unit})")
    legend_above(figure, panels[0].get_legend_handles_labels()[0])
    return figure


@styled
def separability_figure(table: pd.DataFrame, footer=()):
    """Matrix of squared canonical correlations: largest below the diagonal, mean above.

    ``table``: `imuarray.report.numbers.separability_table`.
    """
    names = list(dict.fromkeys(table.effect))
    figure = new_figure(footer, PAGE, 1.2 + 0.29 * len(names))
    axes = figure.subplots()
    for row in table.itertuples():
        i, j = names.index(row.effect), names.index(row.other)
        if i != j:
            _cell(axes, i, j, row.largest if i > j else row.mean)
    labels = [spelled(name) for name in names]
    axes.set_yticks(range(len(names)), labels, size=7)
    axes.set_xticks(range(len(names)), labels, size=7, rotation=60, ha="left",
                    rotation_mode="anchor")  # fmt: skip
    axes.xaxis.tick_top()
    axes.plot([-0.5, len(names) - 0.5], [-0.5, len(names) - 0.5], color=BLACK, linewidth=0.8)
    axes.set(xlim=(-0.5, len(names) - 0.5), ylim=(len(names) - 0.5, -0.5))
    axes.grid(False)
    axes.tick_params(length=0)
    axes.set_xlabel("below the diagonal: the two most alike forms;  above: mean over the forms")
    return figure


def _cell(axes, line, column, value):
    color = shade(BLUE, value)
    axes.fill_between([column - 0.5, column + 0.5], line - 0.5, line + 0.5, color=color, lw=0)
    one_class = value > ALIKE
    axes.text(
        column, line, f"{value:.2f}".replace("0.", ".").replace("1.00", "1"), size=6.5,
        ha="center", va="center_baseline", color="white" if value > DARK else BLACK,
        weight="bold" if one_class else "normal",
    )  # fmt: skip
    if one_class:
        axes.fill_between(
            [column - 0.46, column + 0.46], line - 0.46, line + 0.46, facecolor="none",
            edgecolor=VERMILLION, linewidth=1.3, zorder=4,
        )  # fmt: skip


@styled
def cause_figure(table: pd.DataFrame, footer=()):
    """The added-variable plot of a cause, and panels of its own physics.

    ``table``: `imuarray.report.panels.cause_table`.
    """
    count = int(table.panel.max()) + 1
    figure = new_figure(footer, PAGE, 2.35)
    panels = figure.subplots(1, count, squeeze=False)[0]
    for axes, (number, part) in zip(panels, table.groupby("panel"), strict=True):
        (_added_variable if number == 0 else _own)(axes, part)
        axes.set_xlabel(part.x_label.iloc[0], size=7)
        axes.set_ylabel(part.y_label.iloc[0], size=7)
        axes.set_title(plain(part.title.iloc[0]), size=7.5)
        axes.tick_params(labelsize=6.5)
        axes.locator_params(nbins=5, steps=[1, 2, 5, 10])
    return figure


def _added_variable(axes, table):
    """Means of bins with two standard errors, and the line on which they ought to be."""
    ends = np.array([table.x.min(), table.x.max()])
    axes.plot(ends, ends, color=BLACK, linewidth=0.9, zorder=1)
    several = table.series.nunique() > 1
    for (name, part), look in zip(table.groupby("series"), LOOKS, strict=False):
        axes.errorbar(part.x, part.y, 2 * part.se, linestyle="", marker=look["marker"],
                      color=look["color"], markersize=3.2, elinewidth=0.7, label=name)  # fmt: skip
    if several:
        axes.legend(fontsize=6)


def _own(axes, table):
    """Means of bins with two standard errors, and the fitted cause through them."""
    table = table.sort_values("x")
    axes.plot(table.x, table.model, color=BLUE, linewidth=1.1, zorder=1)
    axes.errorbar(table.x, table.y, 2 * table.se, linestyle="", marker="o", color=VERMILLION,
                  markersize=3.2, elinewidth=0.7)  # fmt: skip
    axes.axhline(0, color=BLACK, linewidth=0.4)
