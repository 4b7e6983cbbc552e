"""The command line's parser: commands, options and their help; nothing heavy loads here."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import imuarray
from imuarray.analysis import methods
from imuarray.commands.argument_types import (
    InputFile,
    InputLog,
    bag,
    count,
    effects,
    model,
    positive,
    seed,
)
from imuarray.errors import InputError

Option = tuple[str, dict[str, Any]]  # arguments of argparse's `add_argument`


def option(name: str, help: str, **given: Any) -> Option:
    return name, {"help": help, **given}


def number(name: str, metavar: str, help: str, default: Any = None, type=positive) -> Option:
    help = help if default is None else f"{help} (default: {default:g})"
    return option(name, help, metavar=metavar, default=default, type=type)


def file_option(name: str, help: str, type=InputFile, **given: Any) -> Option:
    return option(name, help, metavar="FILE", type=type, **given)


RECORDING = option("recording", "NetCDF-4 recording to read", type=InputFile)
SEED = number("--seed", "S", "seed of the random numbers", 0, seed)
NOISE = number(
    "--accelerometer-noise",
    "SD",
    "assumed sd, m/s^2, of the papers' model (default: the declared one)",
)
EFFECT_FILE = file_option(
    "--effect-file", "Python file with effects of your own, which is run: they join the catalogue;"
    " may be given again", action="append",
)  # fmt: skip
EFFECTS = (
    EFFECT_FILE,
    option(
        "--effects", "effects that extend the measurement model, separated by commas (default:"
        " none)", type=effects, default=(), metavar="A,B",
    ),
)  # fmt: skip
MODEL = (
    option("--model", "sensors: what a standard sensor model needs, noise estimated (default);"
            " papers: positions and motion alone, the declared noise; or a calibration's file:"
            " its effects, estimated again", default="sensors", metavar="{sensors,papers,FILE.nc}",
            type=model),
    EFFECT_FILE,
    option("--effects", "effects to have in the model instead, separated by commas",
            type=effects, default=(), metavar="A,B"),
)  # fmt: skip


class Command(NamedTuple):
    """One command; ``run`` is its function's place in ``package``."""

    name: str
    run: str
    summary: str
    example: str
    out: str
    options: tuple[Option, ...]
    folder: bool = False
    package: str = "imuarray.commands"


TOPICS = option("--topics", "of ROS bags, the reference first (default: those of the YAML)",
                 nargs="+", default=(), metavar="/imu0")  # fmt: skip
TABLES = option("data", "CSV file with a header; several where IMUs logged each by itself",
                 type=InputFile, nargs="+")  # fmt: skip
GRAVITY = number("--gravity", "G", "magnitude of gravity where it was recorded, m/s^2", 9.80665)

