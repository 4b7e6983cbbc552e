"""The work behind `imuarray simulate`."""

from imuarray.analysis.prepare import simulate as simulated
from imuarray.commands.output import Output
from imuarray.errors import require_one_of
from imuarray.geometry.boards import BOARDS
from imuarray.provenance import stamp
from imuarray.recording import write_recording


def simulate(arguments) -> None:
    """A recording of a board twisted by hand; see `imuarray.simulate`."""
    output = Output(arguments)
    require_one_of("--board", arguments.board, BOARDS)
    given = {"duration": arguments.duration, "sampling_rate": arguments.rate}
    board = BOARDS[arguments.board]()
    recording, truth = simulated(board, **given, seed=arguments.seed, effects=arguments.effects)
    origin = stamp({"board": arguments.board, **given}, arguments.seed)
    write_recording(recording, arguments.out, truth, origin)
    samples, accelerometers = recording.specific_force.shape[:2]
    output.say(f"{arguments.out}: {samples} samples of {accelerometers} accelerometer triads")
    output.done({"out": str(arguments.out), "samples": samples, "accelerometers": accelerometers})
