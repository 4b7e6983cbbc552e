"""Simulation-based calibration: rank histograms, and how often intervals hold the truth."""

from functools import partial

import numpy as np
import pandas as pd
from scipy import stats

from imuarray.figures.style import BLACK, PAGE, SKY, look, new_figure, styled
from imuarray.figures.tables import Column, scale_line

BINS = 20
ACROSS = 4  # panels in a line
SHARES = (0.5, 0.9, 0.95)
REFERENCE = "NUTS"  # whose PIT values the others' are compared with, replicate by replicate
MIXED = 50  # independent draws of a posterior, of 199: fewer are a slow chain
WHOLE = ("size", "misfit")  # quantities that hang on all coordinates

COVERAGE = (
    Column("setting", "setting", "setting"),
    Column("method", "method", "method"),
    Column("samples", "T", "$T$"),
    Column("replicates", "replicates", "replicates"),
    Column("covered_50", "50 % intervals cover (%)", r"50 \%", "{:.1f}", 100.0),
    Column("se_50", "±", r"$\pm$", "{:.1f}", 100.0),
    Column("covered_90", "90 % (%)", r"90 \%", "{:.1f}", 100.0),
    Column("se_90", "± ", r"$\pm$ ", "{:.1f}", 100.0),
    Column("covered_95", "95 % (%)", r"95 \%", "{:.1f}", 100.0),
    Column("se_95", "±  ", r"$\pm$  ", "{:.1f}", 100.0),
    Column("shift_z", "z of the mean score", r"$z$, shift", "{:+.1f}"),
    Column("width_z", "z of the mean squared score", r"$z$, width", "{:+.1f}"),
    Column("size_z", "z, the array's size", r"$z$, size", "{:+.1f}"),
    Column("misfit_z", "z, misfit of the data", r"$z$, misfit", "{:+.1f}"),
    Column("p", "p of uniform ranks", "$p$", "{:.2g}"),
    Column("none", "truths without intervals", "none"),
    Column("slow", "slow chains", "slow"),
    Column("apart", "farthest from NUTS", "from NUTS", "{:.2f}"),
)
COVERAGE_NOTE = (
    "Truths drawn from the prior, motion from its own, which the samplers know, but 'sample', which"
    " is the command as it is: to it the noise and the motion's size are unknown (the paper's limit"
    " of a flat motion prior cannot be simulated; docs/findings.md says what it does to the array's"
    " size). ±: standard errors over replicates."
    " Scores: normal quantiles of the truth's PIT value; a mean square above 1 (z > 0) means widths"
    " too small."
    " p: Kolmogorov and Smirnov's, the smallest of all quantities times their number."
    " Slow: fewer than 50 of 199 kept draws are worth an independent one. Farthest from NUTS: the"
    " largest rms difference between both methods' PIT values of one truth; 0.05 is chance."
)
JOINT = (
    Column("sampler", "sampler", "sampler"),
    Column("rounds", "rounds", "rounds"),
    Column("parameters", "unknowns", "unknowns"),
    Column("ess_min", "smallest effective size", "ESS", "{:.0f}"),
    Column("mean_z", "largest |z| of means", r"$|z|$, means", "{:.2f}"),
    Column("square_z", "largest |z| of squares", r"$|z|$, squares", "{:.2f}"),
    Column("misfit_z", "|z| of the misfit", r"$|z|$, misfit", "{:.2f}"),
    Column("p", "p", "$p$", "{:.2g}"),
)
JOINT_NOTE = (
    "Measurements are drawn given the positions, then the positions moved by the sampler given the"
    " measurements, over and over: right samplers leave the positions' prior as it is, and the"
    " misfit between both as in independent draws. z: means of the coordinates and their squares"
    " against the prior's, of the misfit against the independent ones', in Monte Carlo standard"
    " errors; p: of the largest, times the number of comparisons."
)


def coverage(table: pd.DataFrame) -> pd.DataFrame:
    """How often central intervals hold the truth, and whether PIT values are uniform.

    A row for each setting, method and T: ``covered_50`` and so on of the coordinates with standard
    errors over replicates (coordinates of one replicate are not independent); ``shift_z`` and
    ``width_z``, the mean normal score and the mean squared one less 1 over all coordinates of a
    replicate, ``size_z`` and ``misfit_z``, the mean scores of those, in standard errors; and
    ``none``, replicates without intervals; ``slow``, chains with few independent draws; ``apart``,
    how far from NUTS' a replicate's PIT values are at most (rms; 0.05 is their own noise); and
    ``p``, the smallest Kolmogorov-Smirnov p-value of a quantity times their number.
    """
    rows = []
    keys = ["setting", "method", "samples"]
    for key, part in table.groupby(keys, sort=False):
        grid = part.pivot(index="replicate", columns="quantity", values="pit")
        grid = grid.dropna(axis="columns", how="all").dropna()
        own = grid.drop(columns=[name for name in WHOLE if name in grid]).to_numpy()
        mixed = part.groupby("replicate").independent.first()
        row = dict(zip(keys, key, strict=True)) | {
            "replicates": len(grid), "none": part.replicate.nunique() - len(grid),
            "slow": int(np.sum(mixed < MIXED)), "apart": _apart(table, key),
        }  # fmt: skip
        for share in SHARES:
            inside = (np.abs(own - 0.5) < share / 2).mean(axis=1)
            row[f"covered_{100 * share:.0f}"] = inside.mean()
            row[f"se_{100 * share:.0f}"] = inside.std(ddof=1) / np.sqrt(len(grid))
        scores = stats.norm.ppf(own)
        row |= {"shift_z": _mean_z(scores.mean(axis=1)),
                "width_z": _mean_z(np.mean(scores**2, axis=1) - 1)}  # fmt: skip
        for name in WHOLE:
            row[f"{name}_z"] = _mean_z(stats.norm.ppf(grid[name])) if name in grid else np.nan
        smallest = min(stats.kstest(grid[name], "uniform").pvalue for name in grid)
        rows.append({**row, "p": min(1.0, smallest * grid.shape[1])})
    return pd.DataFrame(rows)


