"""The console script `imuarray`; nothing heavy loads before a command is known to be sound."""

import argparse
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import imuarray
from imuarray.errors import InputError

OK, BAD_INPUT, INTERRUPTED = 0, 2, 130

CALIBRATION_METHODS = ("bcd", "gauss-newton")
SAMPLING_METHODS = ("pmmh",)


class _Parser(argparse.ArgumentParser):
    """Reports a wrong command line as one line, like every other wrong input."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see '{self.prog} --help')")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status: 0, 2 for bad input, 130 when interrupted.

    `argv` are the arguments without the program's name, by default the process's own.
    """
    try:
        with _warnings_in_one_line():
            arguments = _parser().parse_args(argv)
            _check_output(arguments)
            arguments.run(arguments)
    except InputError as error:
        return _fail(str(error))
    except OSError as error:
        return _fail(_describe(error))
    except KeyboardInterrupt:
        print("imuarray: interrupted", file=sys.stderr)
        return INTERRUPTED
    return OK


def _fail(message: str) -> int:
    print(f"imuarray: {' '.join(message.split())}", file=sys.stderr)
    return BAD_INPUT


def _describe(error: OSError) -> str:
    """The system's error without its number."""
    if error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return error.strerror or str(error)


@contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    """A warning is for the user of the command, who did not write the line it comes from."""

    def one_line(message: Warning | str, *_where: object, **__: object) -> str:
        return f"imuarray: warning: {' '.join(str(message).split())}\n"

    before = warnings.formatwarning
    warnings.formatwarning = one_line
    try:
        yield
    finally:
        warnings.formatwarning = before


def _check_output(arguments: argparse.Namespace) -> None:
    """Refuse an output that cannot be written now, not after an hour of sampling."""
    out: Path = arguments.out
    if getattr(arguments, "folder", False):
        if out.exists() and not out.is_dir():
            raise InputError(f"--out {out}: expected a folder, found a file")
    elif out.is_dir():
        raise InputError(f"--out {out}: expected a file to write, found a folder")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: expected an existing folder, found no {out.parent}")
    if not os.access(out.parent, os.W_OK | os.X_OK):
        raise InputError(f"--out {out}: expected a folder one may write to, found {out.parent}")
    for source in _inputs(arguments):
        if not source.is_file():
            raise InputError(f"{source}: expected a file to read, found none")
        if out.is_file() and out.samefile(source):
            raise InputError(f"--out {out}: expected another file than the input, found the same")


def _inputs(arguments: argparse.Namespace) -> list[Path]:
    """The files a command reads."""
    found = []
    for name in ("config", "data", "positions", "columns", "diagnosis", "recording", "recordings"):
        value = getattr(arguments, name, None)
        found += value if isinstance(value, list) else [value] if value is not None else []
    return found


def _simulate(arguments: argparse.Namespace) -> None:
    from imuarray.commands import simulate

    simulate(arguments)


def _calibrate(arguments: argparse.Namespace) -> None:
    from imuarray.commands import calibrate

    calibrate(arguments)


def _sample(arguments: argparse.Namespace) -> None:
    from imuarray.commands import sample

    sample(arguments)


def _diagnose(arguments: argparse.Namespace) -> None:
    from imuarray.commands_criticism import diagnose

    diagnose(arguments)


def _later(name: str):
    """A command of `imuarray.commands_measured`, loaded when it is called."""

    def run(arguments: argparse.Namespace) -> None:
        from imuarray import commands_measured

        getattr(commands_measured, name)(arguments)

    return run


def _effects(text: str) -> tuple[str, ...]:
    """Comma-separated names; whether they exist is for the measurement model to say."""
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if len(set(names)) != len(names):
        raise argparse.ArgumentTypeError(f"expected each effect once, found {text!r}")
    return names


def _at_least(least: int, text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = None
    if value is None or value < least:
        raise argparse.ArgumentTypeError(f"expected an integer of at least {least}, found {text!r}")
    return value


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a positive number, found {text!r}")
    return value


def _count(text: str) -> int:
    return _at_least(1, text)


def _seed(text: str) -> int:
    return _at_least(0, text)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="imuarray", description="Calibrate the geometry of inertial sensor arrays."
    )
    parser.add_argument("--version", action="version", version=f"imuarray {imuarray.__version__}")
    commands = parser.add_subparsers(dest="command", metavar="command", required=True)
    _add_simulate(commands)
    _add_convert(commands)
    _add_first_order(commands)
    _add_select(commands)
    _add_calibrate(commands)
    _add_sample(commands)
    _add_residuals(commands)
    _add_repeat(commands)
    _add_diagnose(commands)
    return parser


