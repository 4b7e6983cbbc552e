"""Drawings of one recording's diagnosis, each of its table of `imuarray.report.numbers`."""

import matplotlib.ticker as ticks
import numpy as np
import pandas as pd

from imuarray.diagnosis.settings import SETTINGS
from imuarray.model.effects import KINDS
from imuarray.pictures.board import SURE, plain
from imuarray.pictures.style import (
    BLACK,
    BLUE,
    GREY,
    LOOKS,
    ORANGE,
    PAGE,
    VERMILLION,
    new_figure,
    shade,
    styled,
)
from imuarray.words import number, power_of_ten, shown_in, spelled, unit_shown

MODELS = {
    "base": {"color": VERMILLION, "marker": "o", "label": "plain model"},
    "extended": {"color": BLUE, "marker": "s", "label": "extended model"},
}
BAND = {"color": "0.87", "lw": 0}  # where simulations are
PLAIN = 0.05  # p-value below which a mark is filled
ALIKE = SETTINGS.alike  # squared correlation from which two effects are one class
DARK = 0.75  # from which numbers are white


def imu_ticks(axes, labels, most=16) -> float:
    """IMUs along the abscissa, every n-th named where they are many; a size for their marks."""
    step = -(-len(labels) // most)
    places = range(0, len(labels), step)
    axes.set_xticks(places, [plain(labels[place]) for place in places])
    axes.grid(False, axis="x")
    axes.set_xlabel("IMU")
    return 5.0 if len(labels) <= most else 2.5


def legend_above(figure, handles) -> None:
    """One legend for all panels."""
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))


def by_kind(figure, table, **options) -> list:
    """(axes, rows) of each kind of sensor that a table has, side by side."""
    kinds = [kind for kind in KINDS if kind in set(table.kind)]
    panels = figure.subplots(1, len(kinds), squeeze=False, **options)[0]
    for axes, kind in zip(panels, kinds, strict=True):
        axes.set_title(f"{kind}s")
    return [(axes, table[table.kind == kind]) for axes, kind in zip(panels, kinds, strict=True)]


@styled
def discrepancy_figure(table: pd.DataFrame, footer=()):
    """Every check as a dot beside the band of simulations, in sds of that band; both models."""
    names = list(dict.fromkeys(table.label))
    figure = new_figure(footer, PAGE, 0.75 + 0.23 * len(names))
    for axes, part in by_kind(figure, table, sharey=True):
        axes.axvline(0, color=BLACK, linewidth=0.5)
        for (model, look), shift in zip(MODELS.items(), (-0.16, 0.16), strict=True):
            for row in part[part.model == model].itertuples():
                place = names.index(row.label)
                if model == "base":  # the band is that of the plain model
                    axes.fill_between([-row.limit, row.limit], place - 0.36, place + 0.36, **BAND)
                face = look["color"] if row.p_value <= PLAIN else "white"
                axes.plot(row.standardised, place + shift, linestyle="", markersize=4.5,
                          markerfacecolor=face, **look)  # fmt: skip
        axes.set(xlabel="sds of the simulated band", ylim=(len(names) - 0.4, -0.6))
        _wide_scale(axes, part.standardised)
    axes = figure.axes[0]
    axes.set_yticks(range(len(names)), names)
    handles = _model_handles(axes, 4.5)
    handles += axes.plot([], [], linestyle="", marker="o", color=BLACK, markerfacecolor="white",
                         markersize=4.5, label=f"open: p > {PLAIN:g}")  # fmt: skip
    handles.append(axes.fill_between([], [], [], label="95 % of simulations", **BAND))
    legend_above(figure, handles)
    return figure


def _wide_scale(axes, values):
    """Linear where all is near the band, else logarithmic beyond it."""
    far = float(np.max(np.abs(values)))
    if far < 15:
        edge = 1.15 * max(far, 4.5)
        low = -edge if values.min() < -3.6 else -4.5
        axes.set_xlim(low, edge if values.max() > 3.6 else 4.5)
        return
    axes.set_xscale("symlog", linthresh=5, linscale=1.2)
    _ticks_at_powers(axes, values, 1, 3, 3, lambda x, _: f"{x:,.0f}".replace("-", "−"))
    axes.xaxis.set_minor_locator(ticks.NullLocator())
    axes.set_xlim(min(-5, 2 * values.min()), max(5, 2 * values.max()))


def _ticks_at_powers(axes, values, first: int, most: int, room: float, text):
    """Ticks of a symlog axis at 0 and at powers of ten, every other one beyond ``most``.

    From 10^first to the largest size; negative ones down to ``room`` times the least value.
    """
    powers = 10.0 ** np.arange(first, np.ceil(np.log10(np.abs(values).max())) + 1)
    powers = powers[:: 1 + (len(powers) > most)]
    low = -powers[powers <= room * abs(min(values.min(), 0))][::-1]
    axes.set_xticks([*low, 0, *powers])
    axes.xaxis.set_major_formatter(text)