COMMANDS = (
    Command(
        "board", "board.board",
        "From a log to positions, what the sensors do, and a page that says how good it is.",
        "log.csv --columns columns.yaml --gravity 9.81 --out answer/",
        "folder to write: report.html, cal.nc, positions.csv, recording.nc",
        (
            option("logs", "of one recording (docs/convert.md): a table, a log of each IMU,"
                    " ROS bags, MIMU packets, or NetCDF-4",
                    type=InputLog, nargs="+", metavar="log"),
            file_option("--columns", "YAML: columns, units, positions; of MIMU packets a CSV"),
            TOPICS, GRAVITY,
        ),
        folder=True,
    ),
    Command(
        "columns", "recordings.draft_columns",
        "Draft the YAML that describes a log: columns, units, rate, noise, and what it could not"
        " know.",
        "log.csv --out columns.yaml", "YAML to write, a new file",
        (TABLES,),
    ),
    Command(
        "simulate", "recordings.simulate",
        "Simulate a recording; its truth is stored in the group 'truth'.",
        "--out rec.nc", "recording to write (NetCDF-4)",
        (
            option("--board", "its array: mimu4444_corners, 8 IMUs (default), or mimu4444",
                    default="mimu4444_corners", metavar="NAME"),
            number("--duration", "S", "s of motion", 10.0),
            number("--rate", "HZ", "samples a second", 100.0), SEED, *EFFECTS,
        ),
    ),
    Command(
        "convert mimu", "recordings.convert_mimu",
        "Read the packets of a MIMU board; damage is located and counted.",
        "data.bin --positions IMU_positions.csv --out rec.nc", "recording to write (NetCDF-4)",
        (
            option("data", "binary file of packets", type=InputFile),
            file_option("--positions", "CSV of nominal positions in m: header 'axes, IMU 1, ...',"
                  " rows x, y, z", required=True),
            option("--underside", "IMUs turned over (default: the even-numbered ones)",
                    metavar="2,4"),
            number("--accelerometer-noise", "SD", "sd of one reading, m/s^2", 0.04),
            number("--gyroscope-noise-dps", "SD", "sd of one reading, deg/s", 0.06),
            number("--position-prior", "SD", "sd of the nominal positions, m", 3e-3),
            number("--output-rate", "HZ", "readings that a sensor makes in a second, of which the"
                    " host takes the newest", 1000.0),
        ),
    ),
    Command(
        "convert csv", "recordings.convert_logs",
        "Read a table, or several of a rig; a small YAML names columns and units"
        " (docs/convert.md).",
        "log.csv --columns columns.yaml --out rec.nc", "recording to write (NetCDF-4)",
        (TABLES, file_option("--columns", "YAML: columns, units, positions", required=True)),
    ),
    Command(
        "convert ros", "recordings.convert_logs",
        "Read the sensor_msgs/Imu of ROS 1 or ROS 2 bags; a small YAML has positions and noise"
        " (docs/convert.md).",
        "run.bag --columns rig.yaml --out rec.nc", "recording to write (NetCDF-4)",
        (
            option("data", "ROS 1 bag, ROS 2 bag's folder or file (.db3, .mcap); one after the"
                    " other of a rig are joined", type=bag, nargs="+", metavar="bag"),
            file_option("--columns", "YAML: positions, noise, range"), TOPICS,
        ),
    ),
    Command(
        "first-order", "recordings.first_order",
        "Calibrate accelerometers from still poses, gyroscopes from the moves between them.",
        "rec.nc --gravity 9.818 --out corrected.nc",
        "corrected recording to write (NetCDF-4), with the calibration in group 'first_order'",
        (
            RECORDING, GRAVITY,
            option("--gyroscopes", "calibrate: scales, misalignments, orientations, from the moves"
                    " between poses (default); offset: only their offsets, as in the 2021 paper",
                    choices=("calibrate", "offset"), default="calibrate"),
            number("--shortest-pose", "S", "shortest still pose, s", 3.0),
            option("--with", "further recordings of the board, made at the same place: maps, and"
                    " so the array's frame and size, are from the poses and moves of all",
                    type=InputFile, nargs="+", default=[], dest="others", metavar="other.nc"),
        ),
    ),
    Command(
        "select", "recordings.select",
        "Keep moving, unsaturated, informative samples; says what each criterion removed.",
        "corrected.nc --samples 500 --out subset.nc", "recording to write (NetCDF-4)",
        (
            RECORDING,
            number("--samples", "T", "how many, spread evenly (default: all informative ones)",
                    type=count),
        ),
    ),
    Command(
        "calibrate", "calibrate.calibrate",
        "Estimate the accelerometer positions, the sensors' parameters and the motion.",
        "corrected.nc --out cal.nc", "estimates to write (NetCDF-4)",
        (
            option("recordings", "recording to read (NetCDF-4), or several of one board",
                    type=InputFile, nargs="+", metavar="recording"),
            *MODEL, NOISE,
        ),
    ),
    Command(
        "apply", "apply.apply",
        "The calibrated array as one sensor: angular rate, angular acceleration and specific force"
        " at each sample, with covariances.",
        "cal.nc rec.nc --out motion.nc", "motion to write (NetCDF-4)",
        (
            option("calibration", "cal.nc of `imuarray calibrate`, `board` or `diagnose`",
                    type=InputFile),
            RECORDING, EFFECT_FILE, NOISE,
        ),
    ),
    Command(
        "sample", "sample.sample",
        "Sample the posterior distribution of the accelerometer positions: from seconds to a"
        " minute, minutes where NUTS is needed.",
        "rec.nc --seed 1 --out posterior.nc",
        "posterior to write (NetCDF-4)",
        (
            RECORDING, *MODEL, NOISE,
            option("--method", "independent: proposals from the normal density about the mode, on"
                    " the exact marginal likelihood; nuts: the no-U-turn sampler on the same; auto"
                    " (default): the former where it is enough, else the latter",
                    choices=methods.SAMPLING, default="auto"),
            number("--steps", "N", "steps of each chain", type=count),
            SEED,
        ),
    ),
    Command(
        "export", "apply.export",
        "A calibration in another tool's format, with sds and the formula that corrects readings.",
        "cal.nc --format kalibr --out imu.yaml", "file to write",
        (
            option("calibration", "what `imuarray calibrate` has written", type=InputFile),
            option("--format", "json: everything; kalibr: imu.yaml of several IMUs; urdf: links"
                    " and fixed joints; csv: positions", choices=methods.EXPORTS, required=True),
            file_option("--noise", "recording of the same IMUs lying still: noise, random walk"),
            EFFECT_FILE,
        ),
    ),
    Command(
        "allan", "allan.run",
        "Noise density, bias instability and random walk of each axis, from long still stretches.",
        "still.nc --out noise/", "folder to write: allan.pdf, allan.png, tables (CSV)",
        (RECORDING,), folder=True,
    ),
    Command(
        "diagnose", "diagnose.diagnose",
        "What the sensor model gets wrong on a recording, why, and what an extended model gains.",
        "corrected.nc --out diagnosis/", "folder to write: diagnosis.json, cal.nc, report.html,"
        " figures",
        (
            RECORDING, EFFECT_FILE,
            option("--without", "effects to leave out of the catalogue, separated by commas"
                    " (default: none)", type=effects, default=(), metavar="A,B"),
            SEED,
        ),
        folder=True,
    ),
)  # fmt: skip


