"""The work behind `imuarray calibrate`."""

import xarray as xr

from imuarray.analysis.calibration import calibrate as calibrated
from imuarray.analysis.model import assumed
from imuarray.commands.lines import document, report
from imuarray.commands.output import Output
from imuarray.provenance import trust, write_netcdf
from imuarray.recording import read_recording
from imuarray.trust import of_file, reasons_of_calibration, reasons_of_poses


def calibrate(arguments) -> None:
    """Positions and motion by maximum likelihood; see `imuarray.calibrate` for the output."""
    output = Output(arguments)
    papers = arguments.model == "papers"
    recordings = [read_recording(path, papers) for path in arguments.recordings]
    noise = arguments.accelerometer_noise
    dataset = calibrated(recordings, arguments.model, arguments.effects, noise, output.notify)
    written(dataset, recordings, arguments, output)


def written(dataset: xr.Dataset, recordings, arguments, output: Output) -> None:
    """Writes a calibration and reports on it."""
    known = reasons_of_poses(*map(of_file, arguments.recordings))
    reasons = reasons_of_calibration(
        [assumed(one, arguments.accelerometer_noise) for one in recordings], dataset, known
    )
    write_netcdf(dataset.assign_attrs(trust(reasons)), arguments.out)
    output.notify(report(dataset))
    output.done(document(dataset) | {"out": str(arguments.out)}, reasons)
