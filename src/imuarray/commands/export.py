"""The work behind `imuarray export`."""

from imuarray.analysis.export import export
from imuarray.commands.output import Answer
from imuarray.errors import InputError
from imuarray.firstorder.noise import allan
from imuarray.provenance import write_bytes
from imuarray.recording import load_dataset, read_recording
from imuarray.trust import reasons_in


def run(arguments, _) -> Answer:
    """A calibration in another tool's format; one that is not to be trusted says so in it."""
    calibration = load_dataset(arguments.calibration)
    noise = None if arguments.noise is None else allan(read_recording(arguments.noise))
    try:
        text = export(calibration, arguments.format, noise)
        reasons = [f"the calibration is not to be trusted: {x}" for x in reasons_in(calibration)]
    except InputError as error:
        raise InputError(f"{arguments.calibration}: {error}") from None
    write_bytes(text.encode(), arguments.out)
    count = calibration.sizes["accelerometer"]
    found = {"format": arguments.format, "imus": count}
    return Answer(f"{arguments.out}: {count} IMUs, {arguments.format}", found, reasons)
