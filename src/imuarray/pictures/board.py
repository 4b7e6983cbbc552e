"""Drawings of a calibration and its recording, each into given axes: for pages and notebooks.

And how a recording has excited its board: directions of still poses, axes of rotation.
"""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Ellipse
from matplotlib.ticker import LogLocator

from imuarray.engine.directions import position_sds
from imuarray.errors import require_one_of
from imuarray.model.effects import KINDS
from imuarray.pictures.style import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILLION, look
from imuarray.recording import Recording
from imuarray.recording.channels import runs
from imuarray.words import fixed, joined, number

TRIED = 2000  # directions, of which the farthest from all poses is taken
GAP = 80.0  # deg, from a pose, of a direction that is missed; six faces leave 55
LITTLE = 0.1  # of the squared rate about an axis; a third is even
NEAR = 25.0  # deg, within which a direction has an axis' name
SURE = 1.96  # sds: 95 %
ELLIPSE = 5.991  # the same in a plane, squared
BINS = 1200  # of time, that a page can show
POINTS = 3000  # rotation axes that are drawn
SIDE = 1.35  # radii, of a disc's centre from the middle
CLOSE = 0.06  # of the extent: IMUs that are named together
FLAT = 0.5  # of a board's other side
LEVEL = 0.1  # of the length, a power: below it an error has levelled off; noise has 0.5
APART = 10.0  # times the usual distance of stretches: no line across
WORST = 3  # IMUs whose residuals have colours
ROOM, SMALL = 0.16, 0.08  # of the board's extent: the largest departure, an ellipse's half axis


def given_or_new(axes: Axes | None) -> Axes:
    """``axes``, or those of a new figure where None."""
    if axes is not None:
        return axes
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(5.5, 3.2), layout="constrained")[1]


def poses_of(recording: Recording) -> np.ndarray:
    """Where up was in each still pose, in the board's frame: unit vectors (P, 3)."""
    force, poses = recording.specific_force, runs(recording.still())
    means = [np.median(force[a:b], axis=1).mean(axis=0) for a, b in poses]
    ups = np.array(means).reshape(-1, 3)
    return ups / np.linalg.norm(ups, axis=1, keepdims=True)


def gap_of(poses) -> tuple[float, np.ndarray]:
    """(deg, unit vector (3,)) of the direction farthest from all poses (P, 3)."""
    # evenly over the sphere, along a spiral
    z = 1 - (2 * np.arange(TRIED) + 1) / TRIED
    angle, radius = np.pi * (3 - np.sqrt(5)) * np.arange(TRIED), np.sqrt(1 - z**2)
    tried = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    apart = np.degrees(np.arccos(np.clip(tried @ poses.T, -1, 1))).min(axis=1)
    return float(apart.max()), tried[int(np.argmax(apart))]


def missing(recording: Recording, calibration: xr.Dataset) -> list[str]:
    """Words on what has not been excited yet; nothing where all has."""
    said, poses = [], poses_of(recording)
    if len(poses):
        angle, where = gap_of(poses)
        if angle > GAP:
            components = ", ".join(fixed(value, 1) for value in where)
            said.append(f"no still pose within {angle:.0f} degrees of ({components}) up")
    rate = calibration["angular_rate"].to_numpy()
    squares, axes = np.linalg.eigh(rate.T @ rate)  # the least first
    least, axis = squares[0] / squares.sum(), direction(axes[:, 0])
    if least < LITTLE:
        share = number(100 * least, 2)
        said.append(f"hardly any turning about {axis}: {share} % of the squared rate")
    return said


def shown(recording: Recording, calibration: xr.Dataset) -> str:
    """`missing` as a sentence of a caption."""
    said = missing(recording, calibration)
    if said:
        return f"Not yet excited: {joined(said)}."
    rate = calibration["angular_rate"].to_numpy() ** 2
    parts = [f"{name} {100 * share:.0f} %" for name, share in
             zip("xyz", rate.sum(axis=0) / rate.sum(), strict=True)]  # fmt: skip
    turned = f"it was turned about all axes ({', '.join(parts)} of the squared rate)"
    poses = poses_of(recording)
    if not len(poses):
        return f"There are no still poses; {turned}."
    return f"No direction is more than {gap_of(poses)[0]:.0f} degrees from a still pose; {turned}."


