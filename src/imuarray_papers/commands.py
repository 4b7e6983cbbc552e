"""The work behind `python -m imuarray_papers`: what the papers did, for one's own recording."""

from imuarray.analysis.model import assumed
from imuarray.commands import calibrate as calibrating
from imuarray.commands import sample as sampling
from imuarray.commands.output import Answer, Output
from imuarray.recording import read_recording
from imuarray.trust import of_file, reasons_of_poses, reasons_of_posterior
from imuarray_papers.calibration import calibrate as calibrated
from imuarray_papers.sampling import SHRUNK
from imuarray_papers.sampling import sample as sampled


def calibrate(arguments, output: Output) -> Answer:
    """Positions by ML-BCD; off the rails `imuarray calibrate --model papers` finds the same."""
    recording = read_recording(arguments.recording)
    dataset = calibrated(recording, arguments.accelerometer_noise, output.notify)
    arguments.recordings = [arguments.recording]
    return calibrating.written(dataset, [recording], arguments)


def sample(arguments, output: Output) -> Answer:
    """Chains of the positions' posterior as in paper 2021; see `imuarray_papers.sampling`."""
    recording = read_recording(arguments.recording)
    posterior = sampled(
        recording, arguments.method, arguments.steps, arguments.seed, arguments.rates,
        arguments.accelerometer_noise, output.progress, output.notify,
    )  # fmt: skip
    recording = assumed(recording, arguments.accelerometer_noise)
    reasons = reasons_of_poses(of_file(arguments.recording))
    reasons += reasons_of_posterior(recording, posterior, arguments.rates == "spread")
    shrunk = posterior.attrs["shrunk_by_sds"]
    if shrunk > SHRUNK:
        reasons.append(
            f"the flat motion prior makes the array {shrunk:.2g} posterior sds smaller than it is:"
            " take imuarray sample"
        )
    return sampling.written(posterior, reasons, arguments.out)
