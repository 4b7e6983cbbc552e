"""What a diagnosis draws: what is wrong, each cause, what the extended model gains."""

import matplotlib.ticker as ticks
import numpy as np
import pandas as pd

from imuarray.diagnosis.plain import power_of_ten
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.words import words
from imuarray.figures.style import (
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
from imuarray.model.effects import KINDS
from imuarray.report.pictures import plain

MODELS = {
    "base": {"color": VERMILLION, "marker": "o"},
    "extended": {"color": BLUE, "marker": "s"},
}
NAMES = {"base": "papers' model", "extended": "extended model"}
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


@styled
def discrepancy_figure(table: pd.DataFrame, footer=()):
    """Every check as a dot beside the band of simulations, in sds of that band; both models.

    ``table``: `imuarray.report.numbers.discrepancy_table`.
    """
    names = list(dict.fromkeys(table.label))
    kinds = [kind for kind in KINDS if kind in set(table.kind)]
    figure = new_figure(footer, PAGE, 0.75 + 0.23 * len(names))
    panels = figure.subplots(1, len(kinds), sharey=True, squeeze=False)[0]
    for axes, kind in zip(panels, kinds, strict=True):
        part = table[table.kind == kind]
        _bands(axes, part[part.model == "base"], names)
        for model, shift in (("base", -0.16), ("extended", 0.16)):
            _dots(axes, part[part.model == model], names, shift, MODELS[model])
        axes.set(xlabel="sds of the simulated band", ylim=(len(names) - 0.4, -0.6))
        axes.set_title(f"{kind}s")
        _wide_scale(axes, part.standardised)
    panels[0].set_yticks(range(len(names)), names)
    _discrepancy_legend(figure, panels[0])
    return figure


def _bands(axes, table, names):
    for row in table.itertuples():
        place = names.index(row.label)
        axes.fill_between([-row.limit, row.limit], place - 0.36, place + 0.36, color="0.87", lw=0)
    axes.axvline(0, color=BLACK, linewidth=0.5)


def _dots(axes, table, names, shift, style):
    for row in table.itertuples():
        face = style["color"] if row.p_value <= PLAIN else "white"
        axes.plot(row.standardised, names.index(row.label) + shift, linestyle="", markersize=4.5,
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
    low, powers = _signed_powers(values, 1, 3, 3)
    axes.set_xticks([*low, 0, *powers[powers <= 3 * far]])
    axes.xaxis.set_major_formatter(ticks.FuncFormatter(lambda x, _: f"{x:,.0f}".replace("-", "−")))
    axes.xaxis.set_minor_locator(ticks.NullLocator())
    axes.set_xlim(min(-5, 2 * values.min()), max(5, 2 * values.max()))


def _signed_powers(values, first: int, most: int, room: float):
    """Ticks of a symlog axis: (negative, positive) powers of ten, every other one beyond ``most``.

    From 10^first to the largest size; negative ones down to ``room`` times the least value.
    """
    powers = 10.0 ** np.arange(first, np.ceil(np.log10(np.abs(values).max())) + 1)
    powers = powers[:: 1 + (len(powers) > most)]
    return -powers[powers <= room * abs(min(values.min(), 0))][::-1], powers


def _discrepancy_legend(figure, axes):
    handles = _model_handles(axes, 4.5)
    handles += axes.plot([], [], linestyle="", marker="o", color=BLACK, markerfacecolor="white",
                         markersize=4.5, label=f"open: p > {PLAIN:g}")  # fmt: skip
    handles.append(axes.fill_between([], [], [], color="0.87", lw=0, label="95 % of simulations"))
    legend_above(figure, handles)


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
    kinds = [kind for kind in KINDS if kind in set(table.kind)]
    panels = figure.subplots(1, len(kinds), squeeze=False)[0]
    for axes, kind in zip(panels, kinds, strict=True):
        part = table[table.kind == kind]
        _residuals(axes, part)
        axes.set_title(f"{kind}s")
    panels[0].set_ylabel("rms residual / declared noise")
    axes = panels[0]
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
    _gain_legend(figure, axes, table)
    return figure


def _row_name(row) -> str:
    if row.sensors == "model":
        return f"all, {row.what}"
    whose = "all IMUs" if row.sensors == "all" else f"IMU {row.sensors}"
    return f"{words(row.what)} ({plain(whose if len(whose) < 24 else f'{whose[:22]}…')})"


def _gain_scale(axes, table):
    # a whisker may leave the axes: a handful of wild readings has an error as large as its gain
    ends = pd.concat([1.3 * table.gain, table.placebo, table.adopted]).dropna()
    axes.grid(False, axis="y")
    if ends.abs().max() < 30 * max(table.gain.abs().min(), 30):
        axes.margins(x=0.06)
        return
    axes.set_xscale("symlog", linthresh=100, linscale=0.7)
    low, powers = _signed_powers(ends, 2, 5, 1.5)
    axes.set_xticks([*low, 0, *powers])
    axes.xaxis.set_major_formatter(ticks.FuncFormatter(_power))
    axes.set_xlim(min(2 * ends.min(), -30), 2 * ends.max())


def _power(value, _) -> str:
    """'−10⁴', and small numbers as they are."""
    if abs(value) < 1000:
        return f"{value:.0f}".replace("-", "−")
    return f"{'−' if value < 0 else ''}{power_of_ten(round(np.log10(abs(value))))}"


def _gain_legend(figure, axes, table):
    handles = axes.plot([], [], "s", color=BLUE, label="beside all other causes")
    if table.adopted.notna().any():
        handles += axes.plot([], [], "D", color=ORANGE, markerfacecolor="white",
                             label="when it was adopted")  # fmt: skip
    if table.placebo.notna().any():
        handles += axes.plot([], [], "x", color=VERMILLION,
                             label="placebo: its numbers at other IMUs")  # fmt: skip
    legend_above(figure, handles)


@styled
def position_figure(table: pd.DataFrame, footer=()):
    """Where the extended model puts each triad, from where the papers' model does, with 95 %.

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
            axes.errorbar(places + shift, factor * centre, factor * 1.96 * part[f"{model}_sd"],
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
    labels = [words(name) for name in names]
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