def direction(vector) -> str:
    """'−z' of a unit vector near an axis, else its components."""
    place = int(np.argmax(np.abs(vector)))
    if np.degrees(np.arccos(min(abs(vector[place]), 1.0))) < NEAR:
        return f"{'−' if vector[place] < 0 else '+'}{'xyz'[place]}"
    return f"({', '.join(fixed(value, 1) for value in vector)})"


def plain(text) -> str:
    """A recording's own text as matplotlib shows it: no mathematics in it."""
    return str(text).replace("$", r"\$")


def positions(calibration: xr.Dataset, axes: Axes | None = None) -> Axes:
    """Each IMU's displacement from its nominal position with 95 % intervals."""
    axes = given_or_new(axes)
    moved = (calibration["position"] - calibration["nominal_position"]).to_numpy()[1:]
    sds = position_sds(calibration)[1:]
    factor, unit = (1e3, "mm") if np.abs(moved).max() > 1e-3 else (1e6, "µm")
    places = np.arange(len(moved))
    for which, name in enumerate("xyz"):
        axes.errorbar(
            places + 0.2 * (which - 1), factor * moved[:, which], SURE * factor * sds[:, which],
            label=name, **look(which, "linestyle") | {"linestyle": "none", "markersize": 3.5},
        )  # fmt: skip
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    labels = [plain(label) for label in calibration["accelerometer"].to_numpy()]
    axes.set_xticks(places, labels[1:])
    axes.set(xlabel=f"IMU (relative to {labels[0]})", ylabel=f"from the drawing ({unit})")
    axes.legend(ncols=3)
    return axes


