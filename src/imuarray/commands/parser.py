"""The command line's parser: commands, options and their help; nothing heavy loads here."""

import argparse
from collections.abc import Callable
from importlib import import_module
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


class Option(NamedTuple):
    """Arguments of argparse's ``add_argument``."""

    name: str
    given: dict[str, Any]


def _option(name: str, help: str, **given: Any) -> Option:
    return Option(name, {"help": help, **given})


def _number(name: str, metavar: str, help: str, default: Any = None, type=positive) -> Option:
    return _option(name, help, metavar=metavar, default=default, type=type)


def _file(name: str, help: str, type=InputFile, **given: Any) -> Option:
    return _option(name, help, metavar="FILE", type=type, **given)


RECORDING = _option("recording", "NetCDF-4 recording to read", type=InputFile)
SEED = _number("--seed", "S", "seed of the random numbers (default: 0)", 0, seed)
NOISE = _number(
    "--accelerometer-noise",
    "SD",
    "assumed sd, m/s^2, of the papers' model (default: the declared one)",
)
EFFECT_FILE = _file(
    "--effect-file", "Python file with effects of your own, which is run: they join the catalogue;"
    " may be given again", action="append",
)  # fmt: skip
EFFECTS = (
    EFFECT_FILE,
    _option(
        "--effects", "effects that extend the measurement model, separated by commas (default:"
        " none)", type=effects, default=(), metavar="A,B",
    ),
)  # fmt: skip


MODEL = (
    _option("--model", "sensors: what a standard sensor model needs, noise estimated (default);"
            " papers: positions and motion alone, the declared noise; or a calibration's file:"
            " its effects, estimated again", default="sensors", metavar="{sensors,papers,FILE.nc}",
            type=model),
    EFFECT_FILE,
    _option("--effects", "effects to have in the model instead, separated by commas",
            type=effects, default=(), metavar="A,B"),
)  # fmt: skip


class Command(NamedTuple):
    """One command; ``run`` is its function's place in `imuarray.commands`."""

    name: str
    run: str
    summary: str
    example: str
    out: str
    options: tuple[Option, ...]
    folder: bool = False


TOPICS = _option("--topics", "of ROS bags, the reference first (default: those of the YAML)",
                 nargs="+", default=(), metavar="/imu0")  # fmt: skip
GRAVITY = _number("--gravity", "G", "magnitude of gravity where it was recorded, m/s^2 (default:"
                  " 9.80665)", 9.80665)  # fmt: skip

