"""Paper 2017: what position errors do to the angular rate, and how well ML-BCD finds them."""

from __future__ import annotations

import matplotlib
import numpy as np
import pandas as pd

from imuarray.figures.style import BLACK, GREY, MARKERS, legend_items, look, new_figure, styled

MICROMETRE = 1e-6  # m, the level that the paper's conclusions speak of


def fig3_table(rates: pd.DataFrame, gyroscope_sd_dps: float, gyroscopes: int) -> pd.DataFrame:
    """The plotted numbers of figure 3 from `calibration/rate_error.csv`.

    Columns: series (array, gyroscopes, unsaturated), position_sd_m, angular_rate_dps,
    rmse_dps, rmse_se_dps. The gyroscopes' average does not know the positions: its mean
    squared errors are averaged over all position errors. ``unsaturated`` is what it would
    be if no gyroscope ever saturated, sigma_g / sqrt(G).
    """
    array = rates[["position_sd_m", "angular_rate_dps"]].assign(
        series="array", rmse_dps=rates.array_rmse_dps, rmse_se_dps=rates.array_rmse_se_dps
    )
    square = rates.gyroscopes_rmse_dps**2
    error = 2 * rates.gyroscopes_rmse_dps * rates.gyroscopes_rmse_se_dps
    groups = pd.DataFrame(
        {"angular_rate_dps": rates.angular_rate_dps, "square": square, "error": error**2}
    ).groupby("angular_rate_dps", as_index=False)
    means = groups.mean().assign(rmse_dps=lambda x: np.sqrt(x.square))
    counts = groups.size()["size"]
    means["rmse_se_dps"] = np.sqrt(means.error / counts) / (2 * means.rmse_dps)
    level = means[["angular_rate_dps"]].assign(
        series="unsaturated", rmse_dps=gyroscope_sd_dps / np.sqrt(gyroscopes), rmse_se_dps=0.0
    )
    joined = pd.concat([array, means.assign(series="gyroscopes"), level], ignore_index=True)
    return joined[["series", "position_sd_m", "angular_rate_dps", "rmse_dps", "rmse_se_dps"]]


@styled
def fig3(table: pd.DataFrame, saturation_dps: float, footer=()):
    """RMSE of the angular rate over |omega|, a line for each position error; log-log."""
    figure = new_figure(footer, height=3.2)
    axes = figure.subplots()
    array = table[table.series == "array"]
    for index, (sd, rows) in enumerate(array.groupby("position_sd_m", sort=False)):
        label = rf"$\sigma_r = {'0' if sd == 0 else _power(sd)}$ m"
        axes.errorbar(
            rows.angular_rate_dps, rows.rmse_dps, rows.rmse_se_dps, label=label,
            markerfacecolor="none", **look(index),
        )  # fmt: skip
    averages = {
        "average of the gyroscopes": ("gyroscopes", (0, (5, 2))),
        "the same without saturation": ("unsaturated", (0, (1, 2))),
    }
    for label, (name, dashes) in averages.items():
        rows = table[table.series == name]
        axes.plot(rows.angular_rate_dps, rows.rmse_dps, color=BLACK, linestyle=dashes, label=label)
    axes.axvline(saturation_dps, color=GREY, linewidth=0.8)
    axes.annotate(
        f"saturation\n{saturation_dps:g} deg/s", (saturation_dps, 0.5),
        xycoords=("data", "axes fraction"), xytext=(-3, 0), textcoords="offset points",
        ha="right", va="top", size=7, color="0.3",
    )  # fmt: skip
    axes.set(
        xscale="log", yscale="log", xlabel=r"Angular rate $\|\omega\|$ (deg/s)",
        ylabel="RMSE of the angular rate (deg/s)",
    )  # fmt: skip
    axes.legend(*legend_items(axes, averages), loc="upper left")
    return figure


def fig4_table(errors: pd.DataFrame) -> pd.DataFrame:
    """The plotted numbers of figure 4 from `calibration/position_error_samples.csv`.

    Columns: series (bcd, reference), iterations, samples, rmse_m, rmse_se_m. The reference
    is c N^-1/2, with c the geometric mean of the last line's RMSE N^1/2 at N >= 10.
    """
    lines = errors[["iterations", "samples", "rmse_m", "rmse_se_m"]].assign(series="bcd")
    last = lines[lines.iterations == lines.iterations.max()]
    far = last[last.samples >= min(10, last.samples.max())]
    constant = np.exp(np.mean(np.log(far.rmse_m * np.sqrt(far.samples))))
    reference = last.assign(
        series="reference", rmse_m=constant / np.sqrt(last.samples), rmse_se_m=0.0
    )
    joined = pd.concat([lines, reference], ignore_index=True)
    joined = joined.sort_values(["series", "iterations", "samples"], ignore_index=True)
    return joined[["series", "iterations", "samples", "rmse_m", "rmse_se_m"]]


