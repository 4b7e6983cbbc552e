"""Allan deviations and spectra of still stretches."""

import numpy as np
import pandas as pd

from imuarray.firstorder.noise import StillNoise
from imuarray.pictures.style import BLACK, GREY, PAGE, logarithmic, look, new_figure, styled

KINDS = {
    "specific_force": (1e3, "accelerometers (mm/s²{})"),
    "angular_rate": (np.degrees(1.0), "gyroscopes (deg/s{})"),
}


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
    taus = deviation_lines(above, noise.deviation, sensor)
    allan = white**2 / taus + 2 * np.log(2) / np.pi * flicker**2 + walk**2 * taus / 3
    frequency = _lines(below, noise.spectrum, sensor, "frequency_hz", "density")
    pace = 2 * np.pi * frequency
    power = white**2 + flicker**2 / pace + (walk / pace) ** 2
    for axes, grid, found in ((above, taus, allan), (below, frequency, power)):
        axes.plot(grid, factor * np.sqrt(found), color=BLACK, linewidth=1.2, label="terms found")
        axes.legend()
    below.axvspan(noise.rate_hz / 16, frequency[-1], color=GREY, alpha=0.15, linewidth=0)
    logarithmic(below, "frequency (Hz), grey: not fitted", f"density, {title.format('/√Hz')}")


def deviation_lines(axes, table: pd.DataFrame, sensor: str) -> np.ndarray:
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
