"""Figure 2 of 2017, 1 and 5 of 2021: the array, and where in its package each triad is."""

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from scipy.stats import chi2

from imuarray.geometry import UNDERSIDE_ROTATION, Array, array_from_config
from imuarray.pictures.style import BLACK, BLUE, GREY, PAGE, SKY, VERMILLION, look
from imuarray_papers.figures.paper2021 import after_burn_in, prior_of
from imuarray_papers.figures.style import chain_lines, drawing, scale_line

# The orientation marker in a topside package, in units of the package's sides. The text does
# not say in which corner it is; on the axis that the underside is turned around, as here, both
# sides' markers lie one above the other.
MARKER = np.array([0.36, -0.36, 0.0])
OBLIQUE = np.array([[1.0, 0.0], [0.45, -0.4], [0.0, 5.5]])  # where x, y, z go on the paper
UNDERSIDE = {"color": "#9AD0F5", "style": "italic"}  # of a number
ARROW = {"arrowstyle": "<->", "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0}


def layout_table(array: Array) -> pd.DataFrame:
    """One row per triad: label, side, position, position relative to the first, marker (m)."""
    height = array.positions[:, 2]
    # below the middle of the board's height
    under = height < (height.min() + height.max()) / 2 - 1e-9
    turn = np.where(under[:, None, None], UNDERSIDE_ROTATION, np.eye(3))
    marker = turn @ (MARKER * np.array(array.package))
    places = np.hstack([array.positions, array.relative, array.positions + marker])
    names = [f"{part}{axis}_m" for part in ("", "relative_", "marker_") for axis in "xyz"]
    table = pd.DataFrame(places, columns=names)
    table.insert(0, "accelerometer", array.labels)
    table.insert(1, "side", np.where(under, "underside", "topside"))
    sizes = ("package_length_m", "package_width_m", "package_height_m")
    return table.assign(**dict(zip(sizes, array.package, strict=True)))


def figure_2021_fig1(settings: dict):
    """Layout and dimensions: top view (y axis downwards) with numbers and pitch, and side view."""
    return _nominal(settings, _draw_fig1, 4.0)


def figure_2017_fig2(settings: dict):
    """The array of the simulations, seen obliquely; crosses: where its sensing elements are."""
    return _nominal(settings, _draw_oblique, 2.9)


def _nominal(settings: dict, draw, height: float):
    array = array_from_config(settings["array"])
    footer = [scale_line(settings, f"array {array.name}, nominal")]
    return drawing(draw, footer, height=height), layout_table(array)


def _draw_oblique(figure, table):
    axes = figure.subplots()
    mm = 1e3 * table.filter(regex="_m$")
    size = mm[["package_length_m", "package_width_m"]].iloc[0].to_numpy()
    places = mm[["x_m", "y_m", "z_m"]].to_numpy()
    low, high = places.min(axis=0), places.max(axis=0)
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)])

    def outline(middle, half, z, **style):
        flat = np.column_stack([middle + square * half, np.full(len(square), z)])
        axes.fill(*(flat @ OBLIQUE).T, linewidth=0.6, **style)

    under = (table.side == "underside").to_numpy()
    for side, z, style in ((under, low[2], ":"), (~under, high[2], "-")):
        for place in places[side]:
            outline(place[:2], size / 2, z, facecolor="none", edgecolor=GREY, linestyle=style)
        if side.any():
            axes.plot(*(places[side] @ OBLIQUE).T, "x", color=VERMILLION, markersize=4)
        middle, half = (low + high)[:2] / 2, (high - low)[:2] / 2 + 0.8 * size
        outline(middle, half, z, facecolor="#BFD8C6", edgecolor="0.4", alpha=0.35)
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.set_title(f"{(~under).sum()} IMUs on the topside (solid), {under.sum()} on the underside;"
                   f" height × {OBLIQUE[2, 1]:g}", size=7)  # fmt: skip
    axes.axis("off")


def _draw_fig1(figure, table):
    top, side = figure.subplots(2, 1, height_ratios=[6.2, 1], sharex=True)
    _top_view(top, table)
    _side_view(side, table)


