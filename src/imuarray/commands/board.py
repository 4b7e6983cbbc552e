"""The work behind `imuarray board`."""

from pathlib import Path

from imuarray.analysis.board import board as answered
from imuarray.commands.output import Answer, Output
from imuarray.commands.positions import document, position_lines
from imuarray.recording.units import GRAVITY
from imuarray.report import board as said
from imuarray.report.board import Board, write_board

TABLE = 8  # IMUs whose positions are printed; of more they are in positions.csv
CAUSES, STEPS = 3, 2  # at most, of what the page says


def board(arguments, output: Output) -> Answer:
    """From logs to positions, on the defaults, and a page of all that was found."""
    found = answered(
        arguments.logs, arguments.columns, arguments.gravity, arguments.topics, output.step
    )
    write_board(found, arguments.out)
    text = "\n".join(lines_on(found, arguments.out))
    return Answer(text, document(found.calibration), found.reasons)


def lines_on(found: Board, folder: Path) -> list[str]:
    """The page's beginning for a terminal: the answer, what it rests on, what to do next."""
    calibration = found.calibration
    lines = [said.verdict(found)]
    if calibration.sizes["accelerometer"] <= TABLE:
        lines += position_lines(calibration)
    turned = said.turned(found)
    causes = turned if found.reasons else turned + said.causes(calibration)
    lines += [f"Least well known direction: {said.weakest(calibration)}.", said.facts(found)]
    if len(found.account) <= CAUSES:
        lines += found.account
    else:
        lines.append(f"What became of the logs ({len(found.account)} lines) is on the page.")
    lines += causes[:CAUSES]
    if len(causes) > CAUSES:
        lines.append(f"What else the sensors do ({len(causes) - CAUSES} more) is on the page.")
    if getattr(found.first_order, "gravity", None) == GRAVITY:
        lines.append(
            f"Gravity is taken as {GRAVITY} m/s²: 0.1 % off, it makes the array 0.1 % off;"
            " `--gravity` is your place's."
        )
    steps = [f"- {step}" for step in said.advice(found, folder)[:STEPS]]
    return [*lines, "Next:", *steps, f"Page: {folder / 'report.html'}"]