def _apart(table: pd.DataFrame, key) -> float:
    """Largest rms difference of a replicate's coordinates' PIT values from `REFERENCE`'s."""
    setting, method, samples = key
    same = table[(table.setting == setting) & (table.samples == samples)]
    same = same[~same.quantity.isin(WHOLE)]
    places = ["replicate", "quantity"]
    own, other = (same[same.method == name].set_index(places).pit for name in (method, REFERENCE))
    square = ((own - other) ** 2).dropna().groupby("replicate").mean()
    return float(np.sqrt(square.max())) if method != REFERENCE and len(square) else np.nan


def _mean_z(scores) -> float:
    """Mean of one score a replicate (R,) over its standard error."""
    return float(np.mean(scores) / (np.std(scores, ddof=1) / np.sqrt(len(scores))))


def table_validation_coverage(pit_values: list[pd.DataFrame], settings: dict):
    """How often intervals hold the truth, by method and T; ``pit_values``: `studies.sbc`."""
    table = coverage(pd.concat(pit_values))
    notes = [COVERAGE_NOTE, scale_line(settings)]
    return table, COVERAGE, "How often intervals hold the truth.", notes


def table_validation_joint(rows: pd.DataFrame, settings: dict):
    """The joint test of samplers and simulation; ``rows``: `studies.joint`."""
    caption = "Samplers and simulation by turns: do the positions keep their prior?"
    return rows, JOINT, caption, [JOINT_NOTE, scale_line(settings)]


def histogram(values: pd.DataFrame) -> pd.DataFrame:
    """Density of the truths' PIT values, uniform if right: a row for each bin.

    ``se``: from the spread between replicates, whose parameters are not independent.
    """
    frames = []
    edges = np.linspace(0, 1, BINS + 1)
    own = values[~values.quantity.isin(WHOLE)].dropna(subset="pit")
    for (setting, method, samples), part in own.groupby(
        ["setting", "method", "samples"], sort=False
    ):
        place = np.clip((part.pit * BINS).astype(int), 0, BINS - 1)
        shares = BINS * pd.crosstab(part.replicate, place, normalize="index")
        shares = shares.reindex(columns=range(BINS), fill_value=0.0)
        frames.append(
            pd.DataFrame(
                {"setting": setting, "method": method, "samples": samples,
                 "low": edges[:-1], "high": edges[1:],
                 "density": shares.mean().to_numpy(),
                 "se": (shares.std(ddof=1) / np.sqrt(len(shares))).to_numpy(),
                 "replicates": len(shares)}
            )
        )  # fmt: skip
    return pd.concat(frames, ignore_index=True)


def figure_validation_ranks(pit_values: list[pd.DataFrame], settings: dict):
    """A histogram for each setting, T and method; band: all 20 bins of a panel, 95 %.

    ``pit_values``: `studies.sbc`, of each setting.
    """
    table = histogram(pd.concat(pit_values))
    footer = [
        scale_line(settings, "n: truths from the prior, those without intervals left out"),
        "Histograms of all positions' coordinates; band: 95 % for all bins of a panel together.",
    ]
    return partial(_draw_ranks, footer=footer), table


@styled
def _draw_ranks(table, footer):
    groups = list(table.groupby(["setting", "samples", "method"], sort=False))
    lines = -(-len(groups) // ACROSS)
    figure = new_figure(footer, PAGE, 0.5 + 1.35 * lines)
    panels = figure.subplots(lines, ACROSS, sharex=True, sharey=True, squeeze=False)
    for ((setting, samples, method), rows), axes in zip(groups, panels.flat, strict=False):
        width = stats.norm.isf(0.025 / BINS) * rows.se.mean()
        axes.axhspan(1 - width, 1 + width, color=SKY, alpha=0.4, linewidth=0)
        axes.axhline(1.0, color=BLACK, linewidth=0.6)
        axes.stairs(rows.density, [*rows.low, 1.0], color=look(2)["color"], linewidth=1.2)
        count = rows.replicates.max()
        axes.set_title(f"{setting}, T = {samples}\n{method}, n = {count}", size=7)
    for axes in panels.flat[len(groups) :]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel("density")
    for axes in panels[-1]:
        axes.set_xlabel("posterior below the truth")
    panels[0, 0].set(xlim=(0, 1), ylim=(0, None))
    return figure