def _top_view(axes, table):
    mm = 1e3 * table.filter(regex="_m$")
    length, width = mm.package_length_m.iloc[0], mm.package_width_m.iloc[0]
    under = (table.side == "underside").to_numpy()
    for row in mm.itertuples():
        if not under[row.Index]:
            _rectangle(axes, row.x_m, row.y_m, length, width, facecolor="0.35")
            axes.plot(row.marker_x_m, row.marker_y_m, "o", color="white", markersize=3.2)
        label, y = table.accelerometer[row.Index], row.y_m + (0.62 if under[row.Index] else -0.62)
        looks = UNDERSIDE if under[row.Index] else {"color": "white"}
        axes.text(row.x_m, y, label, ha="center", va="center", size=8, **looks)
    _pitch(axes, mm.x_m, mm.y_m.max() + 0.75 * width, "x")
    _pitch(axes, mm.y_m, mm.x_m.min() - 0.75 * length, "y")
    axes.set(aspect="equal", ylabel="y (mm), downwards")
    axes.set_ylim(mm.y_m.max() + 1.3 * width, mm.y_m.min() - 0.8 * width)
    axes.set_xlim(mm.x_m.min() - 2.15 * length, mm.x_m.max() + length)
    axes.grid(False)
    axes.set_title("Seen from above: upright topside, italic underside", size=8)


def _rectangle(axes, x, y, length, width, **options):
    """The outline of a package or the board, centred at x, y; all in mm."""
    options = {"edgecolor": BLACK, "linewidth": 0.6} | options
    axes.add_patch(Rectangle((x - length / 2, y - width / 2), length, width, **options))


def _pitch(axes, values, place, along):
    """The distance between the first two distinct centres, drawn at ``place`` across."""
    centres = np.unique(np.round(values, 9))
    if centres.size < 2:
        return
    if along == "x":
        _distance(axes, (centres[0], place), (centres[1], place), ha="center", xytext=(0, -7))
    else:
        ends = (place, centres[-1]), (place, centres[-2])
        _distance(axes, *ends, ha="center", xytext=(-7, 0), rotation=90)


def _distance(axes, start, end, **options):
    """A double arrow between two points (mm), and its length beside the middle."""
    axes.annotate("", start, end, arrowprops=ARROW)
    axes.annotate(
        f"{np.linalg.norm(np.subtract(end, start)):.1f} mm", np.mean([start, end], axis=0),
        va="center", size=7.5, textcoords="offset points", **options,
    )  # fmt: skip


def _side_view(axes, table):
    mm = 1e3 * table.filter(regex="_m$")
    length, height = mm.package_length_m.iloc[0], mm.package_height_m.iloc[0]
    low, high = mm.z_m.min(), mm.z_m.max()
    if high - low > height:  # what is between the packages is the circuit board
        size = np.ptp(mm.x_m) + 1.4 * length, high - low - height
        board = {"facecolor": "#BFD8C6", "edgecolor": "0.4", "linewidth": 0.5}
        _rectangle(axes, (mm.x_m.min() + mm.x_m.max()) / 2, (low + high) / 2, *size, **board)
    for x, z in sorted(set(zip(mm.x_m.round(6), mm.z_m.round(6), strict=True))):
        _rectangle(axes, x, z, length, height, facecolor="0.35")
        axes.plot(x, z, "+", color="white", markersize=4)
    if high > low:
        place, edge = mm.x_m.min() - 0.8 * length, mm.x_m.min() - length / 2
        _distance(axes, (place, low), (place, high), ha="right", xytext=(-3, 0))
        axes.plot([place, edge], [[low, high]] * 2, color=BLUE, linewidth=0.4)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="z (mm)", ylim=(low - 1.2, high + 1.2))
    axes.grid(False)
    axes.set_title("Side view", size=8)