def board(calibration: xr.Dataset, plane: str = "xy", axes: Axes | None = None) -> Axes:
    """The board in a plane ("xy", "xz" or "yz"), nominal to found, with 95 % ellipses.

    Departures and ellipses are enlarged by factors that its title says.
    """
    require_one_of("plane", plane, ("xy", "xz", "yz"))
    axes = given_or_new(axes)
    i, j = ("xyz".index(name) for name in plane)
    nominal = calibration["nominal_position"].to_numpy()
    moved = calibration["position"].to_numpy() - nominal
    covariance = calibration["position_covariance"].to_numpy()
    extent = float(np.ptp(nominal, axis=0).max())
    by = round_factor(ROOM * extent / max(np.abs(moved).max(), 1e-9))
    wide = round_factor(SMALL * extent / max(SURE * position_sds(calibration).max(), 1e-9))
    for k in range(len(nominal)):
        start, end = 1e3 * nominal[k], 1e3 * (nominal[k] + by * moved[k])
        axes.plot(*start[[i, j]], "+", color=GREY, markersize=7)
        if k:
            way = {"arrowstyle": "-|>", "color": BLUE, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", end[[i, j]], start[[i, j]], arrowprops=way)
            inner = covariance[k][:, k][np.ix_([i, j], [i, j])]
            axes.add_patch(_ellipse(end[[i, j]], 1e6 * wide**2 * ELLIPSE * inner))
    for alike in _together(nominal[:, [i, j]], CLOSE * extent):
        # on the side that the arrow leaves free
        way = -moved[alike[-1], [i, j]] if alike[-1] else np.array([-1.0, -1.0])
        aside = 10 * way / max(np.linalg.norm(way), 1e-9)
        names = plain(", ".join(map(str, calibration["accelerometer"].to_numpy()[alike])))
        axes.annotate(names, 1e3 * nominal[alike[0], [i, j]], xytext=aside, size=8, weight="bold",
                      textcoords="offset points", ha="center", va="center")  # fmt: skip
    axes.set(xlabel=f"{plane[0]} (mm)", ylabel=f"{plane[1]} (mm)", aspect="equal")
    axes.margins(0.18)
    _no_strip(axes)
    axes.set_title(f"departures × {by:g}, ellipses (95 %) × {wide:g}", size=7.5)
    return axes


def _together(places, close: float) -> list[list[int]]:
    """Numbers of places (A, 2), those near an earlier one with it."""
    found: list[list[int]] = []
    for k, place in enumerate(places):
        near = [one for one in found if np.linalg.norm(places[one[0]] - place) < close]
        if near:
            near[0].append(k)
        else:
            found.append([k])
    return found


def _no_strip(axes: Axes) -> None:
    """No side shorter than FLAT of the other."""
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    spans = np.ptp(limits, axis=1)
    more = np.maximum(FLAT * spans[::-1] - spans, 0.0) / 2
    x_limits, y_limits = limits + more[:, None] * [-1, 1]
    axes.set(xlim=x_limits, ylim=y_limits)


def round_factor(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that is no more than ``value``, or 1."""
    if value <= 1:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value))


def _ellipse(centre, matrix) -> Ellipse:
    """The boundary x' matrix^-1 x = 1."""
    values, vectors = np.linalg.eigh(matrix)
    size = 2 * np.sqrt(np.maximum(values, 0.0))
    angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    return Ellipse(tuple(centre), size[1], size[0], angle=angle, facecolor=(VERMILLION, 0.15),
                   edgecolor=VERMILLION, linewidth=0.9)  # fmt: skip


def timeline(recording: Recording, calibration: xr.Dataset, axes: Axes | None = None) -> Axes:
    """Angular speed against time; beneath it still poses, samples used, rails and shocks."""
    axes = given_or_new(axes)
    time = recording.time - recording.time[0]
    edges = np.linspace(0, time[-1], min(BINS, len(time)) + 1)
    bins = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, len(edges) - 2)
    speed = np.degrees(np.linalg.norm(np.median(recording.angular_rate, axis=1), axis=1))
    fastest = np.zeros(len(edges) - 1)
    np.maximum.at(fastest, bins, speed)
    axes.plot((edges[1:] + edges[:-1]) / 2, fastest, color=BLACK, linewidth=0.7)
    top, names = float(fastest.max()), []
    for which, (name, color, flags) in enumerate(_rows(recording, calibration)):
        shown = np.bincount(bins, flags, len(edges) - 1) > 0
        spans = [(edges[a], edges[b] - edges[a]) for a, b in runs(shown)]
        place = -top * (0.1 + 0.11 * which)
        axes.broken_barh(spans, (place - 0.035 * top, 0.07 * top), color=color, linewidth=0)
        names.append((place, name if flags.any() else f"{name}: none"))
    step = round_factor(top / 2)
    speeds = np.arange(0, top, step)
    axes.set_yticks([place for place, _ in names] + list(speeds),
                    [name for _, name in names] + [f"{value:g}" for value in speeds])  # fmt: skip
    axes.grid(False, axis="y")
    axes.set(xlabel="time (s)", ylabel="angular speed (deg/s)", xlim=(0, time[-1]))
    axes.set_ylim(-0.52 * top, 1.05 * top)
    return axes


def _rows(recording: Recording, calibration: xr.Dataset) -> list[tuple[str, str, np.ndarray]]:
    """Rows of a timeline: name, colour, (T,) bool."""
    count = len(recording.time)
    places = np.searchsorted(recording.time, calibration["time"].to_numpy() - 1e-9)
    used, shaken = (np.zeros(count, bool) for _ in range(2))
    used[np.clip(places, 0, count - 1)] = True
    shaken[np.clip(places, 0, count - 1)] = calibration["shaken"].to_numpy() > 0
    rails = [recording.at_rail(kind) for kind in KINDS]
    return [
        ("still poses", SKY, recording.still()), ("used for positions", GREEN, used),
        ("at a rail", ORANGE, np.any(rails, axis=0)), ("shocks", VERMILLION, shaken),
    ]  # fmt: skip


def sphere(recording: Recording, calibration: xr.Dataset, axes: Axes | None = None) -> Axes:
    """Where up was in still poses, and about what axes the board turned, seen from +z and −z.

    Equal areas of the discs are equal areas of the sphere.
    """
    axes = given_or_new(axes)
    rate = calibration["angular_rate"].to_numpy()
    rate = rate[:: max(len(rate) // POINTS, 1)]
    turn = rate / np.maximum(np.linalg.norm(rate, axis=1, keepdims=True), 1e-12)
    size = np.linalg.norm(rate, axis=1) / np.linalg.norm(rate, axis=1).max()
    for side, centre in ((1, -SIDE), (-1, SIDE)):
        axes.add_patch(Circle((centre, 0), 1, facecolor="white", edgecolor=GREY, linewidth=0.8))
        for half in (30, 60):
            ring = np.sqrt(1 - np.cos(np.radians(half)))
            axes.add_patch(Circle((centre, 0), ring, fill=False, edgecolor="0.85", linewidth=0.5))
        visible = turn[:, 2] * side >= 0
        points = _disc(turn[visible], side, centre)
        axes.scatter(*points, s=14 * size[visible] ** 2, color=BLUE, alpha=0.3, linewidth=0)
        poses = poses_of(recording)
        visible = poses[:, 2] * side >= 0
        axes.plot(*_disc(poses[visible], side, centre), "o", color=VERMILLION, markersize=6,
                  markeredgecolor="white")  # fmt: skip
        for vector in np.vstack([np.eye(3), -np.eye(3)]):
            if vector[2] * side >= 0:
                place = np.array(_disc(vector[None], side, centre))[:, 0]
                out = place + (0.12 * (place - np.array([centre, 0])) if vector[2] == 0 else 0.1)
                axes.text(*out, direction(vector), ha="center", va="center", size=9, weight="bold")
    axes.plot([], [], "o", color=VERMILLION, markersize=6, label="up in a still pose")
    axes.plot(
        [], [], "o", color=BLUE, alpha=0.5, markersize=3, label="axis of rotation (larger: faster)"
    )
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, -0.14), ncols=2, frameon=False)
    axes.set(xlim=(-2.65, 2.65), ylim=(-1.2, 1.2), aspect="equal")
    axes.set_axis_off()
    return axes


def _disc(vectors, side: int, centre: float) -> tuple[np.ndarray, np.ndarray]:
    """Lambert's azimuthal projection of (K, 3) on a hemisphere; mirrored from below."""
    radius = 1 / np.sqrt(1 + np.abs(vectors[:, 2]))
    return centre + side * radius * vectors[:, 0], radius * vectors[:, 1]


def length(calibration: xr.Dataset, axes: Axes | None = None) -> Axes:
    """Sds of the positions had the motion ended earlier, by the information until then."""
    axes = given_or_new(axes)
    seconds = calibration["length"].to_numpy()
    sds = 1e6 * calibration["position_sd_by_length"].to_numpy()[:, 1:]
    rms, worst = np.sqrt(np.mean(sds**2, axis=(1, 2))), sds.max(axis=(1, 2))
    axes.plot(seconds, worst, label="worst coordinate", **look(0) | {"markersize": 3})
    axes.plot(seconds, rms, label="rms", **look(2) | {"markersize": 3.5})
    if not levelled(calibration):
        ahead, less = seconds[-1] * np.array([1, 4]), rms[-1] * np.array([1, 0.5])
        axes.plot(ahead, less, ":", color=GREY, label="with more of such motion: 1/√length")
    axes.set(xscale="log", yscale="log", xlabel="recorded motion (s)")
    axes.set_ylabel("sd of a coordinate (µm)")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.set_minor_formatter(lambda value, _: "")
    axes.legend()
    return axes


def levelled(calibration: xr.Dataset) -> bool:
    """True where the second half of the motion has gained next to nothing."""
    seconds = calibration["length"].to_numpy()
    sds = calibration["position_sd_by_length"].to_numpy()[:, 1:]
    rms = np.log(np.sqrt(np.mean(sds**2, axis=(1, 2))))
    half = max(seconds[-1] / 2, seconds[0])
    gained = np.interp(half, seconds, rms) - rms[-1]
    return bool(gained < LEVEL * np.log(seconds[-1] / half))


def residual_course(
    calibration: xr.Dataset, kind: str = "accelerometer", axes: Axes | None = None
) -> Axes:
    """Residual of each "accelerometer" or "gyroscope" against time, over the declared noise."""
    require_one_of("kind", kind, KINDS)
    axes = given_or_new(axes)
    rms = calibration[f"{kind}_residual"].to_numpy()
    time, labels = calibration["stretch"].to_numpy(), calibration[kind].to_numpy()
    worst = np.argsort(-np.sqrt(np.mean(rms**2, axis=0)))[:WORST]
    others, top = np.setdiff1d(np.arange(rms.shape[1]), worst), max(float(rms.max()), 1.0)
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > APART * np.median(steps)) + 1 if len(steps) else []
    time, rms = np.insert(time, gaps, np.nan), np.insert(rms, gaps, np.nan, axis=0)
    axes.plot(time, rms[:, others], color="0.75", linewidth=0.8)
    for which, k in enumerate(worst):
        name = f"IMU {plain(labels[k])}"
        style = look(which, "linestyle") | {"markersize": 2, "linewidth": 0.8}
        axes.plot(time, rms[:, k], label=name, **style)
    if len(others):
        axes.plot([], [], color="0.75", label="others")
    axes.axhline(1.0, color=BLACK, linewidth=0.6)
    axes.set(xlabel="time (s)", ylabel="residual / declared noise", title=f"{kind}s")
    axes.set_ylim(0, 1.15 * top)
    if top > 10:
        axes.set(yscale="log", ylim=(0.5, 1.5 * top))
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.legend(ncols=2, fontsize=6.5)
    return axes
