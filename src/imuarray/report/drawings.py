"""Drawings of one recording's diagnosis: what is wrong, and what its causes gain."""

import matplotlib.ticker as ticks
import numpy as np
import pandas as pd

from imuarray.model.effects import KINDS
from imuarray.pictures.board import plain
from imuarray.pictures.style import BLACK, BLUE, GREY, ORANGE, PAGE, VERMILLION, new_figure, styled
from imuarray.words import number, power_of_ten, spelled

MODELS = {"base": {"color": VERMILLION, "marker": "o"}, "extended": {"color": BLUE, "marker": "s"}}
NAMES = {"base": "plain model", "extended": "extended model"}
PLAIN = 0.05  # p-value below which a mark is filled


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
    """Every check as a dot beside the band of simulations, in sds of that band; both models.

    ``table``: `imuarray.report.numbers.discrepancy_table`.
    """
    names = list(dict.fromkeys(table.label))
    figure = new_figure(footer, PAGE, 0.75 + 0.23 * len(names))
    for axes, part in by_kind(figure, table, sharey=True):
        axes.axvline(0, color=BLACK, linewidth=0.5)
        for model, shift in (("base", -0.16), ("extended", 0.16)):
            for row in part[part.model == model].itertuples():
                _check(axes, row, names.index(row.label), shift)
        axes.set(xlabel="sds of the simulated band", ylim=(len(names) - 0.4, -0.6))
        _wide_scale(axes, part.standardised)
    axes = figure.axes[0]
    axes.set_yticks(range(len(names)), names)
    handles = _model_handles(axes, 4.5)
    handles += axes.plot([], [], linestyle="", marker="o", color=BLACK, markerfacecolor="white",
                         markersize=4.5, label=f"open: p > {PLAIN:g}")  # fmt: skip
    handles.append(axes.fill_between([], [], [], color="0.87", lw=0, label="95 % of simulations"))
    legend_above(figure, handles)
    return figure


def _check(axes, row, place, shift):
    """A model's dot; and the band, that of the plain model."""
    if row.model == "base":
        axes.fill_between([-row.limit, row.limit], place - 0.36, place + 0.36, color="0.87", lw=0)
    style = MODELS[row.model]
    face = style["color"] if row.p_value <= PLAIN else "white"
    axes.plot(row.standardised, place + shift, linestyle="", markersize=4.5,
              markerfacecolor=face, **style)  # fmt: skip


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
    axes.xaxis.set_major_formatter(ticks.FuncFormatter(text))


def _model_handles(axes, size) -> list:
    """A mark of each model for a legend."""
    return [
        axes.plot([], [], linestyle="", markersize=size, label=NAMES[model], **style)[0]
        for model, style in MODELS.items()
    ]


@styled
def residual_figure(table: pd.DataFrame, footer=()):
    """rms residual of every IMU before and after, in declared noise sds.

    ``table``: `imuarray.report.numbers.residual_table`.
    """
    figure = new_figure(footer, PAGE, 2.7)
    for axes, part in by_kind(figure, table):
        _residuals(axes, part)
    axes = figure.axes[0]
    axes.set_ylabel("rms residual / declared noise")
    handles = _model_handles(axes, 5)
    handles += axes.plot([], [], "_", color=GREY, markersize=5, label="single axes")
    handles += axes.plot([], [], "-", color=BLACK, linewidth=1.5, label="noise, extended model")
    handles.append(axes.fill_between([], [], [], color="0.87", lw=0, label="as simulated, 95 %"))
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
        axes.fill_between([place - 0.45, place + 0.45], 1 - row.half_width, 1 + row.half_width,
                          color="0.87", lw=0)  # fmt: skip
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
    axes.yaxis.set_major_formatter(ticks.FuncFormatter(lambda y, _: f"{y:.10g}"))


@styled
def gain_figure(table: pd.DataFrame, footer=()):
    """Nats gained on held-out time by each cause in the order of adoption, and by all.

    ``table``: `imuarray.report.numbers.gain_table`.
    """
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
    """Smallest size that would be named, best to worst IMU, and what was found, over the usual.

    ``table``: `imuarray.report.numbers.detectable_table`.
    """
    figure = new_figure(footer, PAGE, 0.75 + 0.2 * len(table))
    axes = figure.subplots()
    for place, row in enumerate(table.itertuples()):
        ends = row.best / row.typical, row.worst / row.typical
        axes.plot(ends, (place, place), color=BLUE, linewidth=4, solid_capstyle="butt")
        said = (
            f"{number(row.best, 2)} (IMU {plain(row.best_imu)}) to {number(row.worst, 2)} (IMU"
            f" {plain(row.worst_imu)}) {row.unit if row.unit != '1' else ''}"
        )
        axes.annotate(said, (1.01, place), xycoords=("axes fraction", "data"), size=6.5,
                      va="center")  # fmt: skip
    axes.plot(table.found / table.typical, range(len(table)), "o", color=VERMILLION, label="found")
    axes.set_yticks(range(len(table)), [spelled(effect) for effect in table.effect])
    axes.set(xscale="log", xlabel="size over that of a common chip", ylim=(len(table) - 0.4, -0.6))
    axes.legend()
    return figure
