"""Estimation theory: the Cramer-Rao bound, who reaches it, how fast, and the array's size."""

from functools import partial

import numpy as np
import pandas as pd

from imuarray.figures.style import (
    BLACK,
    GREY,
    MARKERS,
    logarithmic,
    look,
    new_figure,
    points,
    styled,
)
from imuarray.figures.tables import Column, scale_line

ESTIMATORS = ("maximum likelihood", "with the prior")

RANKS = (
    Column("case", "motion and geometry", "motion and geometry"),
    Column("samples", "samples", "$N$"),
    Column("unknowns", "unknowns", "unknowns"),
    Column("rank", "rank of the information", "rank"),
    Column("condition", "condition of what is seen", "condition", "{:.2g}"),
)


def table_theory_ranks(rows: pd.DataFrame, settings: dict):
    """Rank of the information over N, motion and geometry; ``rows``: `studies.bound.ranks`."""
    note = (
        "Fisher information of the positions r_2 ... r_A with the motion unknown, scaled to a unit"
        " diagonal. A rank below the number of unknowns: the positions cannot be identified."
    )
    caption = "Which motion and geometry tell the positions."
    return rows, RANKS, caption, [note, scale_line(settings)]


def figure_theory_efficiency(rows: pd.DataFrame, settings: dict):
    """RMSE over N beside the bound, their ratio, and that over the noise.

    ``rows``: `studies.bound.efficiency` for the model's noise, then for others at one N.
    """
    footer = [scale_line(settings, f"{rows.realisations.max()} realisations per point")]
    return partial(_draw_efficiency, footer=footer), rows


@styled
def _draw_efficiency(table, footer):
    figure = new_figure(footer, height=5.4)
    top, below, louder = figure.subplots(3, 1, height_ratios=[2, 1, 1])
    others = table[table.noise != 1.0]
    for index, name in enumerate(ESTIMATORS):
        rows = table[(table.estimator == name) & (table.noise == 1.0)]
        points(top, rows.samples, rows.rmse_m, rows.rmse_se_m, index, linestyle="none",
               label=f"RMSE, {name}")  # fmt: skip
        top.plot(
            rows.samples, rows.bound_m, **look(index, "marker"),
            label="bound" if index == 0 else "linearised posterior",
        )  # fmt: skip
        places = rows.samples * 1.04**index
        points(below, places, rows.ratio, rows.ratio_se, index, linestyle="none")
        rows = table[(table.estimator == name) & table.samples.isin(others.samples)]
        points(louder, rows.noise * 1.04**index, rows.ratio, rows.ratio_se, index)
    for panel in (below, louder):
        panel.axhline(1.0, color=BLACK, linewidth=0.8)
        panel.set(ylabel="error / bound")
    top.set(xscale="log", yscale="log", ylabel="RMSE of the positions (m)")
    below.set(xscale="log", xlabel="Time samples $N$ (count)")
    counts = ", ".join(map(str, others.samples.unique()))
    louder.set(xscale="log", xlabel=f"Noise, times the sensors' own ($N$ = {counts})")
    top.legend(loc="upper right")
    return figure


def figure_theory_convergence(rows: pd.DataFrame, settings: dict):
    """Iterations to 1.01 times the bound over the motion, and ML-BCD's rate, predicted and seen.

    ``rows``: `studies.bound.convergence` of the array, then of others. Motions that determine the
    positions hardly better than they are known nominally are left out above; filled triangles at
    the top are medians beyond the limit of iterations.
    """
    footer = [scale_line(settings, f"N = {rows.samples.max()}")]
    given = {"nominal_sd": settings["paper2017"]["position_sd"], "footer": footer}
    return partial(_draw_convergence, **given), rows


@styled
def _draw_convergence(table, nominal_sd, footer):
    figure = new_figure(footer, height=5.4)
    top, below = figure.subplots(2, 1)
    own = table[table.array == table.array.iloc[0]]
    for index, (acceleration, rows) in enumerate(own.groupby("angular_acceleration_dps2")):
        # medians: a run that did not come to an end counts as longer than any other
        known = rows[rows.groupby("angular_rate_dps").bound_m.transform("median") < nominal_sd / 3]
        counts = known[["angular_rate_dps", "bcd_iterations", "newton_iterations"]].fillna(np.inf)
        medians = counts.groupby("angular_rate_dps").median()
        never = medians.index[np.isinf(medians.bcd_iterations)]
        medians = medians.replace(np.inf, np.nan)
        style = look(index)
        top.plot(
            never, np.full(len(never), 1.3 * rows.limit.max()), linestyle="none", marker="^",
            color=style["color"], markersize=7 - index,
        )  # fmt: skip
        top.plot(
            medians.index, medians.bcd_iterations, markerfacecolor="none",
            label=rf"$\|\dot\omega\|$ = {acceleration:g} deg/s²", **style,
        )  # fmt: skip
        top.plot(medians.index, medians.newton_iterations, color=GREY, marker=style["marker"],
                 markerfacecolor="none", linestyle=":")  # fmt: skip
        below.plot(
            1 - rows.contraction, 1 - rows.observed, markerfacecolor="none",
            **{**style, "linestyle": "none"},
        )  # fmt: skip
    for index, (name, rows) in enumerate(table[table.array != own.array.iloc[0]].groupby("array")):
        below.plot(
            1 - rows.contraction, 1 - rows.observed, color=BLACK, linestyle="none",
            marker=MARKERS[-1 - index], markerfacecolor="none", label=name,
        )  # fmt: skip
    top.plot([], [], color=GREY, linestyle=":", label="Gauss-Newton, each")
    logarithmic(top, r"Angular rate $\|\omega\|$ (deg/s)", "iterations to 1.01 × bound")
    top.legend(loc="lower center", bbox_to_anchor=(0.5, 0.12), ncols=2, columnspacing=1.0)
    drawn = 1 - table.contraction[table.observed.notna()]
    ends = np.array([drawn.min() / 2, min(drawn.max() * 2, 1.0)])
    below.plot(ends, ends, color=BLACK, linewidth=0.8)
    logarithmic(below, "share of the error lost in an iteration, foreseen", "seen")
    below.legend(loc="upper left", title="other arrays", title_fontsize=7)
    return figure


def figure_theory_size(rows: pd.DataFrame, settings: dict):
    """The bound over the array's size, absolute and relative to it; `studies.bound.against_size`.

    Both on one axis of lengths would hide that the one falls: two panels.
    """
    footer = [scale_line(settings, f"N = {settings['theory']['convergence_samples']}")]
    return partial(_draw_size, footer=footer), rows


@styled
def _draw_size(table, footer):
    figure = new_figure(footer, height=4.0)
    top, below = figure.subplots(2, 1, sharex=True)
    top.plot(1e3 * table.extent_m, 1e6 * table.bound_m, markerfacecolor="none", **look(0))
    below.plot(1e3 * table.extent_m, 1e6 * table.relative, markerfacecolor="none", **look(2))
    # both panels over as many decades, so that what does not change looks so
    decades = np.log10(table.relative.max() / table.relative.min()) * 0.6
    middle = 1e6 * np.median(table.bound_m)
    span = (middle * 10**-decades, middle * 10**decades)
    logarithmic(top, None, "bound (µm)", ylim=span)
    logarithmic(below, "size of the array, corner to corner (mm)", "bound / size (ppm)")
    return figure
