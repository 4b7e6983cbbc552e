"""Paper 2021, figure 5: where in its package each accelerometer triad is."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from scipy.stats import chi2

from imuarray.figures.layout import draw_package, layout_table
from imuarray.figures.notes import SOURCES
from imuarray.figures.style import BLACK, GREY, PAGE, SKY, VERMILLION, look, new_figure, styled
from imuarray.geometry import Array


def fig5_table(array: Array, posteriors: dict[int, np.ndarray], prior, truth=None) -> pd.DataFrame:
    """Means and covariances of x and y, in mm in the array frame, per triad and T.

    ``posteriors[T]`` (draws, A - 1, 3) m relative to the first triad; ``prior`` mean and sd,
    each (A - 1, 3) m; ``truth`` (A - 1, 3) m where known. Rows with samples 0 are the prior.
    """
    layout = layout_table(array).iloc[1:].reset_index(drop=True)
    origin = array.positions[0, :2]
    table = layout[["accelerometer", "side"]]
    for name in ("", "marker_"):
        for axis in "xy":
            table = table.assign(
                **{f"{name or 'package_'}{axis}_mm": 1e3 * layout[f"{name}{axis}_m"]}
            )
    known = np.full((len(table), 2), np.nan) if truth is None else truth[:, :2] + origin
    table = table.assign(truth_x_mm=1e3 * known[:, 0], truth_y_mm=1e3 * known[:, 1])
    variances = np.zeros((len(table), 2, 2))
    variances[:, [0, 1], [0, 1]] = prior[1][:, :2] ** 2
    parts = [_moments(table, 0, prior[0][:, :2] + origin, variances)]
    for samples, draws in posteriors.items():
        plane = draws[..., :2]
        covariance = np.array([np.cov(plane[:, k].T) for k in range(plane.shape[1])])
        parts.append(_moments(table, samples, plane.mean(axis=0) + origin, covariance))
    return pd.concat(parts, ignore_index=True)


def _moments(table, samples, mean, covariance):
    return table.assign(
        samples=samples, mean_x_mm=1e3 * mean[:, 0], mean_y_mm=1e3 * mean[:, 1],
        cov_xx_mm2=1e6 * covariance[:, 0, 0], cov_xy_mm2=1e6 * covariance[:, 0, 1],
        cov_yy_mm2=1e6 * covariance[:, 1, 1],
    )  # fmt: skip


def ellipse(row, level: float, points: int = 73) -> np.ndarray:
    """Outline (points, 2) mm of the Gaussian's ellipse that holds the share ``level``."""
    covariance = [[row.cov_xx_mm2, row.cov_xy_mm2], [row.cov_xy_mm2, row.cov_yy_mm2]]
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0, 2 * np.pi, points)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    radii = np.sqrt(chi2.ppf(level, 2) * np.maximum(values, 0))
    return [row.mean_x_mm, row.mean_y_mm] + (circle * radii) @ vectors.T


@styled
def fig5(table: pd.DataFrame, array: Array, level: float, kind: str, footer=()):
    """(a) topside and (b) underside, both seen from above with the y axis downwards.

    Ellipses at their true size. ``kind`` (`notes.SOURCES`) is written over the figure.
    """
    figure = new_figure(footer, PAGE, 6.6)
    mosaic = figure.subplot_mosaic(
        [["topside", "underside"], ["top zoom", "under zoom"], ["legend", "legend"]],
        height_ratios=[3.3, 2.2, 0.2],
    )  # fmt: skip
    names = sorted(samples for samples in table.samples.unique() if samples > 0)
    reference = layout_table(array).iloc[0]
    for letter, side, zoom in (("a", "topside", "top zoom"), ("b", "underside", "under zoom")):
        axes, rows = mosaic[side], table[table.side == side]
        _packages(axes, rows, array, reference if side == reference.side else None)
        for row in rows.itertuples():
            style = _style(names, row.samples)
            axes.plot(*ellipse(row, level).T, linewidth=0.8, **style)
            if row.samples > 0:
                axes.plot(row.mean_x_mm, row.mean_y_mm, ".", color=style["color"], markersize=1.5)
        reach = 1e3 * np.abs(array.positions[:, :2]).max() + 4.4
        axes.set(
            aspect="equal", xlabel="x (mm)", ylabel="y (mm), downwards", xlim=(-reach, reach),
            ylim=(reach, -reach), title=f"({letter}) {side}, seen from above",
        )  # fmt: skip
        axes.grid(False)
        _zoom(mosaic[zoom], rows[rows.samples == names[-1]], level, _style(names, names[-1]))
        mosaic[zoom].set_title(f"({letter}) all packages laid over each other, $T = {names[-1]}$")
    figure.suptitle(
        SOURCES.get(kind, kind).upper(), size=8, weight="bold",
        color=BLACK if kind == "measured" else VERMILLION,
    )  # fmt: skip
    mosaic["legend"].axis("off")
    mosaic["legend"].legend(handles=_handles(names, level, table), loc="center", ncols=7)
    return figure


