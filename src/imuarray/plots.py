"""Plots for a notebook: each draws into ``axes``, or into a new figure, and returns the axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from imuarray.errors import require_one_of
from imuarray.figures.style import GREY, look
from imuarray.model.effects import KINDS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from imuarray.diagnosis.document import Diagnosis
    from imuarray.firstorder.noise import StillNoise
    from imuarray.recording import Recording

MOTION = {
    "angular_rate": ("angular rate (deg/s)", np.degrees(1)),
    "angular_acceleration": ("angular acceleration (deg/s²)", np.degrees(1)),
    "specific_force": ("specific force (m/s²)", 1.0),
}


def _axes(axes: Axes | None) -> Axes:
    if axes is not None:
        return axes
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(5.5, 3.2), layout="constrained")[1]


def positions(calibration: xr.Dataset, axes: Axes | None = None) -> Axes:
    """Each triad's displacement from its nominal position, with 95 % intervals.

    ``calibration``: what `imuarray.calibrate` gave, here and in those that follow.
    """
    return _drawn("positions", axes, calibration)


def board(calibration: xr.Dataset, plane: str = "xy", axes: Axes | None = None) -> Axes:
    """The board in a plane, nominal to found, departures and 95 % ellipses enlarged."""
    require_one_of("plane", plane, ("xy", "xz", "yz"))
    return _drawn("board", axes, calibration, plane)


def timeline(recording: Recording, calibration: xr.Dataset, axes: Axes | None = None) -> Axes:
    """The recording that was calibrated: speed, still poses, samples used, rails, shocks."""
    return _drawn("timeline", axes, recording, calibration)


def sphere(recording: Recording, calibration: xr.Dataset, axes: Axes | None = None) -> Axes:
    """Directions of its still poses and axes of its rotation, from +z and from -z."""
    return _drawn("sphere", axes, recording, calibration)


def length(calibration: xr.Dataset, axes: Axes | None = None) -> Axes:
    """Standard deviations of the positions, had the motion ended earlier."""
    return _drawn("length", axes, calibration)


def residual_course(
    calibration: xr.Dataset, kind: str = "accelerometer", axes: Axes | None = None
) -> Axes:
    """Each triad's residual against time, in declared noise sds."""
    require_one_of("kind", kind, KINDS)
    return _drawn("residual_course", axes, calibration, kind)


def _drawn(name: str, axes: Axes | None, *given) -> Axes:
    """One of the pictures that the page of `imuarray board` has."""
    from imuarray.report import pictures

    axes = _axes(axes)
    getattr(pictures, name)(*given, axes)
    return axes


def posterior(chains: xr.DataTree, accelerometer: str, axes: Axes | None = None) -> Axes:
    """One triad's posterior per axis (mm from the prior's mean), the prior dotted.

    ``chains``: what `imuarray.sample` gave; InputError for a triad that it does not have.
    """
    draws, mean, sd = _of(chains, accelerometer)
    axes = _axes(axes)
    for number, name in enumerate("xyz"):
        values = 1e3 * (draws[..., number].ravel() - mean[number])
        style = look(number, "marker")
        axes.hist(values, bins=60, density=True, histtype="step", label=name, **style)
    left, right = axes.get_xlim()
    grid = np.linspace(left, right, 300)
    width = 1e3 * sd[0]
    density = np.exp(-0.5 * (grid / width) ** 2) / (width * np.sqrt(2 * np.pi))
    axes.plot(grid, density, ":", color=GREY, label="prior")
    axes.set(
        xlabel=f"triad {accelerometer}, from its nominal position (mm)", ylabel="density (1/mm)"
    )
    axes.legend()
    return axes


def trace(chains: xr.DataTree, accelerometer: str, axis: str, axes: Axes | None = None) -> Axes:
    """The chains of one coordinate, in mm, against the transitions."""
    draws, _, _ = _of(chains, accelerometer)
    axes, number = _axes(axes), "xyz".index(axis)
    steps = np.arange(draws.shape[1]) * int(chains.attrs["thin"])
    for chain, values in enumerate(draws[..., number]):
        style = {"linewidth": 0.6, "label": f"chain {chain + 1}"}
        axes.plot(steps, 1e3 * values, **look(chain, "marker", "linestyle") | style)
    axes.set(xlabel="transition", ylabel=f"triad {accelerometer}, {axis} (mm)")
    axes.legend(ncols=2)
    return axes


def _of(chains: xr.DataTree, accelerometer: str):
    """(draws (chain, draw, 3), prior mean (3,), prior sd (3,)) of one triad, in m."""
    known = [str(label) for label in chains["posterior"]["accelerometer"].to_numpy()]
    require_one_of("accelerometer", accelerometer, known)
    of = {"accelerometer": known.index(accelerometer)}
    prior = chains["prior"]
    return tuple(
        field.isel(of).to_numpy()
        for field in (chains["posterior"]["position"], prior["position_mean"], prior["position_sd"])
    )


def motion(dataset: xr.Dataset, quantity: str = "angular_rate", axes: Axes | None = None) -> Axes:
    """Angular rate, angular acceleration or specific force against time, with 95 % bands.

    ``dataset``: what `imuarray.apply` gave; InputError for another ``quantity``.
    """
    require_one_of("quantity", quantity, MOTION)
    axes, (label, factor) = _axes(axes), MOTION[quantity]
    time = dataset["time"].to_numpy()
    values, sds = (factor * dataset[name].to_numpy() for name in (quantity, f"{quantity}_sd"))
    for number, name in enumerate("xyz"):
        style, centre = look(number, "marker"), values[:, number]
        axes.plot(time, centre, linewidth=0.8, label=name, **style)
        half = 1.96 * sds[:, number]
        axes.fill_between(time, centre - half, centre + half, color=style["color"], alpha=0.25)
    axes.set(xlabel="time (s)", ylabel=label)
    axes.legend(ncols=3)
    return axes


def allan(noise: StillNoise) -> list[Axes]:
    """Allan deviations and spectra of all axes, and the terms found; of `imuarray.allan`."""
    from imuarray.figures.measured import noise_figure

    return noise_figure(noise).axes


def discrepancies(diagnosis: Diagnosis) -> list[Axes]:
    """Each check of the residual against simulations of the fitted model."""
    from imuarray.report.drawings import discrepancy_figure
    from imuarray.report.numbers import discrepancy_table

    return discrepancy_figure(discrepancy_table(diagnosis)).axes


def gains(diagnosis: Diagnosis) -> list[Axes]:
    """What each cause gains on held-out time."""
    from imuarray.report.drawings import gain_figure
    from imuarray.report.numbers import gain_table

    return gain_figure(gain_table(diagnosis)).axes
