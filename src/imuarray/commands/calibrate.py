"""The work behind `imuarray calibrate`: a calibration, in lines, and its main numbers."""

import numpy as np
import xarray as xr

from imuarray.analysis.calibration import calibrate as calibrated
from imuarray.analysis.model import assumed
from imuarray.commands.output import Answer, Output
from imuarray.commands.positions import document, position_lines
from imuarray.engine.directions import position_sds, weakest_of
from imuarray.model.effects import KINDS
from imuarray.provenance import trust, write_netcdf
from imuarray.recording import read_recording
from imuarray.trust import of_file, parameters_of, reasons_of_calibration, reasons_of_poses

MISFIT = 1.5  # residual over declared noise from which it is spoken of


def calibrate(arguments, output: Output) -> Answer:
    """Positions and motion by maximum likelihood; see `imuarray.calibrate` for the output."""
    recordings = [read_recording(path) for path in arguments.recordings]
    noise = arguments.accelerometer_noise
    dataset = calibrated(recordings, arguments.model, arguments.effects, noise, output.notify)
    return written(dataset, recordings, arguments)


def written(dataset: xr.Dataset, recordings, arguments) -> Answer:
    """Writes a calibration and reports on it."""
    known = reasons_of_poses(*map(of_file, arguments.recordings))
    reasons = reasons_of_calibration(
        [assumed(one, arguments.accelerometer_noise) for one in recordings], dataset, known
    )
    write_netcdf(dataset.assign_attrs(trust(reasons)), arguments.out)
    return Answer(report(dataset), document(dataset), reasons)


def report(dataset: xr.Dataset) -> str:
    """Lines on a calibration for a person."""
    state = "converged" if dataset.attrs["converged"] else "NOT converged"
    count, samples = dataset.sizes["iteration"], dataset.attrs["samples"]
    lines = [f"{state} after {count} iterations, {samples} samples", *position_lines(dataset)]
    parameters = parameters_of(dataset)  # in their own units (docs/effects.md)
    if parameters:
        lines.append("effect parameter: value (sd)")
    lines += [f"{name}: {at['value']:.4g} ({at['sd']:.2g})" for name, at in parameters.items()]
    return "\n".join([*lines, *_informative(dataset), *_misfit(dataset)])


def _informative(dataset: xr.Dataset) -> list[str]:
    """Lines on how well the recording determines the positions, and which combinations worst."""
    worst, prior = weakest_of(dataset), dataset.attrs["position_prior_sd"]
    rms = np.sqrt(np.mean(position_sds(dataset)[1:] ** 2))
    said = ", ".join(f"{item.words} ({1e6 * item.sd:.2g} um)" for item in worst)
    lines = [f"positions to {1e6 * rms:.2g} um rms; worst determined: {said}"]
    if worst[0].sd > prior:
        lines.append(
            f"{worst[0].words}: determined worse than by the nominal positions,"
            f" {1e3 * prior:g} mm; turn the array faster, and about all axes"
        )
    return lines


def _misfit(dataset: xr.Dataset) -> list[str]:
    """One line where the residual is not what the declared noise explains."""
    ratio = dataset.attrs["residual_ratio"]
    if not ratio > MISFIT:
        return []
    papers = dataset.attrs["model"] == "papers"
    if "gyroscope_smooth_residual" in dataset:
        usual = {kind: float(np.median(dataset[f"{kind}_smooth_residual"])) for kind in KINDS}
        sizes = [f"{value:.2g} ({kind}s)" for kind, value in usual.items()]
        return [
            f"rough motion: the residual is {' and '.join(sizes)} times the declared noise in"
            f" smooth samples that turn fast, {ratio:.3g} over all: shocks are faster"
            " than the samples, and count little"
        ]
    allowed = "take it for noise"
    if papers:
        blocks = "position_sd_jackknife" in dataset
        allowed = "are too small" + ("" if blocks else ", by that or more")
    return [
        f"residual {ratio:.3g} times the declared noise: the model misses something, and the"
        f" sds above {allowed}"
    ]
