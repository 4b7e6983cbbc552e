"""Simulation-based calibration: rank histograms, and how often intervals hold the truth."""

from functools import partial

import numpy as np
import pandas as pd
from scipy import stats

from imuarray.figures.style import BLACK, PAGE, SKY, look, new_figure, styled
from imuarray.figures.tables import Column, scale_line
from imuarray.studies.sbc import WHOLE, coverage

BINS = 20
ACROSS = 4  # panels in a line

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
