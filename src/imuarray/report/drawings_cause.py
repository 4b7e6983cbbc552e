"""A cause itself: what the readings show without it, against what it depends on."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.figures.style import BLACK, BLUE, LOOKS, PAGE, VERMILLION, new_figure, styled
from imuarray.report.drawings import plain


@styled
def cause_figure(table: pd.DataFrame, footer=()):
    """The added-variable plot of a cause, and panels of its own physics.

    ``table``: `imuarray.report.signals.cause_table`.
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
