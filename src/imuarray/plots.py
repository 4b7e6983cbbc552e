"""Plots for a notebook: each draws into ``axes``, or into a new figure, and returns the axes."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from imuarray.errors import require_one_of
from imuarray.firstorder.noise import StillNoise
from imuarray.pictures.board import (
    SURE,
    board,
    given_or_new,
    length,
    positions,
    residual_course,
    sphere,
    timeline,
)
from imuarray.pictures.noise import noise_figure
from imuarray.pictures.style import GREY, look

__all__ = [
    "allan", "board", "length", "motion", "positions", "posterior",
    "residual_course", "sphere", "timeline",
]  # fmt: skip
MOTION = {
    "angular_rate": ("angular rate (deg/s)", np.degrees(1)),
    "angular_acceleration": ("angular acceleration (deg/s²)", np.degrees(1)),
    "specific_force": ("specific force (m/s²)", 1.0),
}


def posterior(chains: xr.DataTree, accelerometer: str, axes: Axes | None = None) -> Axes:
    """One triad's posterior per axis (mm from the prior's mean), the prior dotted.

    ``chains``: what `imuarray.sample` gave; InputError for a triad that it does not have.
    """
    known = [str(label) for label in chains["posterior"]["accelerometer"].to_numpy()]
    require_one_of("accelerometer", accelerometer, known)
    axes, one = given_or_new(axes), {"accelerometer": known.index(accelerometer)}
    draws = chains["posterior"]["position"].isel(one).to_numpy()
    mean, sd = (chains["prior"][f"position_{x}"].isel(one).to_numpy() for x in ("mean", "sd"))
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


def motion(dataset: xr.Dataset, quantity: str = "angular_rate", axes: Axes | None = None) -> Axes:
    """Angular rate, angular acceleration or specific force against time, with 95 % bands.

    ``dataset``: what `imuarray.apply` gave; InputError for another ``quantity``.
    """
    require_one_of("quantity", quantity, MOTION)
    axes, (label, factor) = given_or_new(axes), MOTION[quantity]
    time = dataset["time"].to_numpy()
    values, sds = (factor * dataset[name].to_numpy() for name in (quantity, f"{quantity}_sd"))
    for number, name in enumerate("xyz"):
        style, centre = look(number, "marker"), values[:, number]
        axes.plot(time, centre, linewidth=0.8, label=name, **style)
        half = SURE * sds[:, number]
        axes.fill_between(time, centre - half, centre + half, color=style["color"], alpha=0.25)
    axes.set(xlabel="time (s)", ylabel=label)
    axes.legend(ncols=3)
    return axes


def allan(noise: StillNoise) -> list[Axes]:
    """Allan deviations and spectra of all axes, and the terms found; of `imuarray.allan`."""
    return noise_figure(noise).axes