def _model_handles(axes, size) -> list:
    """A mark of each model for a legend."""
    return [axes.plot([], [], linestyle="", markersize=size, **look)[0] for look in MODELS.values()]


@styled
def residual_figure(table: pd.DataFrame, footer=()):
    """rms residual of every IMU before and after, in declared noise sds."""
    figure = new_figure(footer, PAGE, 2.7)
    for axes, part in by_kind(figure, table):
        _residuals(axes, part)
    axes = figure.axes[0]
    axes.set_ylabel("rms residual / declared noise")
    handles = _model_handles(axes, 5)
    handles += axes.plot([], [], "_", color=GREY, markersize=5, label="single axes")
    handles += axes.plot([], [], "-", color=BLACK, linewidth=1.5, label="noise, extended model")
    handles.append(axes.fill_between([], [], [], label="as simulated, 95 %", **BAND))
    legend_above(figure, handles)
    return figure


def _residuals(axes, table):
    labels = list(dict.fromkeys(table.imu))
    large = imu_ticks(axes, labels)
    triads, single = table[table["axis"] == "all"], table[table["axis"] != "all"]
    for row in triads[triads.model == "extended"].itertuples():
        place = labels.index(row.imu)
        axes.plot([place - 0.3, place + 0.3], [row.noise] * 2, color=BLACK, linewidth=1.5,
                  solid_capstyle="butt", zorder=2)  # fmt: skip
        half = row.half_width
        axes.fill_between([place - 0.45, place + 0.45], 1 - half, 1 + half, **BAND)
    for model, shift in (("base", -0.17), ("extended", 0.17)):
        style = MODELS[model]
        for part, size, mark in ((single, 0.7 * large, "_"), (triads, large, style["marker"])):
            part = part[part.model == model]
            places = np.array([labels.index(name) for name in part.imu]) + shift
            axes.plot(places, part.rms, linestyle="", marker=mark, markersize=size,
                      color=style["color"], zorder=3)  # fmt: skip
    _log_scale(axes, [*table.rms, *table.noise, *(1 - triads.half_width)])


def _log_scale(axes, values):
    """A log axis of plain numbers, also where it spans far less than a decade."""
    values = np.array(values)[np.isfinite(values)]
    low, high = values.min(), values.max()
    room = (high / low) ** 0.08
    axes.set(yscale="log", ylim=(low / room, high * room))
    if high / low < 8:
        axes.yaxis.set_major_locator(ticks.MaxNLocator(5, steps=[1, 2, 5, 10]))
        axes.yaxis.set_minor_locator(ticks.NullLocator())
    axes.yaxis.set_major_formatter(lambda y, _: f"{y:.10g}")


@styled
def gain_figure(table: pd.DataFrame, footer=()):
    """Nats gained on held-out time by each cause in the order of adoption, and by all."""
    figure = new_figure(footer, PAGE, 0.8 + 0.25 * len(table))
    axes = figure.subplots()
    places = np.arange(len(table))
    total = (table.sensors == "model").to_numpy()
    for chosen, color in ((~total, BLUE), (total, BLACK)):
        part = table[chosen]
        axes.barh(places[chosen], part.gain, 0.55, color=color, alpha=0.3, lw=0)
        axes.errorbar(part.gain, places[chosen], xerr=2 * part.se, linestyle="", marker="s",
                      color=color, markersize=4, elinewidth=1)  # fmt: skip
    axes.plot(table.adopted, places + 0.2, linestyle="", marker="D", color=ORANGE, markersize=4,
              markerfacecolor="white")  # fmt: skip
    axes.plot(table.placebo, places, linestyle="", marker="x", color=VERMILLION, markersize=5)
    axes.axvline(0, color=BLACK, linewidth=0.6)
    if total.any() and not total.all():
        axes.axhline(places[total][0] - 0.5, color=BLACK, linewidth=0.6)
    axes.set_yticks(places, [_row_name(row) for row in table.itertuples()])
    axes.set(xlabel="nats gained on held-out time (whiskers: 2 standard errors)")
    axes.set_ylim(len(table) - 0.5, -0.5)
    _gain_scale(axes, table)
    handles = axes.plot([], [], "s", color=BLUE, label="beside all other causes")
    if table.adopted.notna().any():
        handles += axes.plot([], [], "D", color=ORANGE, markerfacecolor="white",
                             label="when it was adopted")  # fmt: skip
    if table.placebo.notna().any():
        handles += axes.plot([], [], "x", color=VERMILLION,
                             label="placebo: its numbers at other IMUs")  # fmt: skip
    legend_above(figure, handles)
    return figure


def _row_name(row) -> str:
    if row.sensors == "model":
        return f"all, {row.what}"
    whose = "all IMUs" if row.sensors == "all" else f"IMU {row.sensors}"
    return f"{spelled(row.what)} ({plain(whose if len(whose) < 24 else f'{whose[:22]}…')})"


