"""Noise of still readings: Allan deviation and spectrum of every axis of every IMU."""

from functools import partial

import numpy as np
import pandas as pd

from imuarray.figures.style import BLACK, GREY, PAGE, logarithmic, look, new_figure, styled
from imuarray.firstorder.noise import StillNoise

KINDS = {
    "specific_force": (1e3, "accelerometers (mm/s²{})"),
    "angular_rate": (np.degrees(1.0), "gyroscopes (deg/s{})"),
}


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
    return partial(_draw_noise, papers=papers, footer=footer), allan


@styled
def _draw_noise(allan, papers, footer):
    figure = new_figure(footer, PAGE, 2.8)
    for axes, sensor in zip(figure.subplots(1, 2), KINDS, strict=True):
        taus = _deviations(axes, allan, sensor)
        white = KINDS[sensor][0] * papers[sensor] * np.sqrt(taus[0] / taus)
        axes.plot(taus, white, color=BLACK, linewidth=1.2, label="papers' σ, white")
        axes.legend()
    return figure


@styled
def noise_figure(noise: StillNoise, footer=()):
    """Allan deviations above, spectra below; black: the terms found, medians over the axes."""
    lengths = noise.stretches_s
    said = f"{len(lengths)} still stretches of {min(lengths):.3g} to {max(lengths):.3g} s"
    if len(lengths) == 1:
        said = f"A still stretch of {lengths[0]:.4g} s"
    figure = new_figure([*footer, f"{said} at {noise.rate_hz:.4g} Hz."], PAGE, 5.2)
    for column, sensor in zip(figure.subplots(2, 2).T, KINDS, strict=True):
        _with_terms(*column, noise, sensor)
    return figure


def _with_terms(above, below, noise: StillNoise, sensor: str) -> None:
    """One kind of sensor: its Allan deviations, its spectra, and both of the terms found."""
    factor, title = KINDS[sensor]
    terms = noise.terms[noise.terms.sensor == sensor]
    white, flicker, walk = (
        part.value.fillna(0.0).median() for _, part in terms.groupby("term", sort=False)
    )
    taus = _deviations(above, noise.deviation, sensor)
    allan = white**2 / taus + 2 * np.log(2) / np.pi * flicker**2 + walk**2 * taus / 3
    frequency = _lines(below, noise.spectrum, sensor, "frequency_hz", "density")
    pace = 2 * np.pi * frequency
    power = white**2 + flicker**2 / pace + (walk / pace) ** 2
    for axes, grid, found in ((above, taus, allan), (below, frequency, power)):
        axes.plot(grid, factor * np.sqrt(found), color=BLACK, linewidth=1.2, label="terms found")
        axes.legend()
    below.axvspan(noise.rate_hz / 16, frequency[-1], color=GREY, alpha=0.15, linewidth=0)
    logarithmic(below, "frequency (Hz), grey: not fitted", f"density, {title.format('/√Hz')}")


def _deviations(axes, table: pd.DataFrame, sensor: str) -> np.ndarray:
    """Allan deviations of one kind of sensor; returns the averaging times."""
    logarithmic(axes, "averaging time τ (s)", f"Allan deviation, {KINDS[sensor][1].format('')}")
    return _lines(axes, table, sensor, "tau_s", "deviation")


def _lines(axes, table: pd.DataFrame, sensor: str, x: str, y: str) -> np.ndarray:
    """A line for each axis of each triad of one kind of sensor; returns the places along x."""
    part = table[table.sensor == sensor]
    for i, axis in enumerate("xyz"):
        for number, (_, line) in enumerate(part[part.axis == axis].groupby("triad")):
            axes.plot(line[x], KINDS[sensor][0] * line[y], linewidth=0.6, **look(i, "marker"),
                      label=axis if number == 0 else None)  # fmt: skip
    return np.sort(part[x].unique())
