"""The work behind `imuarray apply`."""

from itertools import chain
from typing import Any

import numpy as np
import xarray as xr

from imuarray.analysis.model import assumed
from imuarray.analysis.motion import as_calibrated, motion_parts
from imuarray.commands.output import Output
from imuarray.errors import InputError
from imuarray.motion.state import UNITS
from imuarray.provenance import trust, write_netcdf_parts
from imuarray.recording import load_dataset, read_recording
from imuarray.trust import reasons_of_motion

LATE = 1e-4  # s, worth a line


def apply(arguments) -> None:
    """The calibrated array's motion with covariances; see `imuarray.apply` for the output."""
    output = Output(arguments)
    read = read_recording(arguments.recording, stored=True)
    calibration = load_dataset(arguments.calibration)
    noise, sums = arguments.accelerometer_noise, Sums()
    try:
        recording = as_calibrated(read, calibration)
        parts = motion_parts(calibration, recording, noise)
        first = next(parts)
    except InputError as error:
        raise InputError(f"{arguments.calibration}: {error}") from None
    own = bool(first.attrs["own_clocks"])
    as_read = recording is not read
    reasons = reasons_of_motion(assumed(recording, noise), calibration, own, as_read)
    first = first.assign_attrs(trust(reasons))
    write_netcdf_parts(
        (sums.add(part) for part in chain((first,), parts)), len(recording.time), arguments.out
    )
    average = recording.gyroscope_noise_sd / np.sqrt(recording.angular_rate.shape[1])
    found = sums.document() | {
        "gyroscopes_averaged_sd_rad_s": average, "late_s": first.attrs["late_s"],
        "out": str(arguments.out),
    }  # fmt: skip
    output.say("\n".join(report(found)))
    output.done(found, reasons)


class Sums:
    """The motion's main numbers, added part by part; sds are rms over samples."""

    def __init__(self):
        self.counts = dict.fromkeys(
            ("samples", "left_out", "gyroscope_at_rail", "not_converged"), 0
        )
        self.squares = {name: [0, np.zeros(len(UNITS))] for name in ("off_the_rail", "at_the_rail")}

    def add(self, part: xr.Dataset) -> xr.Dataset:
        """The part, counted."""
        lost = np.isnan(part["angular_rate"].to_numpy()).any(axis=1)
        railed = part["gyroscope_at_rail"].to_numpy() & ~lost
        missed = ~part["converged"].to_numpy() & ~lost
        own = lost.size, lost.sum(), railed.sum(), missed.sum()
        for name, count in zip(self.counts, own, strict=True):
            self.counts[name] += int(count)
        for total, where in zip(self.squares.values(), (~railed & ~lost, railed), strict=True):
            total[0] += 3 * int(where.sum())
            total[1] += [np.sum(part[f"{name}_sd"].to_numpy()[where] ** 2) for name in UNITS]
        return part

    def document(self) -> dict[str, Any]:
        """For the JSON line."""
        return self.counts | {
            name: {
                f"{field}_sd": float(np.sqrt(x / n)) for field, x in zip(UNITS, sums, strict=True)
            }
            for name, (n, sums) in self.squares.items()
            if n
        }


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
    for name in ("off_the_rail", "at_the_rail"):
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