@styled
def fig4(table: pd.DataFrame, footer=()):
    """RMSE of the positions over N, a line for each number of iterations; log-log."""
    figure = new_figure(footer, height=3.5)
    axes = figure.subplots()
    groups = list(table[table.series == "bcd"].groupby("iterations"))
    # one hue would not do for ten lines; viridis runs evenly for every kind of eye
    colours = matplotlib.colormaps["viridis"](np.linspace(0.92, 0.0, len(groups)))
    for index, (iterations, rows) in enumerate(groups):
        axes.errorbar(
            rows.samples, rows.rmse_m, rows.rmse_se_m, color=colours[index], label=str(iterations),
            marker=MARKERS[index % len(MARKERS)], markerfacecolor="none",
        )  # fmt: skip
    rows = table[table.series == "reference"]
    axes.plot(rows.samples, rows.rmse_m, color=BLACK, linestyle=(0, (5, 2)), label=r"$N^{-1/2}$")
    axes.axhline(MICROMETRE, color=GREY, linewidth=0.8)
    axes.annotate(
        "1 µm", (rows.samples.min(), MICROMETRE), xytext=(0, 2), textcoords="offset points",
        size=7, color="0.3",
    )  # fmt: skip
    axes.set(
        xscale="log", yscale="log", xlabel="Time samples $N$ (count)",
        ylabel="RMSE of the positions (m)",
    )  # fmt: skip
    axes.set_ylim(bottom=min(0.7 * MICROMETRE, 0.7 * table.rmse_m.min()))
    figure.legend(
        *legend_items(axes, [r"$N^{-1/2}$"]), loc="outside upper center", ncols=4,
        title="Iterations", title_fontsize=7,
    )  # fmt: skip
    return figure


def fig5_table(errors: pd.DataFrame) -> pd.DataFrame:
    """The plotted numbers of figure 5 from `calibration/position_error_motion.csv`."""
    columns = ["angular_acceleration_dps2", "angular_rate_dps", "rmse_m", "rmse_se_m"]
    # degrees went through radians on the way
    return errors[columns].assign(
        angular_acceleration_dps2=errors.angular_acceleration_dps2.round(6),
        angular_rate_dps=errors.angular_rate_dps.round(6),
    )


@styled
def fig5(table: pd.DataFrame, position_sd: float, footer=()):
    """RMSE of the positions over |omega|, a line for each |omega_dot|; log-log.

    ``position_sd`` (m): the error of the starting positions, drawn as a level.
    """
    figure = new_figure(footer, height=3.0)
    axes = figure.subplots()
    for index, (value, rows) in enumerate(table.groupby("angular_acceleration_dps2")):
        axes.errorbar(
            rows.angular_rate_dps, rows.rmse_m, rows.rmse_se_m, label=_number(value),
            markerfacecolor="none", **look(index),
        )  # fmt: skip
    axes.axhline(position_sd, color=GREY, linewidth=0.8)
    axes.annotate(
        r"start ($\sigma_r$)", (0.99, position_sd), xycoords=("axes fraction", "data"),
        xytext=(0, 2), textcoords="offset points", size=7, color="0.3", ha="right",
    )  # fmt: skip
    axes.set(
        xscale="log", yscale="log", xlabel=r"Angular rate $\|\omega\|$ (deg/s)",
        ylabel="RMSE of the positions (m)",
    )  # fmt: skip
    axes.legend(loc="lower left", title=r"$\|\dot{\omega}\|$ (deg/s$^2$)", title_fontsize=7)
    return figure


def _power(value: float) -> str:
    """TeX: 1e-5 as a power of ten, other numbers as a product with one."""
    factor, exponent = f"{value:.0e}".split("e")
    power = f"10^{{{int(exponent)}}}"
    return power if factor == "1" else rf"{factor}\times{power}"


def _number(value: float) -> str:
    return f"{value:.0f}" if value < 1e4 else f"${_power(value)}$"
