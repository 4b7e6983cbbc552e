"""The work behind `imuarray board`."""

from imuarray.analysis.board import board as answered
from imuarray.commands.calibrate import document, report
from imuarray.commands.output import Output
from imuarray.report.board import write_board


def board(arguments) -> None:
    """From logs to positions, on the defaults, and a page of all that was found."""
    output = Output(arguments)
    found = answered(
        arguments.logs, arguments.columns, arguments.gravity, arguments.topics, output.say
    )
    write_board(found, arguments.out)
    page = str(arguments.out / "report.html")
    output.say("\n".join([report(found.calibration), f"report: {page}"]))
    output.done(document(found.calibration) | {"out": str(arguments.out)}, found.reasons)
