"""The noise of a recording's longest still stretches: Allan deviation, spectrum, terms."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from imuarray.errors import InputError
from imuarray.firstorder.report import allan_table, axes_of
from imuarray.firstorder.spectrum import LEAST, SLOWEST, noise_terms, spectrum
from imuarray.firstorder.still import still_poses
from imuarray.recording import Recording

LONG = 0.5  # of the longest still stretch, what the others last that are pooled with it
TERMS = ("noise_density", "bias_instability", "random_walk")
UNITS = {
    "specific_force": ("m s-2 Hz-1/2", "m s-2", "m s-3 Hz-1/2"),
    "angular_rate": ("rad s-1 Hz-1/2", "rad s-1", "rad s-2 Hz-1/2"),
}
OPEN = "left open: not seen in a record of this length"


class StillNoise(NamedTuple):
    """Noise of each axis of each sensor, SI units, as tables with sensor, triad and axis.

    Attributes
    ----------
    deviation : DataFrame
        Overlapping Allan deviation: ``tau_s``, ``deviation`` and its ``sd``.
    spectrum : DataFrame
        ``frequency_hz`` and ``density`` per root Hz, two-sided: white noise lies at N.
    terms : DataFrame
        ``term``: ``noise_density`` N, ``bias_instability`` B (its floor is 0.664 B) and
        ``random_walk`` K; ``value`` and ``sd``, NaN where ``says`` leaves it open, ``below``
        (95 %) then; ``unit``.
    rate_hz : float, of the readings
    stretches_s : tuple of float, how long the still stretches are
    """

    deviation: pd.DataFrame
    spectrum: pd.DataFrame
    terms: pd.DataFrame
    rate_hz: float
    stretches_s: tuple[float, ...]


def allan(recording: Recording) -> StillNoise:
    """Noise density, bias instability and random walk from the longest still stretches.

    IEEE Std 952-1997, annex C: the Allan variance is N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3.
    The terms are fitted by maximum likelihood to the spectrum below a sixteenth of the rate.
    InputError where nothing is still, or nothing long enough.
    """
    poses = still_poses(recording)
    longest = max(pose.stop - pose.start for pose in poses)
    poses = [pose for pose in poses if pose.stop - pose.start >= LONG * longest]
    rate = float(f"{1 / np.median(np.diff(recording.time)):.10g}")
    lengths = [pose.stop - pose.start for pose in poses]
    if sum(lengths) < LEAST * SLOWEST / 2:
        raise InputError(
            f"recording: expected still stretches of {LEAST * SLOWEST // 2} samples at least,"
            f" found {sum(lengths)}"
        )
    spectra, terms = [], []
    for sensor, units in UNITS.items():
        found = spectrum([getattr(recording, sensor)[pose] for pose in poses], 1 / rate)
        index = axes_of(recording, sensor, frequency_hz=found.frequency)
        density = {"density": np.sqrt(found.power).ravel()}
        spectra.append(pd.DataFrame(density, index).reset_index())
        fitted = noise_terms(found, rate)
        index = axes_of(recording, sensor, term=TERMS)
        columns = {name: part.ravel() for name, part in fitted._asdict().items()}
        table = pd.DataFrame(columns, index).reset_index()
        table["unit"] = table.term.map(dict(zip(TERMS, units, strict=True)))
        terms.append(table)
    table = pd.concat(terms, ignore_index=True)
    table["says"] = np.where(table.value.isna(), OPEN, "")
    return StillNoise(
        allan_table(poses, recording), pd.concat(spectra, ignore_index=True), table, rate,
        tuple(length / rate for length in lengths),
    )  # fmt: skip
