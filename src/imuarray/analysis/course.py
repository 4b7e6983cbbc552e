"""A calibration along its recording: what more of it gains, residuals, what shakes the board."""

import numpy as np
from scipy.special import chdtri

from imuarray.engine.estimate import Estimate
from imuarray.engine.heldout import blocks_of
from imuarray.engine.robust import distances
from imuarray.engine.widths import growing
from imuarray.model.effects import KINDS
from imuarray.recording import Recording

STRETCHES = 60  # of time, at most, in which residuals are averaged
FEWEST = 20  # samples of one
SHAKEN = 1e-7  # chance of a triad's residual in plain noise, from which it is far off
SEVERAL = 2  # IMUs off at once: motion faster than the samples, no single bad reading


def course_variables(recording: Recording, found: Estimate, by_triad) -> tuple[dict, dict]:
    """(variables, coordinates) of one recording's estimate.

    ``position_sd_by_length`` (length, accelerometer, axis) m, the sds had the motion ended after
    ``length`` s of it; ``accelerometer_residual`` and ``gyroscope_residual`` (stretch, triad), rms
    over the declared noise around the instants ``stretch`` s; ``shaken`` (time), 1 where several
    IMUs are far off at once. ``by_triad``: from a vector of all parameters to (A, 3).
    """
    readings, seen = found.recorded[0].readings, found.passes[0]
    time = readings.time + readings.origin
    far = distances(readings, seen)
    number = readings.keep.reshape(*readings.keep.shape[:2], 2, 3).sum(axis=-1)
    blocks = blocks_of(len(time), int(np.clip(len(time) // FEWEST, 1, STRETCHES)))
    squares = far * (readings.sd / readings.declared) ** 2
    rms = np.sqrt([
        squares[part].sum(axis=0) / np.maximum(number[part].sum(axis=0), 1) for part in blocks
    ])  # fmt: skip
    counts = readings.array.accelerometers, readings.array.gyroscopes
    variables: dict[str, tuple] = {
        f"{kind}_residual": (("stretch", kind), rms[:, : counts[which], which], {"units": "1"})
        for which, kind in enumerate(KINDS)
    }
    ends = [time[part.stop - 1] for part in blocks_of(len(time), len(found.blocks))]
    sds = np.array([by_triad(sd) for sd in growing(found)])
    shaken = np.sum((far > chdtri(3, SHAKEN)).any(axis=2), axis=1) >= SEVERAL
    variables |= {
        "position_sd_by_length": (("length", "accelerometer", "axis"), sds, {"units": "m"}),
        "shaken": (("time",), shaken.astype(np.int8)),
    }
    coordinates = {
        "stretch": ("stretch", [time[part].mean() for part in blocks], {"units": "s"}),
        "length": ("length", moving_seconds(recording, ends), {"units": "s"}),
    }
    return variables, coordinates


def moving_seconds(recording: Recording, ends) -> np.ndarray:
    """Seconds of motion recorded until some instants (s)."""
    moving = np.ones(len(recording.time), bool)
    if recording.stationary is not None:
        moving = ~recording.stationary
    step = float(np.median(np.diff(recording.time)))
    return step * np.cumsum(moving)[np.searchsorted(recording.time, ends, side="right") - 1]
