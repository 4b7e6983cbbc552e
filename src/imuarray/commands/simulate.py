"""The work behind `imuarray simulate`."""

from imuarray.commands.output import Output
from imuarray.provenance import stamp
from imuarray.recording import write_recording


def simulate(arguments) -> None:
    """A recording of hand twisting with the config's array, noise and sampling."""
    from imuarray.config import read_config
    from imuarray.studies.bayes import simulate_twisting

    output = Output(arguments)
    config = read_config(arguments.config)
    noise = config["noise"]["accelerometer_sd"]
    recording, truth = simulate_twisting(config, noise, arguments.effects)
    write_recording(recording, arguments.out, truth, stamp(config, config["seed"]))
    samples, accelerometers = recording.specific_force.shape[:2]
    output.say(f"{arguments.out}: {samples} samples of {accelerometers} accelerometer triads")
    output.done({"out": str(arguments.out), "samples": samples, "accelerometers": accelerometers})