def _add_command(commands, name, run, summary, example, out, full=None) -> argparse.ArgumentParser:
    """One subcommand, with what all of them have; ``full`` is its name after another one."""
    parser = commands.add_parser(
        name, help=summary, description=summary,
        epilog=f"example: imuarray {full or name} {example}",
    )  # fmt: skip
    parser.add_argument("--out", required=True, type=Path, metavar="FILE", help=out)
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    parser.set_defaults(run=run)
    return parser


def _add_recording(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path, help="NetCDF-4 recording to read")
    parser.add_argument(
        "--accelerometer-noise",
        type=_positive,
        default=None,
        metavar="SD",
        help="assumed sd, m/s^2 (default: as the recording declares)",
    )
    _add_effects(parser)


def _add_effects(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--effects",
        type=_effects,
        default=(),
        metavar="A,B",
        help="effects that extend the measurement model, separated by commas (default: none)",
    )
    parser.add_argument(
        "--diagnosis",
        type=Path,
        default=None,
        metavar="FILE",
        help="diagnosis.json whose extended model to use: its effects, their values, its noise",
    )


def _add_simulate(commands) -> None:
    parser = _add_command(
        commands,
        "simulate",
        _simulate,
        "Simulate a recording; its truth is stored in the group 'truth'.",
        "--config config.yaml --out rec.nc",
        "recording to write (NetCDF-4)",
    )
    parser.add_argument(
        "--config", required=True, type=Path, metavar="FILE", help="configuration (YAML)"
    )
    _add_effects(parser)


def _add_convert(commands) -> None:
    summary = "Turn a logger's file into a recording."
    kinds = commands.add_parser("convert", help=summary, description=summary).add_subparsers(
        dest="kind", metavar="format", required=True
    )
    mimu = _add_command(
        kinds,
        "mimu",
        _later("convert_mimu"),
        "Read the packets of a MIMU board; damage is located and counted.",
        "data.bin --positions IMU_positions.csv --out rec.nc",
        "recording to write (NetCDF-4)",
        "convert mimu",
    )
    mimu.add_argument("data", type=Path, help="binary file of packets")
    mimu.add_argument(
        "--positions", required=True, type=Path, metavar="FILE",
        help="CSV of nominal positions in m: header 'axes, IMU 1, ...', rows x, y, z",
    )  # fmt: skip
    mimu.add_argument(
        "--underside", metavar="2,4", help="IMUs turned over (default: the even-numbered ones)"
    )
    for name, default, unit in (
        ("--accelerometer-noise", 0.04, "sd of one reading, m/s^2"),
        ("--gyroscope-noise-dps", 0.06, "sd of one reading, deg/s"),
        ("--position-prior", 3e-3, "sd of the nominal positions, m"),
    ):
        mimu.add_argument(
            name, type=_positive, default=default, metavar="SD", help=f"{unit} (default: {default})"
        )
    csv = _add_command(
        kinds,
        "csv",
        _later("convert_csv"),
        "Read a table; a small YAML names its columns and units (docs/convert.md).",
        "log.csv --columns columns.yaml --out rec.nc",
        "recording to write (NetCDF-4)",
        "convert csv",
    )
    csv.add_argument("data", type=Path, help="CSV file with a header")
    csv.add_argument(
        "--columns",
        required=True,
        type=Path,
        metavar="FILE",
        help="YAML: columns, units, positions",
    )


def _add_first_order(commands) -> None:
    parser = _add_command(
        commands,
        "first-order",
        _later("first_order"),
        "Calibrate each triad by itself from the recording's still poses, and correct it.",
        "rec.nc --gravity 9.818 --out corrected.nc",
        "corrected recording to write (NetCDF-4), with the calibration in group 'first_order'",
    )
    parser.add_argument("recording", type=Path, help="NetCDF-4 recording to read")
    parser.add_argument(
        "--gravity", type=_positive, default=9.80665, metavar="G",
        help="magnitude of gravity where it was recorded, m/s^2 (default: 9.80665)",
    )  # fmt: skip


