"""Measured recordings: agreement between them, first order, still noise."""

import numpy as np
import pandas as pd
from scipy.special import ndtr

from imuarray.pictures.noise import KINDS, deviation_lines
from imuarray.pictures.style import BLACK, PAGE, logarithmic, look
from imuarray_papers.figures.style import drawing, panels, rms


def table_measured_first_order(residuals: list, noise: list, names: list[str]):
    """First-order calibration of a board: residuals and noise of each IMU, a row for each.

    ``residuals``, ``noise`` of the recordings ``names``: `firstorder.report`. The noise of an IMU
    is the root mean square over its axes, SI units.
    """
    rows = []
    for name, own, noises in zip(names, residuals, noise, strict=True):
        noises = noises.astype({"triad": str})
        sizes = dict(list(noises.groupby(["sensor", "triad"])))
        for row in own.itertuples():
            entry = {"recording": name, "triad": str(row.triad)}
            entry |= {"residual_rms": row.residual_rms, "left_out": row.left_out}
            for sensor, short in (("specific_force", "force"), ("angular_rate", "rate")):
                part = sizes.get((sensor, str(row.triad)))
                if part is None:
                    continue
                sd = rms(part.sd)
                entry |= {f"{short}_sd": sd, f"{short}_ratio": sd / part.declared.iloc[0]}
                entry[f"{short}_correlation"] = part.correlation.mean()
            rows.append(entry)
    return pd.DataFrame(rows), {}


def table_measured_agreement(summary: pd.DataFrame):
    """Coverage and z-scores between recordings of a board; ``summary``: `measured.agreement`."""
    return summary.astype({"assumed": str}), {"recordings": summary.recordings.max()}


def figure_measured_agreement(summary: pd.DataFrame, pairs: pd.DataFrame, group: str):
    """Distance of one board's recordings, in claimed widths, and the intervals' coverage.

    ``summary``, ``pairs``: `measured.agreement`, one row each per number of samples and assumed
    sigma_a (and pair); ``group``: the board.
    """
    footer = [
        f"{summary.recordings.max()} recordings of board {group}; differences"
        " of all pairs in all coordinates, over their claimed sd. Pairs share recordings, and a"
        " recording's coordinates share its motion."
    ]
    own = pairs.samples == summary.samples.max()
    pairs = pairs.loc[own, ["samples", "assumed", "z"]].round({"z": 2})  # differences, some tiny
    table = panels(summary=summary, pairs=pairs).astype({"assumed": str})
    return drawing(_draw_agreement, footer, PAGE, 2.7), table


def _draw_agreement(figure, table):
    left, middle, right = figure.subplots(1, 3)
    pairs, summary = table[table.panel == "pairs"], table[table.panel == "summary"]
    most = summary.samples.max()
    for index, name in enumerate(dict.fromkeys(summary.assumed)):
        style = look(index) | {"markersize": 4}
        hollow = style | {"markerfacecolor": "none"}
        size = np.sort(pairs[pairs.assumed == name].z.abs())
        share = (np.arange(size.size) + 0.5) / size.size
        rows = summary[summary.assumed == name].sort_values("samples")
        label = f"$\\sigma_a$ = {name} m/s²"
        if name == "residual":
            label = f"$\\sigma_a$ from the residual ({rows.accelerometer_sd.iloc[-1]:.2f} m/s²)"
        left.plot(size, share, label=label, **look(index, "marker"))
        middle.plot(rows.samples, 1e6 * rows.spread_m, **style)
        dotted = hollow | {"linestyle": (0, (1, 1)), "linewidth": 0.7}
        middle.plot(rows.samples, 1e6 * rows.claimed_m, **dotted)
        right.plot(rows.samples, 100 * rows.coverage_50, **hollow)
        right.plot(rows.samples, 100 * rows.coverage_95, **style)
    grid = np.geomspace(0.03, 100, 200)
    left.plot(grid, 2 * ndtr(grid) - 1, color=BLACK, linewidth=1, label="if widths were right")
    left.set(
        xscale="log", xlabel="|z| between recordings", ylabel="share of differences",
        title=f"$T = {most}$, {len(size)} differences",
    )  # fmt: skip
    said = "between recordings (filled)\nand claimed (open, dotted)"
    logarithmic(middle, "samples $T$", "sd (µm)", title=said)
    for nominal in (50, 95):
        right.axhline(nominal, color=BLACK, linewidth=0.6)
    right.set(xscale="log", ylim=(0, 102), xlabel="samples $T$", ylabel="covered (%)",
              title="95 % intervals (filled)\nand 50 % intervals (open)")  # fmt: skip
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=4)


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
    return drawing(_draw_noise, footer, PAGE, papers=papers), allan


def _draw_noise(figure, allan, papers):
    for axes, sensor in zip(figure.subplots(1, 2), KINDS, strict=True):
        taus = deviation_lines(axes, allan, sensor)
        white = KINDS[sensor][0] * papers[sensor] * np.sqrt(taus[0] / taus)
        axes.plot(taus, white, color=BLACK, linewidth=1.2, label="papers' σ, white")
        axes.legend()
