"""Measured data: residuals beside the simulation's, agreement between recordings, noise, rails."""

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.ticker import LogLocator, NullFormatter
from scipy.special import ndtr

from imuarray.figures.style import (
    BLACK,
    BLUE,
    PAGE,
    VERMILLION,
    logarithmic,
    look,
    new_figure,
    styled,
)
from imuarray.figures.tables import Column
from imuarray.measured.positions import agreement, pairwise

SOURCES = {
    "measured": {"color": VERMILLION, "marker": "o", "linestyle": "-"},
    "simulated": {"color": BLUE, "marker": "s", "linestyle": (0, (4, 1.5))},
}
QUANTITIES = {"specific_force": "accelerometers", "angular_rate": "gyroscopes"}
SERIES = {
    "clipped": "gyroscopes at the rail",
    "nominal": "papers' model, nominal positions",
    "calibrated": "papers' model, calibrated positions",
    "delayed": "the same and one delay",
    "board": "sensor model, board of the others",
}
FIRST_ORDER = (
    Column("recording", "recording", "recording"),
    Column("triad", "IMU", "IMU"),
    Column(
        "residual_rms", "residual in still poses (mm/s²)", r"residual (mm/s$^2$)", "{:.2f}", 1e3
    ),
    Column("left_out", "poses left out", "left out"),
    Column("force_sd", "accelerometer noise (mm/s²)", r"acc. (mm/s$^2$)", "{:.1f}", 1e3),
    Column("force_ratio", "/ papers' σa", r"/ $\sigma_a$", "{:.2f}"),
    Column("rate_sd", "gyroscope noise (deg/s)", "gyro. (deg/s)", "{:.3f}", float(np.degrees(1.0))),
    Column("rate_ratio", "/ papers' σg", r"/ $\sigma_g$", "{:.2f}"),
    Column("rate_correlation", "gyroscopes, neighbours' correlation", "corr.", "{:+.2f}"),
)

AGREEMENT = (
    Column("samples", "T", "$T$"),
    Column("assumed", "assumed σa", r"assumed $\sigma_a$"),
    Column("accelerometer_sd", "its value (m/s²)", r"$\sigma_a$ (m/s$^2$)", "{:.2f}"),
    Column("claimed_m", "claimed sd (µm)", r"claimed ($\mu$m)", "{:.3g}", 1e6),
    Column("spread_m", "sd between recordings (µm)", r"between ($\mu$m)", "{:.3g}", 1e6),
    Column("z_rms", "rms z", "rms $z$", "{:.2f}"),
    Column("coverage_50", "50 % intervals cover (%)", r"50 \%", "{:.0f}", 100.0),
    Column("coverage_95", "95 % intervals cover (%)", r"95 \%", "{:.0f}", 100.0),
)


def _rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def table_measured_first_order(residuals: list, noise: list, names: list[str]):
    """First-order calibration of a board: residuals and noise of each IMU, a row for each.

    ``residuals``, ``noise`` of the recordings ``names``: `firstorder.report`. The noise of an IMU
    is the root mean square over its axes, SI units.
    """
    rows = []
    for name, own, noises in zip(names, residuals, noise, strict=True):
        sizes = {
            (sensor, str(triad)): part
            for (sensor, triad), part in noises.groupby(["sensor", "triad"])
        }
        for row in own.itertuples():
            entry = {"recording": name, "triad": str(row.triad)}
            entry |= {"residual_rms": row.residual_rms, "left_out": row.left_out}
            for sensor, short in (("specific_force", "force"), ("angular_rate", "rate")):
                part = sizes.get((sensor, str(row.triad)))
                if part is None:
                    continue
                sd = _rms(part.sd)
                entry |= {f"{short}_sd": sd, f"{short}_ratio": sd / part.declared.iloc[0]}
                entry[f"{short}_correlation"] = part.correlation.mean()
            rows.append(entry)
    table = pd.DataFrame(rows)
    note = (
        "Noise: root mean square over the axes, from differences of neighbouring readings in the"
        " still poses, beside the noise the recording declared (the papers')."
    )
    columns = [column for column in FIRST_ORDER if column.name in table]
    caption = "First-order calibration from still poses: residual and noise of each IMU"
    return table, columns, caption, [note]


