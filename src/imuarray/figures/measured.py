"""Measured data: residuals beside the simulation's, agreement between recordings, noise."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.special import ndtr

from imuarray.figures.style import (
    BLACK,
    BLUE,
    PAGE,
    VERMILLION,
    look,
    new_figure,
    styled,
)

SOURCES = {
    "measured": {"color": VERMILLION, "marker": "o", "linestyle": "-"},
    "simulated": {"color": BLUE, "marker": "s", "linestyle": (0, (4, 1.5))},
}
QUANTITIES = {"specific_force": "accelerometers", "angular_rate": "gyroscopes"}


def _rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@styled
def residual_figure(table: pd.DataFrame, shape: pd.DataFrame, footer=()):
    """Standardised residuals, accelerometers above gyroscopes: distribution, sensors, motion.

    ``table`` and ``shape`` as `imuarray.measured.residuals.compare` returns them.
    """
    figure = new_figure(footer, PAGE, 4.3)
    axes = figure.subplots(2, 4)
    for row, (quantity, name) in zip(axes, QUANTITIES.items(), strict=True):
        chosen = table[table.quantity == quantity]
        _distribution(row[0], shape[shape.quantity == quantity], name)
        _sensors(row[1], chosen[chosen["by"] == "axis"])
        _against(row[2], chosen[chosen["by"] == "angular_rate"], np.degrees(1.0), "|ω| (deg/s)")
        _against(row[3], chosen[chosen["by"] == "angular_acceleration"], 1.0, "|ω'| (rad/s²)")
        row[1].set_ylabel("rms (assumed σ)")
    handles = [axes[0, 0].plot([], [], label=source, **style)[0]
               for source, style in SOURCES.items()]  # fmt: skip
    figure.legend(handles=handles, loc="outside upper center", ncols=2)
    return figure


def _distribution(axes, shape, name):
    for source, style in SOURCES.items():
        part = shape[(shape.source == source) & (shape.density > 0)]
        centre = (part.low + part.high) / 2
        axes.plot(centre, part.density, color=style["color"], linestyle=style["linestyle"])
    grid = np.linspace(-5, 5, 101)
    axes.plot(grid, np.exp(-0.5 * grid**2) / np.sqrt(2 * np.pi), color=BLACK, linewidth=0.5)
    axes.set(
        yscale="log", ylim=(1e-6, 1), xscale="symlog", xlabel="residual (assumed σ)",
        ylabel=f"{name}: density",
    )  # fmt: skip
    axes.set_xticks([-100, -1, 1, 100], ["−100", "−1", "1", "100"])


def _sensors(axes, table):
    labels = list(dict.fromkeys(table.triad.astype(str)))
    for source, style in SOURCES.items():
        part = table[table.source == source]
        for i, axis in enumerate("xyz"):
            values = part[part.axis == axis].rms.to_numpy()
            places = np.arange(len(values)) + 0.22 * (i - 1)
            axes.plot(places, values, linestyle="", marker=style["marker"], markersize=2.5,
                      color=style["color"])  # fmt: skip
    axes.axhline(1, color=BLACK, linewidth=0.5)
    axes.set(yscale="log", xlabel="IMU (x, y, z)")
    axes.set_xticks(range(len(labels)), labels)


def _against(axes, table, factor, label):
    for source, style in SOURCES.items():
        bins = table[table.source == source].groupby("bin_low")
        centre = factor * (bins.bin_low.first() + bins.bin_high.first()) / 2
        size = bins.rms.apply(_rms)
        axes.plot(centre, size, markersize=3, **style)
    axes.axhline(1, color=BLACK, linewidth=0.5)
    axes.set(yscale="log", xlabel=label)


@styled
def agreement_figure(summary: pd.DataFrame, pairs: pd.DataFrame, footer=()):
    """How far recordings of one board lie apart, in claimed widths, and the intervals' coverage.

    ``summary``, ``pairs``: one row each per number of samples and assumed sigma_a (and pair).
    """
    figure = new_figure(footer, PAGE, 2.7)
    left, middle, right = figure.subplots(1, 3)
    most = summary.samples.max()
    assumed = list(dict.fromkeys(summary.assumed.astype(str)))
    for index, name in enumerate(assumed):
        style = look(index)
        part = pairs[(pairs.samples == most) & (pairs.assumed.astype(str) == name)]
        size = np.sort(part.z.abs())
        share = (np.arange(size.size) + 0.5) / size.size
        left.plot(size, share, label=_assumed(name, summary, most), color=style["color"],
                  linestyle=style["linestyle"])  # fmt: skip
        rows = summary[summary.assumed.astype(str) == name].sort_values("samples")
        middle.plot(rows.samples, 1e6 * rows.spread_m, **style, markersize=4)
        middle.plot(rows.samples, 1e6 * rows.claimed_m, color=style["color"], linewidth=0.7,
                    linestyle=(0, (1, 1)), marker=style["marker"], markersize=4,
                    markerfacecolor="none")  # fmt: skip
        for column, nominal in (("coverage_50", 50), ("coverage_95", 95)):
            right.plot(rows.samples, 100 * rows[column], **style, markersize=4,
                       markerfacecolor="none" if nominal == 50 else None)  # fmt: skip
    grid = np.geomspace(0.03, 100, 200)
    left.plot(grid, 2 * ndtr(grid) - 1, color=BLACK, linewidth=1, label="if widths were right")
    left.set(xscale="log", xlabel="|z| between recordings", ylabel="share of differences")
    left.set_title(f"$T = {most}$, {len(size)} differences")
    middle.set(xscale="log", yscale="log", xlabel="samples $T$", ylabel="sd (µm)")
    middle.set_title("between recordings (filled)\nand claimed (open, dotted)")
    for nominal in (50, 95):
        right.axhline(nominal, color=BLACK, linewidth=0.6)
    right.set(xscale="log", ylim=(0, 102), xlabel="samples $T$", ylabel="covered (%)")
    right.set_title("95 % intervals (filled)\nand 50 % intervals (open)")
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def _assumed(name, summary, most):
    row = summary[(summary.assumed.astype(str) == name) & (summary.samples == most)].iloc[0]
    if name == "residual":
        return f"$\\sigma_a$ from the residual ({row.accelerometer_sd:.2f} m/s²)"
    return f"$\\sigma_a$ = {name} m/s²"


@styled
def noise_figure(allan: pd.DataFrame, papers: dict[str, float], footer=()):
    """Allan deviation of the still poses, every axis of every IMU, and the papers' white noise.

    ``papers``: sd of one reading by sensor, SI units, drawn as tau^(-1/2).
    """
    figure = new_figure(footer, PAGE, 2.8)
    titles = {
        "specific_force": (1e3, "accelerometers (mm/s²)"),
        "angular_rate": (np.degrees(1.0), "gyroscopes (deg/s)"),
    }
    for axes, (sensor, (factor, title)) in zip(figure.subplots(1, 2), titles.items(), strict=True):
        part = allan[allan.sensor == sensor]
        for i, axis in enumerate("xyz"):
            for number, (_, line) in enumerate(part[part.axis == axis].groupby("triad")):
                axes.plot(line.tau_s, factor * line.deviation, linewidth=0.6,
                          **look(i, "marker"), label=axis if number == 0 else None)  # fmt: skip
        taus = np.sort(part.tau_s.unique())
        white = factor * papers[sensor] * np.sqrt(taus[0] / taus)
        axes.plot(taus, white, color=BLACK, linewidth=1.2, label="papers' σ, white")
        axes.set(xscale="log", yscale="log", xlabel="averaging time τ (s)",
                 ylabel=f"Allan deviation, {title}")  # fmt: skip
        axes.legend()
    return figure
