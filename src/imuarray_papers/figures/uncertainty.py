"""Figures and tables of estimation theory, and of the validation of posteriors by simulation."""

import numpy as np
import pandas as pd
from scipy import stats

from imuarray.pictures import style
from imuarray_papers.figures.style import drawing, marks, points, scale_line

ESTIMATORS = ("maximum likelihood", "with the prior")
BINS = 20
ACROSS = 4  # panels in a line
SHARES = (0.5, 0.9, 0.95)
REFERENCE = "NUTS"  # whose PIT values the others' are compared with, replicate by replicate
MIXED = 50  # independent draws of a posterior, of 199: fewer are a slow chain
KEYS = ["setting", "method", "samples"]  # of a histogram, and a row
WHOLE = ("size", "misfit")  # quantities that hang on all coordinates


def table_theory_ranks(rows: pd.DataFrame, settings: dict):
    """Rank of the information over N, motion and geometry; ``rows``: `studies.bound.ranks`."""
    return rows, {"scale": scale_line(settings)}


def figure_theory_efficiency(rows: pd.DataFrame, settings: dict):
    """RMSE over N beside the bound, their ratio, and that over the noise.

    ``rows``: `studies.bound.efficiency` for the model's noise, then for others at one N.
    """
    footer = [scale_line(settings, f"{rows.realisations.max()} realisations per point")]
    return drawing(_draw_efficiency, footer, height=5.4), rows


def _draw_efficiency(figure, table):
    top, below, louder = figure.subplots(3, 1, height_ratios=[2, 1, 1])
    others = table[table.noise != 1.0]
    for index, name in enumerate(ESTIMATORS):
        rows = table[(table.estimator == name) & (table.noise == 1.0)]
        alone = {"linestyle": "none", "label": f"RMSE, {name}"}
        points(top, rows.samples, rows.rmse_m, rows.rmse_se_m, index, **alone)
        label = "bound" if index == 0 else "linearised posterior"
        top.plot(rows.samples, rows.bound_m, label=label, **style.look(index, "marker"))
        places = rows.samples * 1.04**index
        points(below, places, rows.ratio, rows.ratio_se, index, linestyle="none")
        rows = table[(table.estimator == name) & table.samples.isin(others.samples)]
        points(louder, rows.noise * 1.04**index, rows.ratio, rows.ratio_se, index)
    for panel in (below, louder):
        panel.axhline(1.0, color=style.BLACK, linewidth=0.8)
        panel.set(ylabel="error / bound")
    style.logarithmic(top, None, "RMSE of the positions (m)")
    below.set(xscale="log", xlabel="Time samples $N$ (count)")
    counts = ", ".join(map(str, others.samples.unique()))
    louder.set(xscale="log", xlabel=f"Noise, times the sensors' own ($N$ = {counts})")
    top.legend(loc="upper right")


def figure_theory_convergence(rows: pd.DataFrame, settings: dict):
    """Iterations to 1.01 times the bound over the motion, and ML-BCD's rate, predicted and seen.

    ``rows``: `studies.bound.convergence` of the array, then of others. Motions that determine the
    positions hardly better than they are known nominally are left out above; filled triangles at
    the top are medians beyond the limit of iterations.
    """
    footer = [scale_line(settings, f"N = {rows.samples.max()}")]
    nominal = settings["paper2017"]["position_sd"]
    return drawing(_draw_convergence, footer, height=5.4, nominal_sd=nominal), rows


def _draw_convergence(figure, table, nominal_sd):
    top, below = figure.subplots(2, 1)
    own = table[table.array == table.array.iloc[0]]
    for index, (acceleration, rows) in enumerate(own.groupby("angular_acceleration_dps2")):
        # medians: a run that did not come to an end counts as longer than any other
        known = rows[rows.groupby("angular_rate_dps").bound_m.transform("median") < nominal_sd / 3]
        counts = known[["angular_rate_dps", "bcd_iterations", "newton_iterations"]].fillna(np.inf)
        medians = counts.groupby("angular_rate_dps").median()
        never = medians.index[np.isinf(medians.bcd_iterations)]
        medians = medians.replace(np.inf, np.nan)
        hollow = style.look(index) | {"markerfacecolor": "none"}
        height = np.full(len(never), 1.3 * rows.limit.max())
        top.plot(never, height, **marks(index, marker="^", markersize=7 - index))
        label = rf"$\|\dot\omega\|$ = {acceleration:g} deg/s²"
        top.plot(medians.index, medians.bcd_iterations, label=label, **hollow)
        newton = hollow | {"color": style.GREY, "linestyle": ":"}
        top.plot(medians.index, medians.newton_iterations, **newton)
        below.plot(1 - rows.contraction, 1 - rows.observed, **hollow | {"linestyle": ""})
    for index, (name, rows) in enumerate(table[table.array != own.array.iloc[0]].groupby("array")):
        below.plot(
            1 - rows.contraction, 1 - rows.observed, color=style.BLACK, linestyle="none",
            marker=style.MARKERS[-1 - index], markerfacecolor="none", label=name,
        )  # fmt: skip
    top.plot([], [], color=style.GREY, linestyle=":", label="Gauss-Newton, each")
    style.logarithmic(top, r"Angular rate $\|\omega\|$ (deg/s)", "iterations to 1.01 × bound")
    top.legend(loc="lower center", bbox_to_anchor=(0.5, 0.12), ncols=2, columnspacing=1.0)
    drawn = 1 - table.contraction[table.observed.notna()]
    ends = np.array([drawn.min() / 2, min(drawn.max() * 2, 1.0)])
    below.plot(ends, ends, color=style.BLACK, linewidth=0.8)
    style.logarithmic(below, "share of the error lost in an iteration, foreseen", "seen")
    below.legend(loc="upper left", title="other arrays", title_fontsize=7)


