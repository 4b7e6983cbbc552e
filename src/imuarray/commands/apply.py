"""The work behind `imuarray apply`."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from imuarray.analysis.extension import diagnosed
from imuarray.analysis.model import assumed
from imuarray.analysis.motion import apply as applied
from imuarray.analysis.trust import reasons_of_motion
from imuarray.commands.output import Output
from imuarray.errors import InputError
from imuarray.motion.state import UNITS
from imuarray.provenance import trust, write_netcdf
from imuarray.recording import Recording, load_dataset, read_recording


def apply(arguments) -> None:
    """The calibrated array's motion with covariances; see `imuarray.apply` for the output."""
    output = Output(arguments)
    recording = read_recording(arguments.recording)
    calibration = _calibration(arguments.calibration, recording)
    try:
        dataset = applied(calibration, recording, arguments.accelerometer_noise)
    except InputError as error:
        raise InputError(f"{arguments.calibration}: {error}") from None
    used, own = assumed(recording, arguments.accelerometer_noise), bool(dataset.attrs["own_clocks"])
    reasons = reasons_of_motion(used, calibration, own)
    write_netcdf(dataset.assign_attrs(trust(reasons)), arguments.out)
    gyroscopes = recording.angular_rate.shape[1]
    average = recording.gyroscope_noise_sd / np.sqrt(gyroscopes)
    found = document(dataset)
    output.say("\n".join(report(found, average)))
    found |= {"gyroscopes_averaged_sd_rad_s": average, "out": str(arguments.out)}
    output.done(found, reasons)


def _calibration(path: Path, recording: Recording) -> xr.Dataset:
    """What `calibrate` has written, or the extended model of a diagnosis.json."""
    if path.suffix == ".json":
        return diagnosed(path, recording)
    return load_dataset(path)


def document(dataset: xr.Dataset) -> dict:
    """The motion's main numbers; sds are rms over samples."""
    lost = np.isnan(dataset["angular_rate"].to_numpy()).any(axis=1)
    railed = dataset["gyroscope_at_rail"].to_numpy() & ~lost
    found: dict[str, Any] = {
        "samples": lost.size,
        "left_out": int(lost.sum()),
        "gyroscope_at_rail": int(railed.sum()),
        "not_converged": int(np.sum(~dataset["converged"].to_numpy() & ~lost)),
    }
    for name, where in (("off_the_rail", ~railed & ~lost), ("at_the_rail", railed)):
        if where.any():
            found[name] = {
                f"{field}_sd": float(
                    np.sqrt(np.mean(dataset[f"{field}_sd"].to_numpy()[where] ** 2))
                )
                for field in UNITS
            }
    return found


def report(found: dict, average: float) -> list[str]:
    """The same for a person; ``average`` (rad/s) is the sd of the gyroscopes' mean."""
    lines = [
        f"{found['samples']} samples: {found['left_out']} left out, at a rail;"
        f" {found['gyroscope_at_rail']} with a gyroscope at its rail"
    ]
    if "off_the_rail" in found:
        lines.append(
            f"gyroscopes averaged, off the rail: sd {np.degrees(average):.3g} deg/s (angular rate,"
            " noise alone; the fused sds have what the calibration leaves uncertain as well)"
        )
    for name in ("off_the_rail", "at_the_rail"):
        if name in found:
            rate, acceleration, force = (found[name][f"{field}_sd"] for field in UNITS)
            lines.append(
                f"fused, {name.replace('_', ' ')}: sd {np.degrees(rate):.3g} deg/s,"
                f" {np.degrees(acceleration):.3g} deg/s^2, {force:.3g} m/s^2"
                " (angular rate, angular acceleration, force)"
            )
    if found["not_converged"]:
        lines.append(f"NOT converged at {found['not_converged']} samples")
    return lines
