"""Paper 2021, figure 1: layout and dimensions of the array."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.patches import Rectangle

from imuarray.figures.style import BLACK, BLUE, new_figure, styled
from imuarray.geometry import UNDERSIDE_ROTATION, Array

# The orientation marker in a topside package, in units of the package's sides. The text does
# not say in which corner it is; on the axis that the underside is turned around, as here, both
# sides' markers lie one above the other.
MARKER = np.array([0.36, -0.36, 0.0])


def below(array: Array) -> np.ndarray:
    """Which triads (A,) lie on the underside: those below the middle of the board's height."""
    height = array.positions[:, 2]
    return height < (height.min() + height.max()) / 2 - 1e-9


def layout_table(array: Array) -> pd.DataFrame:
    """One row per triad: label, side, position, position relative to the first, marker (m)."""
    under = below(array)
    turn = np.where(under[:, None, None], UNDERSIDE_ROTATION, np.eye(3))
    marker = turn @ (MARKER * np.array(array.package))
    table = pd.DataFrame({"accelerometer": array.labels})
    table["side"] = np.where(under, "underside", "topside")
    for name, values in (
        ("", array.positions), ("relative_", array.relative),
        ("marker_", array.positions + marker),
    ):  # fmt: skip
        for axis, column in zip("xyz", values.T, strict=True):
            table[f"{name}{axis}_m"] = column
    for axis, length in zip(("length", "width", "height"), array.package, strict=True):
        table[f"package_{axis}_m"] = length
    return table


@styled
def fig1(table: pd.DataFrame, footer=()):
    """Top view (y axis downwards) with numbers and pitch, and the side view under it."""
    figure = new_figure(footer, height=4.0)
    top, side = figure.subplots(2, 1, height_ratios=[6.2, 1], sharex=True)
    _top_view(top, table)
    _side_view(side, table)
    return figure


def _top_view(axes, table):
    mm = table[[c for c in table if c.endswith("_m")]] * 1e3
    length, width = mm.package_length_m.iloc[0], mm.package_width_m.iloc[0]
    under = (table.side == "underside").to_numpy()
    for row in mm.itertuples():
        if not under[row.Index]:
            draw_package(axes, row.x_m, row.y_m, length, width, facecolor="0.35")
            axes.plot(row.marker_x_m, row.marker_y_m, "o", color="white", markersize=3.2)
        shift = 0.62 if under[row.Index] else -0.62
        axes.text(
            row.x_m, row.y_m + shift, table.accelerometer[row.Index], ha="center", va="center",
            color="#9AD0F5" if under[row.Index] else "white", size=8,
            style="italic" if under[row.Index] else "normal",
        )  # fmt: skip
    _dimension(axes, mm.x_m, mm.y_m.max() + 0.75 * width, "x")
    _dimension(axes, mm.y_m, mm.x_m.min() - 0.75 * length, "y")
    axes.set(aspect="equal", ylabel="y (mm), downwards")
    axes.set_ylim(mm.y_m.max() + 1.3 * width, mm.y_m.min() - 0.8 * width)
    axes.set_xlim(mm.x_m.min() - 2.15 * length, mm.x_m.max() + length)
    axes.grid(False)
    axes.set_title("Seen from above: upright topside, italic underside", size=8)


def draw_package(axes, x, y, length, width, **options):
    """The outline of a package centred at x, y; all in mm."""
    options = {"edgecolor": BLACK, "linewidth": 0.6} | options
    axes.add_patch(Rectangle((x - length / 2, y - width / 2), length, width, **options))


def _dimension(axes, values, place, along):
    """An arrow between the first two distinct centres, at ``place`` across, and its length."""
    centres = np.unique(np.round(values, 9))
    if centres.size < 2:
        return
    first, second = (centres[0], centres[1]) if along == "x" else (centres[-1], centres[-2])
    ends = [(first, place), (second, place)] if along == "x" else [(place, first), (place, second)]
    axes.annotate(
        "", *ends, arrowprops={"arrowstyle": "<->", "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0}
    )
    middle = np.mean(ends, axis=0)
    axes.annotate(
        f"{abs(second - first):.1f} mm", middle, ha="center", va="center", size=7.5,
        rotation=0 if along == "x" else 90, xytext=(0, -7) if along == "x" else (-7, 0),
        textcoords="offset points",
    )  # fmt: skip


def _side_view(axes, table):
    mm = table[[c for c in table if c.endswith("_m")]] * 1e3
    length, height = mm.package_length_m.iloc[0], mm.package_height_m.iloc[0]
    low, high = mm.z_m.min(), mm.z_m.max()
    if high - low > height:  # what is between the packages is the circuit board
        axes.add_patch(
            Rectangle(
                (mm.x_m.min() - 0.7 * length, low + height / 2),
                np.ptp(mm.x_m) + 1.4 * length,
                high - low - height,
                facecolor="#BFD8C6",
                edgecolor="0.4",
                linewidth=0.5,
            )  # fmt: skip
        )
    for x, z in sorted(set(zip(mm.x_m.round(6), mm.z_m.round(6), strict=True))):
        draw_package(axes, x, z, length, height, facecolor="0.35")
        axes.plot(x, z, "+", color="white", markersize=4)
    if high > low:
        _height(axes, mm.x_m.min() - 0.8 * length, mm.x_m.min() - length / 2, low, high)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="z (mm)", ylim=(low - 1.2, high + 1.2))
    axes.grid(False)
    axes.set_title("Side view", size=8)


def _height(axes, place, edge, low, high):
    """The distance between the sides' centres: an arrow at ``place``, lines to ``edge``."""
    axes.annotate(
        "", (place, low), (place, high),
        arrowprops={"arrowstyle": "<->", "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    for z in (low, high):
        axes.plot([place, edge], [z, z], color=BLUE, linewidth=0.4)
    axes.annotate(
        f"{high - low:.1f} mm", (place, (low + high) / 2), xytext=(-3, 0), size=7.5,
        textcoords="offset points", va="center", ha="right",
    )  # fmt: skip
