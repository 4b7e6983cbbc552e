"""A calibration's positions for a person, and its main numbers for a program."""

import xarray as xr

from imuarray.engine.directions import position_sds, weakest_of
from imuarray.trust import parameters_of
from imuarray.words import number


def document(dataset: xr.Dataset) -> dict:
    """A calibration's main numbers."""
    labels = [str(label) for label in dataset["accelerometer"].to_numpy()]
    found = {
        "converged": bool(dataset.attrs["converged"]),
        "iterations": dataset.sizes["iteration"],
        "samples": dataset.attrs["samples"],
        "residual_ratio": dataset.attrs["residual_ratio"],
        "accelerometers": labels,
        "position_m": dataset["position"].to_numpy(),
        "position_sd_m": position_sds(dataset),
        "weakest_directions": [
            {"direction": item.words, "sd_m": item.sd} for item in weakest_of(dataset)
        ],
    }
    if "effect_parameter" in dataset:
        found["effects"] = parameters_of(dataset)
    return found


def position_lines(dataset: xr.Dataset) -> list[str]:
    """A line for each triad under a head."""
    sds = position_sds(dataset)
    unit, factor = ("um", 1e6) if sds.max() < 1e-3 else ("mm", 1e3)
    lines = [f"triad   x mm      y mm      z mm    (sd {unit})"]
    rows = dataset["accelerometer"].to_numpy(), dataset["position"].to_numpy(), sds
    for label, row, sd in zip(*rows, strict=True):
        values = "  ".join(f"{1e3 * value:8.4f}" for value in row)
        lines.append(f"{label:>5} {values}    {', '.join(number(factor * x, 2) for x in sd)}")
    return lines