def _gain_scale(axes, table):
    # a whisker may leave the axes: a handful of wild readings has an error as large as its gain
    ends = pd.concat([1.3 * table.gain, table.placebo, table.adopted]).dropna()
    axes.grid(False, axis="y")
    if ends.abs().max() < 30 * max(table.gain.abs().min(), 30):
        axes.margins(x=0.06)
        return
    axes.set_xscale("symlog", linthresh=100, linscale=0.7)
    _ticks_at_powers(axes, ends, 2, 5, 1.5, _power)
    axes.set_xlim(min(2 * ends.min(), -30), 2 * ends.max())


def _power(value, _) -> str:
    """'−10⁴', and small numbers as they are."""
    if abs(value) < 1000:
        return f"{value:.0f}".replace("-", "−")
    return f"{'−' if value < 0 else ''}{power_of_ten(round(np.log10(abs(value))))}"


@styled
def detectable_figure(table: pd.DataFrame, footer=()):
    """Smallest size that would be named, best to worst IMU, and what was found, over the usual."""
    figure = new_figure(footer, PAGE, 0.75 + 0.2 * len(table))
    axes = figure.subplots()
    for place, row in enumerate(table.itertuples()):
        ends = row.best / row.typical, row.worst / row.typical
        axes.plot(ends, (place, place), color=BLUE, linewidth=4, solid_capstyle="butt")
        factor, unit = shown_in(unit_shown(row.effect, "", row.unit), row.worst)[-1]
        said = (
            f"{number(factor * row.best, 2)} (IMU {plain(row.best_imu)}) to"
            f" {number(factor * row.worst, 2)} (IMU {plain(row.worst_imu)}) {unit}"
        )
        axes.annotate(said, (1.01, place), xycoords=("axes fraction", "data"), size=6.5,
                      va="center")  # fmt: skip
    axes.plot(table.found / table.typical, range(len(table)), "o", color=VERMILLION, label="found")
    axes.set_yticks(range(len(table)), [spelled(effect) for effect in table.effect])
    axes.set(xscale="log", xlabel="size over that of a common chip", ylim=(len(table) - 0.4, -0.6))
    axes.legend()
    return figure


@styled
def position_figure(table: pd.DataFrame, footer=()):
    """Where the extended model puts each triad, from where the plain model does, with 95 %."""
    figure = new_figure(footer, PAGE, 2.4)
    panels = figure.subplots(1, 3, sharey=True)
    labels = list(dict.fromkeys(table.imu))
    factor, unit = (1e6, "µm") if table.change.abs().max() < 2e-3 else (1e3, "mm")
    for axes, axis in zip(panels, "xyz", strict=True):
        part = table[table["axis"] == axis]
        places = np.array([labels.index(name) for name in part.imu])
        size = imu_ticks(axes, labels, 10)
        for model, shift, moved in (("base", -0.15, 0.0), ("extended", 0.15, 1.0)):
            half = factor * SURE * part[f"{model}_sd"]
            axes.errorbar(places + shift, factor * (moved * part.change), half, linestyle="",
                          markersize=0.8 * size, elinewidth=0.9, **MODELS[model])  # fmt: skip
        axes.axhline(0, color=BLACK, linewidth=0.5)
        axes.set_title(axis)
    panels[0].set_ylabel(f"change of position ({unit})")
    legend_above(figure, panels[0].get_legend_handles_labels()[0])
    return figure


@styled
def separability_figure(table: pd.DataFrame, footer=()):
    """Matrix of squared canonical correlations: largest below the diagonal, mean above."""
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
    """The added-variable plot of a cause, and panels of its own physics."""
    count = int(table.panel.max()) + 1
    figure = new_figure(footer, PAGE, 2.35)
    panels = figure.subplots(1, count, squeeze=False)[0]
    for axes, (place, part) in zip(panels, table.groupby("panel"), strict=True):
        _means(axes, part.sort_values("x"), added=place == 0)
        axes.set_xlabel(part.x_label.iloc[0], size=7)
        axes.set_ylabel(part.y_label.iloc[0], size=7)
        axes.set_title(plain(part.title.iloc[0]), size=7.5)
        axes.tick_params(labelsize=6.5)
        axes.locator_params(nbins=5, steps=[1, 2, 5, 10])
    return figure


def _means(axes, table, added: bool):
    """Means of bins with two standard errors, and the line on which they ought to be.

    ``added``: whether that is the diagonal of an added-variable plot; else the fitted cause.
    """
    if added:
        ends = np.array([table.x.min(), table.x.max()])
        axes.plot(ends, ends, color=BLACK, linewidth=0.9, zorder=1)
    else:
        axes.plot(table.x, table.model, color=BLUE, linewidth=1.1, zorder=1)
    for (name, part), look in zip(table.groupby("series", dropna=False), LOOKS, strict=False):
        axes.errorbar(part.x, part.y, 2 * part.se, linestyle="", markersize=3.2, elinewidth=0.7,
                      marker=look["marker"], color=look["color"], label=name)  # fmt: skip
    if not added:
        axes.axhline(0, color=BLACK, linewidth=0.4)
    elif table.series.nunique() > 1:
        axes.legend(fontsize=6)