def table_measured_agreement(summary: pd.DataFrame):
    """Coverage and z-scores between recordings of a board; ``summary``: `measured.agreement`."""
    table = summary.astype({"assumed": str})
    note = (
        f"{table.recordings.max()} recordings, differences of all pairs in all coordinates. Pairs"
        " share recordings and coordinates share a motion, so the shares have no simple error."
    )
    caption = "Do recordings of one board agree within their claimed widths?"
    return table, AGREEMENT, caption, [note]


def figure_measured_residuals(
    summary: pd.DataFrame, histogram: pd.DataFrame, name: str, settings: dict
):
    """What the simulation gets wrong; `measured.residuals.compare` of the recording ``name``."""
    noise = settings["noise"]
    footer = [
        f"Recording {name}, seed {settings['seed']}. Papers' model with"
        f" σa = {noise['accelerometer_sd']:g} m/s² and σg = {noise['gyroscope_sd_dps']:g} deg/s,"
        " positions and motion fitted; the simulation has the fitted motion, this noise and the"
        " same rails, and is fitted likewise."
    ]
    return residual_figure(summary, histogram, footer), summary


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
def figure_measured_agreement(summary: pd.DataFrame, pairs: pd.DataFrame, group: str):
    """How far recordings of one board lie apart, in claimed widths, and the intervals' coverage.

    ``summary``, ``pairs``: `measured.agreement`, one row each per number of samples and assumed
    sigma_a (and pair); ``group``: the board.
    """
    footer = [
        f"{summary.recordings.max()} recordings of board {group}; differences"
        " of all pairs in all coordinates, over their claimed sd. Pairs share recordings, and a"
        " recording's coordinates share its motion."
    ]
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
    logarithmic(middle, "samples $T$", "sd (µm)")
    middle.set_title("between recordings (filled)\nand claimed (open, dotted)")
    for nominal in (50, 95):
        right.axhline(nominal, color=BLACK, linewidth=0.6)
    right.set(xscale="log", ylim=(0, 102), xlabel="samples $T$", ylabel="covered (%)")
    right.set_title("95 % intervals (filled)\nand 50 % intervals (open)")
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure, summary


def _assumed(name, summary, most):
    row = summary[(summary.assumed.astype(str) == name) & (summary.samples == most)].iloc[0]
    if name == "residual":
        return f"$\\sigma_a$ from the residual ({row.accelerometer_sd:.2f} m/s²)"
    return f"$\\sigma_a$ = {name} m/s²"


@styled
def figure_measured_noise(allan: pd.DataFrame, name: str, settings: dict):
    """Allan deviation of the still poses, every axis of every IMU, and the papers' white noise.

    ``allan``: `firstorder.report.allan_table` of the recording ``name``. The papers' sd of one
    reading is drawn as tau^(-1/2).
    """
    noise = settings["noise"]
    papers = {
        "specific_force": noise["accelerometer_sd"],
        "angular_rate": np.radians(noise["gyroscope_sd_dps"]),
    }
    footer = [
        f"Still poses of recording {name}. Black: the papers' σa ="
        f" {noise['accelerometer_sd']:g} m/s² and σg = {noise['gyroscope_sd_dps']:g} deg/s."
    ]
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
        logarithmic(axes, "averaging time τ (s)", f"Allan deviation, {title}")
        axes.legend()
    return figure, allan


