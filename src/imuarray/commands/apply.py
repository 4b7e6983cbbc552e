"""The work behind `imuarray apply` and `imuarray export`: what one does with a calibration."""

from itertools import chain
from typing import Any

import numpy as np
import xarray as xr

from imuarray.analysis.export import export as exported
from imuarray.analysis.model import assumed
from imuarray.analysis.motion import as_calibrated, motion_parts
from imuarray.commands.output import Answer
from imuarray.errors import InputError
from imuarray.firstorder.noise import allan
from imuarray.motion.state import UNITS
from imuarray.provenance import trust, write_bytes, write_netcdf_parts
from imuarray.recording import load_dataset, read_recording
from imuarray.trust import reasons_in, reasons_of_motion

COUNTED = "samples", "left_out", "gyroscope_at_rail", "not_converged"
RAILED = "off_the_rail", "at_the_rail"
LATE = 1e-4  # s, worth a line


def apply(arguments, _) -> Answer:
    """The calibrated array's motion with covariances; see `imuarray.apply` for the output."""
    read = read_recording(arguments.recording, stored=True)
    calibration = load_dataset(arguments.calibration)
    noise, tallies = arguments.accelerometer_noise, []
    try:
        recording = as_calibrated(read, calibration)
        parts = motion_parts(calibration, recording, noise)
        first = next(parts)
    except InputError as error:
        raise InputError(f"{arguments.calibration}: {error}") from None
    own = bool(first.attrs["own_clocks"])
    as_read = recording is not read
    ratio = first.attrs["residual_ratio"]
    reasons = reasons_of_motion(assumed(recording, noise), calibration, own, as_read, ratio)
    first = first.assign_attrs(trust(reasons))

    def counted(part: xr.Dataset) -> xr.Dataset:
        tallies.append(tally(part))
        return part

    write_netcdf_parts(map(counted, chain((first,), parts)), len(recording.time), arguments.out)
    average = recording.gyroscope_noise_sd / np.sqrt(recording.angular_rate.shape[1])
    found = totals(tallies) | {
        "gyroscopes_averaged_sd_rad_s": average, "late_s": first.attrs["late_s"],
    }  # fmt: skip
    return Answer("\n".join(report(found)), found, reasons)


def tally(part: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Samples by `COUNTED`; values and sums of their squared sds by `RAILED`."""
    lost = np.isnan(part["angular_rate"].to_numpy()).any(axis=1)
    railed = part["gyroscope_at_rail"].to_numpy() & ~lost
    missed = ~part["converged"].to_numpy() & ~lost
    sums = [
        [3 * where.sum(), *(np.sum(part[f"{name}_sd"].to_numpy()[where] ** 2) for name in UNITS)]
        for where in (~railed & ~lost, railed)
    ]
    return np.array([lost.size, lost.sum(), railed.sum(), missed.sum()]), np.array(sums)


def totals(tallies: list[tuple[np.ndarray, np.ndarray]]) -> dict[str, Any]:
    """The motion's main numbers; sds are rms over samples."""
    counts, sums = (np.sum(parts, axis=0) for parts in zip(*tallies, strict=True))
    found: dict[str, Any] = dict(zip(COUNTED, map(int, counts), strict=True))
    for name, (number, *squares) in zip(RAILED, sums, strict=True):
        if number:
            sds = zip(UNITS, np.sqrt(np.array(squares) / number), strict=True)
            found[name] = {f"{field}_sd": float(sd) for field, sd in sds}
    return found


def report(found: dict) -> list[str]:
    """Lines on the motion for a person."""
    lines = [
        f"{found['samples']} samples: {found['left_out']} left out, at a rail;"
        f" {found['gyroscope_at_rail']} with a gyroscope at its rail"
    ]
    if "off_the_rail" in found:
        average = np.degrees(found["gyroscopes_averaged_sd_rad_s"])
        lines.append(
            f"gyroscopes averaged, off the rail: sd {average:.3g} deg/s (angular rate, noise alone)"
        )
    for name in RAILED:
        if name in found:
            rate, acceleration, force = (found[name][f"{field}_sd"] for field in UNITS)
            lines.append(
                f"fused, {name.replace('_', ' ')}: sd {np.degrees(rate):.3g} deg/s,"
                f" {np.degrees(acceleration):.3g} deg/s^2, {force:.3g} m/s^2"
                " (angular rate, angular acceleration, force)"
            )
    lines.append(
        "use angular_rate and specific_force, the fused ones, even where the average's sd is less:"
        " theirs count what the calibration leaves uncertain; the average has that error uncounted"
    )
    if found["not_converged"]:
        lines.append(f"NOT converged at {found['not_converged']} samples")
    late = found["late_s"]
    if abs(late) >= LATE:  # where an IMU is late, the mean of all is not the time of most of them
        lines.append(
            f"by the clock of most IMUs the motion is {1e3 * late:.2f} ms late: it is that of"
            f" time - {late:.3g} s (attribute late_s)"
        )
    return lines


def export(arguments, _) -> Answer:
    """A calibration in another tool's format; one that is not to be trusted says so in it."""
    calibration = load_dataset(arguments.calibration)
    noise = None if arguments.noise is None else allan(read_recording(arguments.noise))
    try:
        text = exported(calibration, arguments.format, noise)
        reasons = [f"the calibration is not to be trusted: {x}" for x in reasons_in(calibration)]
    except InputError as error:
        raise InputError(f"{arguments.calibration}: {error}") from None
    write_bytes(text.encode(), arguments.out)
    count = calibration.sizes["accelerometer"]
    found = {"format": arguments.format, "imus": count}
    return Answer(f"{arguments.out}: {count} IMUs, {arguments.format}", found, reasons)