def _add_select(commands) -> None:
    parser = _add_command(
        commands,
        "select",
        _later("select"),
        "Keep moving, unsaturated, informative samples; says what each criterion removed.",
        "corrected.nc --samples 500 --out subset.nc",
        "recording to write (NetCDF-4)",
    )
    parser.add_argument("recording", type=Path, help="NetCDF-4 recording to read")
    parser.add_argument(
        "--samples", type=_count, default=None, metavar="T",
        help="how many, spread evenly (default: all informative ones)",
    )  # fmt: skip


def _add_residuals(commands) -> None:
    parser = _add_command(
        commands,
        "residuals",
        _later("residuals"),
        "Residuals of the papers' model beside those of the recording's own simulation.",
        "corrected.nc --figure residuals.png --out residuals.csv",
        "table to write (CSV)",
    )
    parser.add_argument("recording", type=Path, help="NetCDF-4 recording to read")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="figure to write (PNG or PDF)")
    parser.add_argument("--seed", type=_seed, default=0, metavar="S", help="of the simulation")


def _add_repeat(commands) -> None:
    parser = _add_command(
        commands,
        "repeat",
        _later("repeat"),
        "Do several recordings of one board agree within their claimed widths?",
        "one.nc two.nc three.nc --samples 500 --out agreement.csv",
        "table to write (CSV): z-scores of all pairs",
    )
    parser.add_argument(
        "recordings", type=Path, nargs="+", metavar="recording", help="two or more recordings"
    )
    parser.add_argument(
        "--samples", type=_count, default=500, metavar="T", help="of each recording (default: 500)"
    )
    parser.add_argument(
        "--accelerometer-noise", type=_positive, default=None, metavar="SD",
        help="assumed sd, m/s^2 (default: estimated from each recording's residual)",
    )  # fmt: skip


def _add_diagnose(commands) -> None:
    parser = _add_command(
        commands,
        "diagnose",
        _diagnose,
        "What does the simulation get wrong, why, and what does the extended model gain?",
        "corrected.nc --out diagnosis/",
        "folder to write: diagnosis.json, report.html, figures",
    )
    parser.set_defaults(folder=True)
    parser.add_argument("recording", type=Path, help="NetCDF-4 recording to read")
    parser.add_argument(
        "--without", type=_effects, default=(), metavar="A,B",
        help="effects to strike from the catalogue, separated by commas (default: none)",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=_seed, default=0, metavar="S", help="of the replicates (default: 0)"
    )


def _add_calibrate(commands) -> None:
    parser = _add_command(
        commands,
        "calibrate",
        _calibrate,
        "Estimate the accelerometer positions and the motion by maximum likelihood.",
        "rec.nc --method bcd --out cal.nc",
        "estimates to write (NetCDF-4)",
    )
    _add_recording(parser)
    parser.add_argument(
        "--method",
        choices=CALIBRATION_METHODS,
        default="bcd",
        help="bcd: block coordinate descent (default); gauss-newton: any effects, fewer iterations",
    )


def _add_sample(commands) -> None:
    parser = _add_command(
        commands,
        "sample",
        _sample,
        "Sample the posterior distribution of the accelerometer positions.",
        "rec.nc --method pmmh --steps 5000 --seed 1 --out posterior.nc",
        "posterior to write (NetCDF-4)",
    )
    _add_recording(parser)
    parser.add_argument(
        "--method",
        choices=SAMPLING_METHODS,
        default="pmmh",
        help="pmmh: pseudo-marginal Metropolis-Hastings (default)",
    )
    parser.add_argument(
        "--rates",
        choices=("declared", "spread"),
        default="declared",
        help="p(omega | y_g) from the declared gyroscope noise (default), or from the spread among"
        " the gyroscopes of each sample, as paper 2021 does with measured data (30)",
    )
    parser.add_argument(
        "--steps", type=_count, default=None, metavar="N", help="steps of each chain"
    )
    parser.add_argument(
        "--seed", type=_seed, default=0, metavar="S", help="of the random numbers (default: 0)"
    )


if __name__ == "__main__":
    sys.exit(main())