def _zoom(axes, rows, level, style):
    """Ellipses, means and truths about the packages' centres, as large as the panel allows."""
    outlines = [np.zeros((1, 2))]
    for row in rows.itertuples():
        centre = np.array([row.package_x_mm, row.package_y_mm])
        outlines.append(ellipse(row, level) - centre)
        axes.plot(*outlines[-1].T, linewidth=0.7, **style)
        axes.plot(*(np.array([row.mean_x_mm, row.mean_y_mm]) - centre), ".", color=style["color"])
        truth = np.array([row.truth_x_mm, row.truth_y_mm]) - centre
        axes.plot(*truth, "x", color=BLACK, markersize=3, markeredgewidth=0.6)
        outlines.append(truth[None])
    for line in (axes.axhline, axes.axvline):
        line(0, linestyle=(0, (3, 2)), linewidth=0.5, color=GREY)
    reach = 1.08 * np.nanmax(np.abs(np.concatenate(outlines))) or 1.0
    axes.set(
        aspect="equal", xlabel="x from the centre (mm)", ylabel="y from the centre (mm)",
        xlim=(-reach, reach), ylim=(reach, -reach),
    )  # fmt: skip


def _style(names, samples) -> dict:
    if samples == 0:
        return {"color": SKY, "linestyle": (0, (1, 1))}
    return look(names.index(samples), "marker")


def _packages(axes, rows, array, reference):
    """Dashed outlines and quadrants, orientation markers and numbers; the reference as a star."""
    length, width = 1e3 * array.package[0], 1e3 * array.package[1]
    dashes = {"linestyle": (0, (3, 2)), "linewidth": 0.5, "color": GREY}
    centres = rows.drop_duplicates("accelerometer")
    places = [(r.accelerometer, r.package_x_mm, r.package_y_mm, r.marker_x_mm, r.marker_y_mm)
              for r in centres.itertuples()]  # fmt: skip
    if reference is not None:
        values = [1e3 * reference[f"{name}_m"] for name in ("x", "y", "marker_x", "marker_y")]
        places.append((reference.accelerometer, *values))
        axes.plot(*values[:2], "*", color=BLACK, markersize=6)
    for label, x, y, marker_x, marker_y in places:
        draw_package(axes, x, y, length, width, facecolor="none", edgecolor=GREY,
                     linestyle=(0, (3, 2)), linewidth=0.5)  # fmt: skip
        axes.plot([x - length / 2, x + length / 2], [y, y], **dashes)
        axes.plot([x, x], [y - width / 2, y + width / 2], **dashes)
        axes.plot(marker_x, marker_y, "o", color=BLACK, markersize=2.2)
        # in the gap above the package: inside, ellipses would cross it
        axes.text(x - 0.5 * length, y - 0.53 * width, label, size=6.5, va="bottom", ha="left")


def _handles(names, level, table):
    share = f"{100 * level:g} %"
    handles = [Line2D([], [], label=f"prior, {share}", **_style(names, 0))]
    for samples in names:
        handles.append(
            Line2D([], [], label=f"$T = {samples}$", marker=".", **_style(names, samples))
        )
    if table.truth_x_mm.notna().any():
        handles.append(
            Line2D([], [], linestyle="", marker="x", color=BLACK, markersize=3, label="truth")
        )
    handles.append(Line2D([], [], linestyle="", marker="*", color=BLACK, label="reference"))
    handles.append(Line2D([], [], linestyle="", marker="o", color=BLACK, markersize=2.2,
                          label="orientation marker"))  # fmt: skip
    return handles