def figure_2021_fig5(
    chains: list, verdicts: list[dict], coordinates: list, recordings: list, settings: dict
):  # fmt: skip
    """Ellipses of the posteriors on (a) topside and (b) underside, at their true size.

    Both seen from above with the y axis downwards. ``chains`` as `posterior.chains.read_chains`
    gives them, ``verdicts`` and ``coordinates`` of `posterior/`, one for each T; the array is
    the first of those of ``recordings``.
    """
    array = recordings[0]
    draws, verdicts = after_burn_in(chains, verdicts)
    known = "truth_m" in coordinates[0]
    truth = coordinates[0].truth_m.to_numpy().reshape(-1, 3) if known else None
    posteriors = {samples: _moments_of(values) for samples, values in draws.items()}
    measured = f"recording {settings['experiment']['recording']}"
    footer = [scale_line(settings, measured), *chain_lines(verdicts)]
    table = ellipse_table(array, posteriors, prior_of(chains), truth)
    return _ellipses(table, array, settings, footer, "MEASURED")


def figure_experiment(located: xr.Dataset, recordings: list, name: str, settings: dict):
    """`figure_2021_fig5` once more, under the sensor model.

    ``located``: `measured.left_out.located` of the recording ``name``.
    """
    array = recordings[0]
    posteriors = {}
    for each in located.samples.to_numpy():
        one = located.sel(samples=each).isel(accelerometer=slice(1, None))
        wide = one.position_covariance.isel(accelerometer_other=slice(1, None)).to_numpy()
        own = wide[range(len(wide)), :, range(len(wide))]
        posteriors[int(each)] = one.position.to_numpy(), own[:, :2, :2]
    nominal = located.nominal_position.to_numpy().reshape(-1, *array.positions.shape)[0, 1:]
    sd = np.full(nominal.shape, located.attrs["position_prior_sd"])
    table = ellipse_table(array, posteriors, (nominal, sd))
    footer = [
        f"Recording {name}, measured. Sensor model: maps, delays and lever arms from the board's"
        " other recordings, biases and clocks from the whole recording, positions from T samples."
    ]
    return _ellipses(table, array, settings, footer, "MEASURED, SENSOR MODEL")


def _ellipses(table: pd.DataFrame, array: Array, settings: dict, footer: list[str], title: str):
    level = settings["experiment"]["ellipse_level"]
    table.attrs["digits"] = {"mean_x_mm": 6, "mean_y_mm": 6}  # far from 0, and narrow
    given = {"layout": layout_table(array), "level": level, "title": title}
    return drawing(_draw_ellipses, footer, PAGE, 6.6, **given), table


def _draw_ellipses(figure, table: pd.DataFrame, layout: pd.DataFrame, level: float, title: str):
    """Both sides of the board with the ellipses of `ellipse_table`, and all packages enlarged."""
    mosaic = figure.subplot_mosaic(
        [["topside", "underside"], ["top zoom", "under zoom"], ["legend", "legend"]],
        height_ratios=[3.3, 2.2, 0.2],
    )  # fmt: skip
    names = sorted(samples for samples in table.samples.unique() if samples > 0)
    reach = 1e3 * layout[["x_m", "y_m"]].abs().to_numpy().max() + 4.4
    for letter, side, zoom in (("a", "topside", "top zoom"), ("b", "underside", "under zoom")):
        axes, rows = mosaic[side], table[table.side == side]
        _packages(axes, layout[layout.side == side])
        for row in rows.itertuples():
            style = _style(names, row.samples)
            axes.plot(*ellipse(row, level).T, linewidth=0.8, **style)
            if row.samples > 0:
                axes.plot(row.mean_x_mm, row.mean_y_mm, ".", color=style["color"], markersize=1.5)
        axes.set(
            aspect="equal", xlabel="x (mm)", ylabel="y (mm), downwards", xlim=(-reach, reach),
            ylim=(reach, -reach), title=f"({letter}) {side}, seen from above",
        )  # fmt: skip
        axes.grid(False)
        _zoom(mosaic[zoom], rows[rows.samples == names[-1]], level, _style(names, names[-1]))
        mosaic[zoom].set_title(f"({letter}) all packages laid over each other, $T = {names[-1]}$")
    mosaic["legend"].axis("off")
    mosaic["legend"].legend(handles=_handles(names, level, table), loc="center", ncols=7)
    figure.suptitle(title, size=8, weight="bold")


def _moments_of(draws) -> tuple[np.ndarray, np.ndarray]:
    """Mean (A - 1, 3) and covariance (A - 1, 2, 2) of x and y from (chains, draws, A - 1, 3)."""
    draws = draws.reshape(-1, *draws.shape[2:])
    plane = np.moveaxis(draws[..., :2], 1, 0)
    return draws.mean(axis=0), np.array([np.cov(own.T) for own in plane])