def figure_theory_size(rows: pd.DataFrame, settings: dict):
    """The bound over the array's size, absolute and relative to it; `studies.bound.against_size`.

    Both on one axis of lengths would hide that the one falls: two panels.
    """
    footer = [scale_line(settings, f"N = {settings['theory']['convergence_samples']}")]
    return drawing(_draw_size, footer, height=4.0), rows


def _draw_size(figure, table):
    top, below = figure.subplots(2, 1, sharex=True)
    top.plot(1e3 * table.extent_m, 1e6 * table.bound_m, markerfacecolor="none", **style.look(0))
    below.plot(1e3 * table.extent_m, 1e6 * table.relative, markerfacecolor="none", **style.look(2))
    # both panels over as many decades, so that what does not change looks so
    decades = np.log10(table.relative.max() / table.relative.min()) * 0.6
    middle = 1e6 * np.median(table.bound_m)
    span = (middle * 10**-decades, middle * 10**decades)
    style.logarithmic(top, None, "bound (µm)", ylim=span)
    style.logarithmic(below, "size of the array, corner to corner (mm)", "bound / size (ppm)")


def coverage(table: pd.DataFrame) -> pd.DataFrame:
    """Share of central intervals that hold the truth, and uniformity of PIT values.

    A row for each setting, method and T: ``covered_50`` and so on of the coordinates with standard
    errors over replicates (coordinates of one replicate are not independent); ``shift_z`` and
    ``width_z``, the mean normal score and the mean squared one less 1 over all coordinates of a
    replicate, ``size_z`` and ``misfit_z``, the mean scores of those, in standard errors; and
    ``none``, replicates without intervals; ``slow``, chains with few independent draws; ``apart``,
    how far from NUTS' a replicate's PIT values are at most (rms; 0.05 is their own noise); and
    ``p``, the smallest Kolmogorov-Smirnov p-value of a quantity times their number.
    """
    rows = []
    for key, part in table.groupby(KEYS, sort=False):
        grid = part.pivot(index="replicate", columns="quantity", values="pit")
        grid = grid.dropna(axis="columns", how="all").dropna()
        own = grid.drop(columns=[name for name in WHOLE if name in grid]).to_numpy()
        mixed = part.groupby("replicate").independent.first()
        row = dict(zip(KEYS, key, strict=True)) | {
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
    """Share of intervals that hold the truth, by method and T; ``pit_values``: `studies.sbc`."""
    return coverage(pd.concat(pit_values)), {"scale": scale_line(settings)}


def histogram(values: pd.DataFrame) -> pd.DataFrame:
    """Density of the truths' PIT values, uniform if right: a row for each bin.

    ``se``: from the spread between replicates, whose parameters are not independent.
    """
    frames = []
    edges = np.linspace(0, 1, BINS + 1)
    own = values[~values.quantity.isin(WHOLE)].dropna(subset="pit")
    for key, part in own.groupby(KEYS, sort=False):
        place = np.clip((part.pit * BINS).astype(int), 0, BINS - 1)
        shares = BINS * pd.crosstab(part.replicate, place, normalize="index")
        shares = shares.reindex(columns=range(BINS), fill_value=0.0)
        error = shares.std(ddof=1) / np.sqrt(len(shares))
        frames.append(pd.DataFrame(dict(zip(KEYS, key, strict=True)) | {
            "low": edges[:-1], "high": edges[1:], "density": shares.mean().to_numpy(),
            "se": error.to_numpy(), "replicates": len(shares),
        }))  # fmt: skip
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
    lines = -(-table.groupby(KEYS).ngroups // ACROSS)
    return drawing(_draw_ranks, footer, style.PAGE, 0.5 + 1.35 * lines), table


def _draw_ranks(figure, table):
    groups = list(table.groupby(["setting", "samples", "method"], sort=False))
    lines = -(-len(groups) // ACROSS)
    panels = figure.subplots(lines, ACROSS, sharex=True, sharey=True, squeeze=False)
    for ((setting, samples, method), rows), axes in zip(groups, panels.flat, strict=False):
        width = stats.norm.isf(0.025 / BINS) * rows.se.mean()
        axes.axhspan(1 - width, 1 + width, color=style.SKY, alpha=0.4, linewidth=0)
        axes.axhline(1.0, color=style.BLACK, linewidth=0.6)
        axes.stairs(rows.density, [*rows.low, 1.0], color=style.look(2)["color"], linewidth=1.2)
        count = rows.replicates.max()
        axes.set_title(f"{setting}, T = {samples}\n{method}, n = {count}", size=7)
    for axes in panels.flat[len(groups) :]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel("density")
    for axes in panels[-1]:
        axes.set_xlabel("posterior below the truth")
    panels[0, 0].set(xlim=(0, 1), ylim=(0, None))