class Parser(argparse.ArgumentParser):
    """Reports a wrong command line as one line, like every other wrong input."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see '{self.prog} --help')")

    def parse_known_args(self, args=None, namespace=None):
        """A subcommand refuses what it does not know itself, so its own help is named."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown


def make_parser(
    commands_given: Sequence[Command] = COMMANDS, name: str = "imuarray"
) -> argparse.ArgumentParser:
    """A parser that gives the place of the command's function as ``run``; InputError if wrong."""
    parser = Parser(
        prog=name,
        description="Calibrate the geometry of inertial sensor arrays.",
        epilog=f"example: {name} calibrate corrected.nc --out cal.nc;"
        f" every command has its own: {name} calibrate --help",
    )
    parser.add_argument("--version", action="version", version=f"imuarray {imuarray.__version__}")
    commands = parser.add_subparsers(dest="command", metavar="command", required=True)
    kinds = None
    for command in commands_given:
        first, _, kind = command.name.partition(" ")
        if kind and kinds is None:
            summary = "Turn a logger's file into a recording."
            convert = commands.add_parser(
                "convert", help=summary, description=summary,
                epilog="example: imuarray convert csv log.csv --columns columns.yaml --out rec.nc",
            )  # fmt: skip
            kinds = convert.add_subparsers(dest="kind", metavar="format", required=True)
        _add(kinds if kind else commands, kind or first, command)
    return parser


def _add(commands, name: str, command: Command) -> None:
    """One subcommand, with what all of them have."""
    parser = commands.add_parser(name, help=command.summary, description=command.summary)
    parser.epilog = f"example: {parser.prog} {command.example}"
    kind = "FOLDER" if command.folder else "FILE"
    parser.add_argument("--out", required=True, type=Path, metavar=kind, help=command.out)
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    parser.add_argument(
        "--json", action="store_true", help="the summary as one JSON object (SI units)"
    )
    parser.add_argument(
        "--debug", action="store_true", help="the traceback of an error that was not foreseen"
    )
    for option_name, given in command.options:
        parser.add_argument(option_name, **given)
    parser.set_defaults(run=f"{command.package}.{command.run}", folder=command.folder)