@styled
def figure_past_rail(table: pd.DataFrame, rail_dps: float, footer=()):
    """Median error and RMSE of the withheld readings over the angular rate; log-log."""
    figure = new_figure(footer, PAGE, 2.8)
    panels = figure.subplots(1, 2, sharey=True)
    # a normal error of sd 1 has the median 0.674
    columns = (
        ("median_dps", "median |error|", "sd_dps", 0.674),
        ("rmse_dps", "RMSE", "rms_sd_dps", 1),
    )
    for axes, (column, title, claimed, factor) in zip(panels, columns, strict=True):
        for number, (name, label) in enumerate(SERIES.items()):
            rows = table[table.model == name]
            if len(rows):
                axes.plot(rows.rate_dps, rows[column], label=label, **look(number), markersize=4)
        rows = table[table.model == "board"]
        axes.plot(rows.rate_dps, factor * rows[claimed], color="0.4", linestyle=(0, (1, 1.5)),
                  linewidth=1, label="that, as claimed")  # fmt: skip
        axes.axvline(rail_dps, color="0.6", linewidth=0.8)
        logarithmic(axes, "angular rate of the withheld axis (deg/s)", None)
        axes.set_xticks([250, 500, 1000, 2000], ["250", "500", "1000", "2000"])
        axes.set_xticks([], minor=True)
        axes.set_title(title)
    panels[0].set_ylabel("error of the predicted reading (deg/s)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


CAUSES = (
    Column("model", "model", "model"),
    Column("rms_m", "pairs: rms (µm)", r"rms ($\mu$m)", "{:.1f}", 1e6),
    Column("median_m", "median (µm)", r"median ($\mu$m)", "{:.1f}", 1e6),
    Column("same_size_rms_m", "rms at one size (µm)", r"at one size ($\mu$m)", "{:.1f}", 1e6),
    Column("size_sd", "sd of the size (%)", r"size (\%)", "{:.3f}", 100.0),
    Column("covered", "95 % intervals cover (%)", r"covered (\%)", "{:.0f}", 100.0),
    Column("residual_ratio", "residual / still noise", "residual", "{:.1f}"),
    Column("smooth_ratio", "in smooth samples", "smooth", "{:.2f}"),
    Column("nats", "nats a sample, held out", "nats", "{:.1f}"),
    Column("nats_error", "± ", r"$\pm$", "{:.1f}"),
)


def table_causes(summary: pd.DataFrame, group: str):
    """What each cause buys; ``summary``: `measured.causes.repeated` of the board ``group``."""
    note = (
        f"{summary.recordings.max()} recordings of board {group}; differences of all pairs, all"
        " coordinates. Nats: what is new in a row gains on held-out time over the row that it"
        " extends, median over recordings."
    )
    return summary, CAUSES, "How positions repeat, and what each cause buys", [note]


EXPERIMENT = (
    Column("samples", "T", "$T$", "{:d}"),
    Column("model", "model", "model"),
    Column("claimed_m", "claimed sd (µm)", r"claimed sd ($\mu$m)", "{:.1f}", 1e6),
    Column("spread_m", "sd between recordings (µm)", r"between ($\mu$m)", "{:.1f}", 1e6),
    Column("coverage_50", "50 % intervals hold (%)", r"50 \%", "{:.0f}", 100.0),
    Column("coverage_95", "95 % intervals hold (%)", r"95 \%", "{:.0f}", 100.0),
    Column("z_rms", "rms of z", "rms of $z$", "{:.2f}"),
)


def table_experiment(located: list, names: list[str], summary: pd.DataFrame, group: str):
    """Table II of 2021 once more: positions from T samples under the papers' and the sensor model.

    ``located``: `analysis.experiment.located` of the recordings ``names`` of the board ``group``;
    ``summary``: `measured.agreement` under the papers' model.
    """
    assumed = summary.assumed.astype(str)
    noise = np.where(assumed == "residual", "the residual's", assumed + " m/s²")
    rows = [summary.assign(model=[f"papers', σa {each}" for each in noise])]
    for each in located[0].samples.to_numpy():
        table = pd.concat([
            _coordinates(one.sel(samples=each)).assign(recording=name)
            for name, one in zip(names, located, strict=True)
        ])  # fmt: skip
        found = agreement(pairwise(table), table)
        rows.append(pd.DataFrame([found | {"samples": int(each), "model": "sensors"}]))
    table = pd.concat(rows, ignore_index=True).sort_values("samples", kind="stable")
    note = (
        f"{table.recordings.max()} recordings of board {group}; sds are rms over coordinates,"
        " shares and z of the differences of all pairs. Sensors: maps, delays and lever arms from"
        " the board's other recordings, biases and clocks from the whole recording, positions from"
        " T samples."
    )
    table = table[[column.name for column in EXPERIMENT]]
    return table, EXPERIMENT, "Table II of 2021 once more: sds of the positions, measured", [note]


def _coordinates(one: xr.Dataset) -> pd.DataFrame:
    """A row a coordinate: accelerometer, axis, mean_m, sd_m."""
    count = 3 * one.sizes["accelerometer"]
    sd = np.sqrt(np.diag(one.position_covariance.to_numpy().reshape(count, count)))
    table = one.position.to_series().rename("mean_m").to_frame().assign(sd_m=sd)
    return table.reset_index().iloc[3:]


PAST_RAIL = (
    Column("recording", "recording", "recording"),
    Column("rate_dps", "rate (deg/s)", "rate (deg/s)", "{:.0f}"),
    Column("readings", "readings", "readings", "{:d}"),
    Column("median_dps", "median error (deg/s)", "median (deg/s)", "{:.1f}"),
    Column("rmse_dps", "rms (deg/s)", "rms (deg/s)", "{:.0f}"),
    Column("within_95", "95 % intervals hold (%)", r"covered (\%)", "{:.0f}", 100.0),
    Column("above_100", "beyond 100 deg/s (%)", r"far (\%)", "{:.1f}", 100.0),
)


def table_past_rail(tables: list[pd.DataFrame], names: list[str], group: str):
    """Readings past a made-up rail by the board of the others; `analysis.past_rail` of each."""
    parts = [
        table[table.model == "board"].assign(recording=name)
        for name, table in zip(names, tables, strict=True)
    ]
    note = (
        f"Board {group}: its parameters from the other recordings; biases, clocks, noise and motion"
        " fitted to the recording without the withheld readings. Readings: of all gyroscopes."
    )
    return pd.concat(parts), PAST_RAIL, "Gyroscope readings past a made-up rail", [note]


LEFT_OUT = (
    Column("recording", "recording", "recording"),
    Column("samples", "samples", "samples", "{:d}"),
    Column("heavy", "papers' model, Student's t", "papers', t", "{:.1f}"),
    Column("heavy_error", "±", r"$\pm$", "{:.1f}"),
    Column("board", "board of the others", "board of the others", "{:.1f}"),
    Column("board_error", "±", r"$\pm$", "{:.1f}"),
    Column("beyond", "own fit beyond that", "own fit beyond", "{:.2f}"),
    Column("beyond_error", "±", r"$\pm$", "{:.2f}"),
)


def table_left_out(tables: list[pd.DataFrame], names: list[str], group: str):
    """What each recording gains by the others' board; `analysis.leave_out.predicted` of each."""
    rows = []
    for name, table in zip(names, tables, strict=True):
        by = table.set_index("model")
        rows.append({
            "recording": name, "samples": int(by.samples.iloc[0]),
            "heavy": by.over_inflated.heavy, "heavy_error": by.over_inflated_error.heavy,
            "board": by.over_inflated.board, "board_error": by.over_inflated_error.board,
            "beyond": by.over_board.own, "beyond_error": by.over_board_error.own,
        })  # fmt: skip
    note = (
        f"Board {group}: its parameters from the other recordings; biases, clocks, noise and motion"
        " fitted to the recording. Nats a sample on held-out blocks of time over the papers' model"
        " with normal noise as large as the residual, positions fitted to the recording; ± standard"
        " error between blocks. Last: what a fit of all parameters to the recording has beyond."
    )
    return pd.DataFrame(rows), LEFT_OUT, "Recordings predicted by the others", [note]


@styled
def figure_causes(summary: pd.DataFrame, group: str):
    """What each cause buys: repeatability, size and residual, a row a model.

    ``summary``: `measured.causes.repeated` of the board ``group``.
    """
    footer = [
        f"{summary.recordings.max()} recordings of board {group}, differences of all pairs in all"
        " coordinates. Residual over the noise of still poses: rms of all samples, outliers with"
        " them; robust, of the fifth of least jerk among those with most angular acceleration."
    ]
    figure = new_figure(footer, PAGE, 2.9)
    panels = figure.subplots(1, 3, sharey=True, width_ratios=(2, 1, 1))
    rows = np.arange(len(summary))[::-1]
    series = (("rms_m", "rms"), ("same_size_rms_m", "rms, at one size"), ("median_m", "median"))
    for number, (column, label) in enumerate(series):
        panels[0].plot(1e6 * summary[column], rows, label=label, markersize=4, **look(number))
    panels[1].plot(100 * summary.size_sd, rows, markersize=4, **look(3))
    panels[2].plot(summary.residual_ratio, rows, label="all", markersize=4, **look(4))
    panels[2].plot(summary.smooth_ratio, rows, label="smooth", markersize=4, **look(5))
    titles = "differences between recordings (µm)", "sd of the size (%)", "residual / still noise"
    for axes, title in zip(panels, titles, strict=True):
        axes.set(xscale="log", xlabel=title)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
    panels[0].set_yticks(rows, summary.model)
    for axes in panels[::2]:
        axes.legend()
    return figure, summary