COMMANDS = (
    Command(
        "board", "board.board",
        "From a log to positions, what the sensors do, and a page that says how good it is.",
        "log.csv --columns columns.yaml --gravity 9.81 --out answer/",
        "folder to write: report.html, cal.nc, positions.csv, recording.nc",
        (
            _option("logs", "of one recording (docs/convert.md): a table, a log of each IMU,"
                    " ROS bags, MIMU packets, or NetCDF-4",
                    type=InputLog, nargs="+", metavar="log"),
            _file("--columns", "YAML: columns, units, positions; of MIMU packets a CSV"),
            TOPICS, GRAVITY,
        ),
        folder=True,
    ),
    Command(
        "simulate", "simulate.simulate",
        "Simulate a recording; its truth is stored in the group 'truth'.",
        "--config config.yaml --out rec.nc", "recording to write (NetCDF-4)",
        (_file("--config", "configuration (YAML)", required=True), *EFFECTS),
    ),
    Command(
        "convert mimu", "convert.convert_mimu",
        "Read the packets of a MIMU board; damage is located and counted.",
        "data.bin --positions IMU_positions.csv --out rec.nc", "recording to write (NetCDF-4)",
        (
            _option("data", "binary file of packets", type=InputFile),
            _file("--positions", "CSV of nominal positions in m: header 'axes, IMU 1, ...', rows x,"
                  " y, z", required=True),
            _option("--underside", "IMUs turned over (default: the even-numbered ones)",
                    metavar="2,4"),
            _number("--accelerometer-noise", "SD", "sd of one reading, m/s^2 (default: 0.04)",
                    0.04),
            _number("--gyroscope-noise-dps", "SD", "sd of one reading, deg/s (default: 0.06)",
                    0.06),
            _number("--position-prior", "SD", "sd of the nominal positions, m (default: 0.003)",
                    3e-3),
            _number("--output-rate", "HZ", "readings that a sensor makes in a second, of which the"
                    " host takes the newest (default: 1000)", 1000.0),
        ),
    ),
    Command(
        "convert csv", "convert.convert_logs",
        "Read a table, or several of a rig; a small YAML names columns and units"
        " (docs/convert.md).",
        "log.csv --columns columns.yaml --out rec.nc", "recording to write (NetCDF-4)",
        (
            _option("data", "CSV file with a header; several where IMUs logged each by itself",
                    type=InputFile, nargs="+"),
            _file("--columns", "YAML: columns, units, positions", required=True),
        ),
    ),
    Command(
        "convert ros", "convert.convert_logs",
        "Read the sensor_msgs/Imu of ROS 1 or ROS 2 bags; a small YAML has positions and noise"
        " (docs/convert.md).",
        "run.bag --columns rig.yaml --out rec.nc", "recording to write (NetCDF-4)",
        (
            _option("data", "ROS 1 bag, ROS 2 bag's folder or file (.db3, .mcap); one after the"
                    " other of a rig are joined", type=bag, nargs="+", metavar="bag"),
            _file("--columns", "YAML: positions, noise, range"), TOPICS,
        ),
    ),
    Command(
        "first-order", "measured.first_order",
        "Calibrate accelerometers from still poses, gyroscopes from the moves between them.",
        "rec.nc --gravity 9.818 --out corrected.nc",
        "corrected recording to write (NetCDF-4), with the calibration in group 'first_order'",
        (
            RECORDING, GRAVITY,
            _option("--gyroscopes", "calibrate: scales, misalignments, orientations, from the moves"
                    " between poses (default); offset: only their offsets, as in the 2021 paper",
                    choices=("calibrate", "offset"), default="calibrate"),
            _number("--shortest-pose", "S", "shortest still pose, s (default: 3)",
                    3.0),
            _option("--with", "further recordings of the board, made at the same place: maps, and"
                    " so the array's frame and size, are from the poses and moves of all",
                    type=InputFile, nargs="+", default=[], dest="others", metavar="other.nc"),
        ),
    ),
    Command(
        "select", "measured.select",
        "Keep moving, unsaturated, informative samples; says what each criterion removed.",
        "corrected.nc --samples 500 --out subset.nc", "recording to write (NetCDF-4)",
        (
            RECORDING,
            _number("--samples", "T", "how many, spread evenly (default: all informative ones)",
                    type=count),
        ),
    ),
    Command(
        "calibrate", "calibrate.calibrate",
        "Estimate the accelerometer positions, the sensors' parameters and the motion.",
        "corrected.nc --out cal.nc", "estimates to write (NetCDF-4)",
        (
            _option("recordings", "recording to read (NetCDF-4), or several of one board",
                    type=InputFile, nargs="+", metavar="recording"),
            *MODEL,
            _option("--method", "the search under --model papers. gauss-newton (default): for any"
                    " length; bcd: block coordinate descent (2017), all samples in memory",
                    choices=methods.CALIBRATION),
            NOISE,
        ),
    ),
    Command(
        "apply", "apply.apply",
        "The calibrated array as one sensor: angular rate, angular acceleration and specific force"
        " at each sample, with covariances.",
        "cal.nc rec.nc --out motion.nc", "motion to write (NetCDF-4)",
        (
            _option("calibration", "cal.nc of `imuarray calibrate`, `board` or `diagnose`",
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
            _option("--method", "independent: proposals from the normal density about the mode, on"
                    " the exact marginal likelihood; nuts: the no-U-turn sampler on the same; auto"
                    " (default): the former where it is enough, else the latter; pmmh:"
                    " pseudo-marginal Metropolis-Hastings, as in the 2021 paper, of its model",
                    choices=methods.SAMPLING, default="auto"),
            _option("--motion-prior", "proper (default): angular rate and acceleration are normal,"
                    " of the recording's own size; flat: as in the 2021 paper, under the papers'"
                    " model, which shrinks the array",
                    choices=methods.MOTION_PRIORS, default="proper"),
            _option("--rates", "p(omega | y_g) from the gyroscopes' noise (default: declared), or"
                    " from the spread among the gyroscopes of each sample, as the 2021 paper does"
                    " with measured data (30), with --motion-prior flat",
                    choices=methods.RATES, default="declared"),
            _number("--steps", "N", "steps of each chain", type=count),
            SEED,
        ),
    ),
    Command(
        "export", "export.run",
        "A calibration in another tool's format, with sds and the formula that corrects readings.",
        "cal.nc --format kalibr --out imu.yaml", "file to write",
        (
            _option("calibration", "what `imuarray calibrate` has written", type=InputFile),
            _option("--format", "json: everything; kalibr: imu.yaml of several IMUs; urdf: links"
                    " and fixed joints; csv: positions", choices=methods.EXPORTS, required=True),
            _file("--noise", "recording of the same IMUs lying still, for noise and random walk"),
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
            _option("--without", "effects to leave out of the catalogue, separated by commas"
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


def make_parser() -> argparse.ArgumentParser:
    """A parser that gives the command's function as ``run``; a wrong line is an InputError."""
    parser = Parser(
        prog="imuarray",
        description="Calibrate the geometry of inertial sensor arrays.",
        epilog="example: imuarray calibrate corrected.nc --out cal.nc;"
        " every command has its own: imuarray calibrate --help",
    )
    parser.add_argument("--version", action="version", version=f"imuarray {imuarray.__version__}")
    commands = parser.add_subparsers(dest="command", metavar="command", required=True)
    kinds = None
    for command in COMMANDS:
        name, _, kind = command.name.partition(" ")
        if kind and kinds is None:
            kinds = _add_convert(commands)
        _add(kinds if kind else commands, kind or name, command)
    return parser


def _add_convert(commands):
    summary = "Turn a logger's file into a recording."
    parser = commands.add_parser(
        "convert", help=summary, description=summary,
        epilog="example: imuarray convert csv log.csv --columns columns.yaml --out rec.nc",
    )  # fmt: skip
    return parser.add_subparsers(dest="kind", metavar="format", required=True)


def _add(commands, name: str, command: Command) -> None:
    """One subcommand, with what all of them have."""
    parser = commands.add_parser(
        name, help=command.summary, description=command.summary,
        epilog=f"example: imuarray {command.name} {command.example}",
    )  # fmt: skip
    parser.add_argument(
        "--out",
        required=True,
        type=Path,
        metavar="FOLDER" if command.folder else "FILE",
        help=command.out,
    )
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    parser.add_argument(
        "--json", action="store_true", help="the summary as one JSON object (SI units)"
    )
    parser.add_argument(
        "--debug", action="store_true", help="the traceback of an error that was not foreseen"
    )
    for option in command.options:
        parser.add_argument(option.name, **option.given)
    parser.set_defaults(run=_later(*command.run.split(".")), folder=command.folder, reasons=())


def _later(module: str, name: str) -> Callable[[argparse.Namespace], None]:
    """The function ``name`` of ``imuarray.commands.<module>``, loaded when it is called."""

    def run(arguments: argparse.Namespace) -> None:
        getattr(import_module(f"imuarray.commands.{module}"), name)(arguments)

    return run
