"""Paper 2017: what position errors do to the angular rate, and how well ML-BCD finds them."""

import matplotlib
import numpy as np
import pandas as pd

from imuarray.geometry import array_from_config
from imuarray.pictures.style import BLACK, GREY, MARKERS, logarithmic
from imuarray_papers.figures.style import drawing, legend_items, level, points, scale_line

MICROMETRE = 1e-6  # m, the level that the paper's conclusions speak of
RATE = r"Angular rate $\|\omega\|$ (deg/s)"


def _footer(errors: pd.DataFrame, settings: dict) -> list[str]:
    return [scale_line(settings, f"{errors.realisations.max()} realisations per point")]


def figure_2017_fig3(rates: pd.DataFrame, settings: dict):
    """RMSE of the angular rate over |omega|, a line for each position error; log-log.

    ``rates``: `calibration/rate_error.csv`. Plotted are the columns series (array, gyroscopes,
    unsaturated), position_sd_m, angular_rate_dps, rmse_dps, rmse_se_dps; ``unsaturated`` is what
    the gyroscopes' average would be if none ever saturated, sigma_g / sqrt(G).
    """
    gyroscopes = array_from_config(settings["array"]).gyroscopes
    least = settings["noise"]["gyroscope_sd_dps"] / np.sqrt(gyroscopes)
    array = rates[["position_sd_m", "angular_rate_dps"]].assign(
        series="array", rmse_dps=rates.array_rmse_dps, rmse_se_dps=rates.array_rmse_se_dps
    )
    means = _gyroscopes_average(rates).assign(series="gyroscopes")
    unsaturated = means.assign(series="unsaturated", rmse_dps=least, rmse_se_dps=0.0)
    columns = ["series", "position_sd_m", "angular_rate_dps", "rmse_dps", "rmse_se_dps"]
    table = pd.concat([array, means, unsaturated], ignore_index=True)[columns]
    table.attrs["digits"] = {"rmse_dps": 4}
    saturation = settings["paper2017"]["gyroscope_range_dps"]
    return drawing(_draw_fig3, _footer(rates, settings), height=3.2, saturation=saturation), table


def _gyroscopes_average(rates: pd.DataFrame) -> pd.DataFrame:
    """RMSE of the gyroscopes' average and its error by rate.

    It does not know the positions: its mean squared errors are averaged over position errors.
    """
    square = rates.gyroscopes_rmse_dps**2
    error = 2 * rates.gyroscopes_rmse_dps * rates.gyroscopes_rmse_se_dps
    groups = pd.DataFrame(
        {"angular_rate_dps": rates.angular_rate_dps, "square": square, "error": error**2}
    ).groupby("angular_rate_dps", as_index=False)
    means = groups.mean().assign(rmse_dps=lambda x: np.sqrt(x.square))
    counts = groups.size()["size"]
    return means.assign(rmse_se_dps=np.sqrt(means.error / counts) / (2 * means.rmse_dps))


def _draw_fig3(figure, table, saturation):
    axes = figure.subplots()
    array = table[table.series == "array"]
    for index, (sd, rows) in enumerate(array.groupby("position_sd_m", sort=False)):
        label = rf"$\sigma_r = {'0' if sd == 0 else _power(sd)}$ m"
        points(axes, rows.angular_rate_dps, rows.rmse_dps, rows.rmse_se_dps, index, label=label)
    averages = {
        "average of the gyroscopes": ("gyroscopes", (0, (5, 2))),
        "the same without saturation": ("unsaturated", (0, (1, 2))),
    }
    for label, (name, dashes) in averages.items():
        rows = table[table.series == name]
        axes.plot(rows.angular_rate_dps, rows.rmse_dps, color=BLACK, linestyle=dashes, label=label)
    axes.axvline(saturation, color=GREY, linewidth=0.8)
    axes.annotate(
        f"saturation\n{saturation:g} deg/s", (saturation, 0.5),
        xycoords=("data", "axes fraction"), xytext=(-3, 0), textcoords="offset points",
        ha="right", va="top", size=7, color="0.3",
    )  # fmt: skip
    logarithmic(axes, RATE, "RMSE of the angular rate (deg/s)")
    axes.legend(*legend_items(axes, averages), loc="upper left")


def figure_2017_fig4(errors: pd.DataFrame, settings: dict):
    """RMSE of the positions over N, a line for each number of iterations; log-log.

    ``errors``: `calibration/position_error_samples.csv`. Plotted are the columns series (bcd,
    reference), iterations, samples, rmse_m, rmse_se_m; the reference is c N^-1/2, with c the
    geometric mean of the last line's RMSE N^1/2 at N >= 10.
    """
    lines = errors[["iterations", "samples", "rmse_m", "rmse_se_m"]].assign(series="bcd")
    last = lines[lines.iterations == lines.iterations.max()]
    far = last[last.samples >= min(10, last.samples.max())]
    constant = np.exp(np.mean(np.log(far.rmse_m * np.sqrt(far.samples))))
    reference = last.assign(
        series="reference", rmse_m=constant / np.sqrt(last.samples), rmse_se_m=0.0
    )
    table = pd.concat([lines, reference], ignore_index=True)
    table = table.sort_values(["series", "iterations", "samples"], ignore_index=True)
    table = table[["series", "iterations", "samples", "rmse_m", "rmse_se_m"]]
    table.attrs["digits"] = {"rmse_m": 4}  # thousands of iterations enlarge what is rounded
    return drawing(_draw_fig4, _footer(errors, settings), height=3.5), table


def _draw_fig4(figure, table):
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
    logarithmic(axes, "Time samples $N$ (count)", "RMSE of the positions (m)")
    axes.set_ylim(bottom=min(0.7 * MICROMETRE, 0.7 * table.rmse_m.min()))
    figure.legend(
        *legend_items(axes, [r"$N^{-1/2}$"]), loc="outside upper center", ncols=4,
        title="Iterations", title_fontsize=7,
    )  # fmt: skip


def figure_2017_fig5(errors: pd.DataFrame, settings: dict):
    """RMSE of the positions over |omega|, a line for each |omega_dot|; log-log.

    ``errors``: `calibration/position_error_motion.csv`, of which all that is plotted is a column.
    """
    counts = f"N = {errors.samples.max()} time samples, {errors.iterations.max()} iterations"
    columns = ["angular_acceleration_dps2", "angular_rate_dps", "rmse_m", "rmse_se_m"]
    # degrees went through radians on the way
    table = errors[columns].round({name: 6 for name in columns[:2]})
    table.attrs["digits"] = {"rmse_m": 4}
    footer = [*_footer(errors, settings), counts]
    start = settings["paper2017"]["position_sd"]
    return drawing(_draw_fig5, footer, height=3.0, start=start), table


def _draw_fig5(figure, table, start):
    axes = figure.subplots()
    for index, (value, rows) in enumerate(table.groupby("angular_acceleration_dps2")):
        label = f"{value:.0f}" if value < 1e4 else f"${_power(value)}$"
        points(axes, rows.angular_rate_dps, rows.rmse_m, rows.rmse_se_m, index, label=label)
    level(axes, start, r"start ($\sigma_r$)", color=GREY)
    logarithmic(axes, RATE, "RMSE of the positions (m)")
    axes.legend(loc="lower left", title=r"$\|\dot{\omega}\|$ (deg/s$^2$)", title_fontsize=7)


def _power(value: float) -> str:
    """TeX: 1e-5 as a power of ten, other numbers as a product with one."""
    factor, exponent = f"{value:.0e}".split("e")
    power = f"10^{{{int(exponent)}}}"
    return power if factor == "1" else rf"{factor}\times{power}"
