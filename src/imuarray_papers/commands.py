"""The work behind `python -m imuarray_papers`: what the papers did, for one's own recording."""

from functools import partial

from imuarray.analysis.calibration import calibrate_papers
from imuarray.analysis.model import assumed
from imuarray.commands import calibrate as calibrating
from imuarray.commands import sample as sampling
from imuarray.commands.output import Output
from imuarray.provenance import stamp
from imuarray.recording import read_recording, write_recording
from imuarray.trust import of_file, reasons_of_poses, reasons_of_posterior
from imuarray_papers.config import read_config
from imuarray_papers.estimation.bcd import calibrate_bcd
from imuarray_papers.sampling import SHRUNK
from imuarray_papers.sampling import sample as sampled
from imuarray_papers.studies.bayes import simulate_twisting


def calibrate(arguments) -> None:
    """Positions by ML-BCD; `imuarray calibrate --model papers` finds the same faster."""
    output, recording = Output(arguments), read_recording(arguments.recording)
    search = partial(calibrate_bcd, tolerance=1e-9)
    dataset = calibrate_papers(recording, arguments.accelerometer_noise, output.say, search)
    arguments.recordings = [arguments.recording]
    calibrating.written(dataset, [recording], arguments, output)


def sample(arguments) -> None:
    """Chains of the positions' posterior as in paper 2021; see `imuarray_papers.sampling`."""
    output, recording = Output(arguments), read_recording(arguments.recording)
    posterior = sampled(
        recording, arguments.method, arguments.steps, arguments.seed, arguments.rates,
        arguments.accelerometer_noise, output.progress, output.say,
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
    sampling.written(posterior, reasons, arguments.out, output)


def simulate(arguments) -> None:
    """A recording of hand twisting with the config's array, noise and sampling."""
    output, config = Output(arguments), read_config(arguments.config)
    noise = config["noise"]["accelerometer_sd"]
    recording, truth = simulate_twisting(config, noise, arguments.effects)
    write_recording(recording, arguments.out, truth, stamp(config, config["seed"]))
    samples, accelerometers = recording.specific_force.shape[:2]
    output.say(f"{arguments.out}: {samples} samples of {accelerometers} accelerometer triads")
    output.done({"out": str(arguments.out), "samples": samples, "accelerometers": accelerometers})