def ellipse_table(array: Array, posteriors: dict, prior, truth=None) -> pd.DataFrame:
    """Means and covariances of x and y, in mm in the array frame, per triad and T.

    ``posteriors[T]``: mean (A - 1, 3) m relative to the first triad and covariance (A - 1, 2, 2)
    of x and y; ``prior`` mean and sd, each (A - 1, 3) m; ``truth`` (A - 1, 3) m where known. Rows
    with samples 0 are the prior.
    """
    names = {"x_m": "package_x_mm", "y_m": "package_y_mm",
             "marker_x_m": "marker_x_mm", "marker_y_m": "marker_y_mm"}  # fmt: skip
    layout = layout_table(array).iloc[1:].reset_index(drop=True)
    table = layout[["accelerometer", "side"]].join(1e3 * layout[[*names]].rename(columns=names))
    origin = array.positions[0, :2]
    known = np.full((len(table), 2), np.nan) if truth is None else truth[:, :2] + origin
    table = table.assign(truth_x_mm=1e3 * known[:, 0], truth_y_mm=1e3 * known[:, 1])
    parts = []
    prior = prior[0], prior[1][:, :2, None] ** 2 * np.eye(2)
    for samples, (mean, covariance) in ({0: prior} | posteriors).items():
        centre, covariance = 1e3 * (mean[:, :2] + origin), 1e6 * covariance
        parts.append(table.assign(
            samples=samples, mean_x_mm=centre[:, 0], mean_y_mm=centre[:, 1],
            cov_xx_mm2=covariance[:, 0, 0], cov_xy_mm2=covariance[:, 0, 1],
            cov_yy_mm2=covariance[:, 1, 1],
        ))  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def ellipse(row, level: float, points: int = 73) -> np.ndarray:
    """Outline (points, 2) mm of the Gaussian's ellipse that holds the share ``level``."""
    covariance = [[row.cov_xx_mm2, row.cov_xy_mm2], [row.cov_xy_mm2, row.cov_yy_mm2]]
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0, 2 * np.pi, points)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    radii = np.sqrt(chi2.ppf(level, 2) * np.maximum(values, 0))
    return [row.mean_x_mm, row.mean_y_mm] + (circle * radii) @ vectors.T


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


def _packages(axes, layout):
    """Dashed outlines and quadrants, orientation markers and numbers; the reference as a star."""
    dashes = {"linestyle": (0, (3, 2)), "linewidth": 0.5}
    mm = 1e3 * layout.filter(regex="_m$")
    if 0 in mm.index:
        axes.plot(mm.x_m[0], mm.y_m[0], "*", color=BLACK, markersize=6)
    for number in sorted(mm.index, key=lambda index: (index == 0, index)):  # the reference last
        row, label = mm.loc[number], layout.accelerometer[number]
        x, y, length, width = row[["x_m", "y_m", "package_length_m", "package_width_m"]]
        _rectangle(axes, x, y, length, width, facecolor="none", edgecolor=GREY, **dashes)
        axes.plot([x - length / 2, x + length / 2], [y, y], color=GREY, **dashes)
        axes.plot([x, x], [y - width / 2, y + width / 2], color=GREY, **dashes)
        axes.plot(row.marker_x_m, row.marker_y_m, "o", color=BLACK, markersize=2.2)
        # in the gap above the package: inside, ellipses would cross it
        axes.text(x - 0.5 * length, y - 0.53 * width, label, size=6.5, va="bottom", ha="left")


def _handles(names, level, table):
    handles = [Line2D([], [], label=f"prior, {100 * level:g} %", **_style(names, 0))]
    for samples in names:
        style = _style(names, samples)
        handles.append(Line2D([], [], label=f"$T = {samples}$", marker=".", **style))
    signs = [("truth", "x", 3)] if table.truth_x_mm.notna().any() else []
    for label, marker, size in (*signs, ("reference", "*", None), ("orientation marker", "o", 2.2)):
        handles.append(
            Line2D([], [], linestyle="", marker=marker, color=BLACK, markersize=size, label=label)
        )
    return handles
