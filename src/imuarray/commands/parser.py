"""The command line's parser: commands, options and their help; nothing heavy loads here."""

import argparse
from pathlib import Path

import imuarray
from imuarray.analysis import methods
from imuarray.commands.argument_types import count, effects, positive, seed
from imuarray.commands.options import (
    Parser,
    add_command,
    add_effect_file,
    add_effects,
    add_model,
    add_recording,
    later,
)


def make_parser() -> argparse.ArgumentParser:
    """What it parses has the command's function as ``run``; a wrong line is an InputError."""
    parser = Parser(
        prog="imuarray",
        description="Calibrate the geometry of inertial sensor arrays.",
        epilog="example: imuarray calibrate rec.nc --method gauss-newton --out cal.nc;"
        " every command has its own: imuarray calibrate --help",
    )
    parser.add_argument("--version", action="version", version=f"imuarray {imuarray.__version__}")
    commands = parser.add_subparsers(dest="command", metavar="command", required=True)
    _add_simulate(commands)
    _add_convert(commands)
    _add_first_order(commands)
    _add_select(commands)
    _add_calibrate(commands)
    _add_apply(commands)
    _add_sample(commands)
    _add_residuals(commands)
    _add_repeat(commands)
    _add_diagnose(commands)
    return parser


def _add_simulate(commands) -> None:
    parser = add_command(
        commands,
        "simulate",
        later("simulate", "simulate"),
        "Simulate a recording; its truth is stored in the group 'truth'.",
        "--config config.yaml --out rec.nc",
        "recording to write (NetCDF-4)",
    )
    parser.add_argument(
        "--config", required=True, type=Path, metavar="FILE", help="configuration (YAML)"
    )
    add_effects(parser)


def _add_convert(commands) -> None:
    summary = "Turn a logger's file into a recording."
    kinds = commands.add_parser(
        "convert",
        help=summary,
        description=summary,
        epilog="example: imuarray convert csv log.csv --columns columns.yaml --out rec.nc",
    ).add_subparsers(dest="kind", metavar="format", required=True)
    _add_convert_mimu(kinds)
    _add_convert_csv(kinds)


def _add_convert_mimu(kinds) -> None:
    parser = add_command(
        kinds,
        "mimu",
        later("convert", "convert_mimu"),
        "Read the packets of a MIMU board; damage is located and counted.",
        "data.bin --positions IMU_positions.csv --out rec.nc",
        "recording to write (NetCDF-4)",
        "convert mimu",
    )
    parser.add_argument("data", type=Path, help="binary file of packets")
    parser.add_argument(
        "--positions", required=True, type=Path, metavar="FILE",
        help="CSV of nominal positions in m: header 'axes, IMU 1, ...', rows x, y, z",
    )  # fmt: skip
    parser.add_argument(
        "--underside", metavar="2,4", help="IMUs turned over (default: the even-numbered ones)"
    )
    for name, default, unit in (
        ("--accelerometer-noise", 0.04, "sd of one reading, m/s^2"),
        ("--gyroscope-noise-dps", 0.06, "sd of one reading, deg/s"),
        ("--position-prior", 3e-3, "sd of the nominal positions, m"),
    ):
        parser.add_argument(
            name, type=positive, default=default, metavar="SD", help=f"{unit} (default: {default})"
        )


def _add_convert_csv(kinds) -> None:
    parser = add_command(
        kinds,
        "csv",
        later("convert", "convert_csv"),
        "Read a table; a small YAML names its columns and units (docs/convert.md).",
        "log.csv --columns columns.yaml --out rec.nc",
        "recording to write (NetCDF-4)",
        "convert csv",
    )
    parser.add_argument("data", type=Path, help="CSV file with a header")
    parser.add_argument(
        "--columns",
        required=True,
        type=Path,
        metavar="FILE",
        help="YAML: columns, units, positions",
    )


def _add_first_order(commands) -> None:
    parser = add_command(
        commands,
        "first-order",
        later("measured", "first_order"),
        "Calibrate each triad by itself from the recording's still poses, and correct it.",
        "rec.nc --gravity 9.818 --out corrected.nc",
        "corrected recording to write (NetCDF-4), with the calibration in group 'first_order'",
    )
    add_recording(parser)
    parser.add_argument(
        "--gravity", type=positive, default=9.80665, metavar="G",
        help="magnitude of gravity where it was recorded, m/s^2 (default: 9.80665)",
    )  # fmt: skip


def _add_select(commands) -> None:
    parser = add_command(
        commands,
        "select",
        later("measured", "select"),
        "Keep moving, unsaturated, informative samples; says what each criterion removed.",
        "corrected.nc --samples 500 --out subset.nc",
        "recording to write (NetCDF-4)",
    )
    add_recording(parser)
    parser.add_argument(
        "--samples", type=count, default=None, metavar="T",
        help="how many, spread evenly (default: all informative ones)",
    )  # fmt: skip


def _add_residuals(commands) -> None:
    parser = add_command(
        commands,
        "residuals",
        later("measured", "residuals"),
        "Residuals of the papers' model beside those of the recording's own simulation.",
        "corrected.nc --figure residuals.png --out residuals.csv",
        "table to write (CSV)",
    )
    add_recording(parser)
    parser.add_argument("--figure", type=Path, metavar="FILE", help="figure to write (PNG or PDF)")
    parser.add_argument("--seed", type=seed, default=0, metavar="S", help="of the simulation")


def _add_repeat(commands) -> None:
    parser = add_command(
        commands,
        "repeat",
        later("measured", "repeat"),
        "Do several recordings of one board agree within their claimed widths?",
        "one.nc two.nc three.nc --samples 500 --out agreement.csv",
        "table to write (CSV): z-scores of all pairs",
    )
    parser.add_argument(
        "recordings", type=Path, nargs="+", metavar="recording", help="two or more recordings"
    )
    parser.add_argument(
        "--samples", type=count, default=500, metavar="T", help="of each recording (default: 500)"
    )
    parser.add_argument(
        "--accelerometer-noise", type=positive, default=None, metavar="SD",
        help="assumed sd, m/s^2 (default: estimated from each recording's residual)",
    )  # fmt: skip


def _add_diagnose(commands) -> None:
    parser = add_command(
        commands,
        "diagnose",
        later("diagnose", "diagnose"),
        "What does the simulation get wrong, why, and what does the extended model gain?",
        "corrected.nc --out diagnosis/",
        "folder to write: diagnosis.json, report.html, figures",
    )
    parser.set_defaults(folder=True)
    add_recording(parser)
    add_effect_file(parser)
    parser.add_argument(
        "--without", type=effects, default=(), metavar="A,B",
        help="effects to strike from the catalogue, separated by commas (default: none)",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=seed, default=0, metavar="S", help="of the replicates (default: 0)"
    )


def _add_calibrate(commands) -> None:
    parser = add_command(
        commands,
        "calibrate",
        later("calibrate", "calibrate"),
        "Estimate the accelerometer positions and the motion by maximum likelihood.",
        "rec.nc --method bcd --out cal.nc",
        "estimates to write (NetCDF-4)",
    )
    add_recording(parser)
    add_model(parser)
    parser.add_argument(
        "--method", choices=methods.CALIBRATION, default="bcd",
        help="bcd: block coordinate descent (default); gauss-newton: any effects, fewer iterations",
    )  # fmt: skip


def _add_apply(commands) -> None:
    parser = add_command(
        commands,
        "apply",
        later("apply", "apply"),
        "The calibrated array as one sensor: angular rate, angular acceleration and specific force"
        " at each sample, with covariances.",
        "cal.nc rec.nc --out motion.nc",
        "motion to write (NetCDF-4)",
    )
    parser.add_argument(
        "calibration",
        type=Path,
        help="what `imuarray calibrate` has written, or the diagnosis.json of `imuarray diagnose`",
    )
    add_recording(parser)
    add_effect_file(parser)
    parser.add_argument(
        "--accelerometer-noise", type=positive, default=None, metavar="SD",
        help="assumed sd, m/s^2 (default: as the recording declares)",
    )  # fmt: skip


def _add_sample(commands) -> None:
    parser = add_command(
        commands,
        "sample",
        later("sample", "sample"),
        "Sample the posterior distribution of the accelerometer positions.",
        "rec.nc --method pmmh --steps 5000 --seed 1 --out posterior.nc",
        "posterior to write (NetCDF-4)",
    )
    add_recording(parser)
    add_model(parser)
    parser.add_argument(
        "--method", choices=methods.SAMPLING, default="pmmh",
        help="pmmh: pseudo-marginal Metropolis-Hastings, as paper 2021 (default); nuts: the"
        " no-U-turn sampler on the exact marginal likelihood, in seconds",
    )  # fmt: skip
    parser.add_argument(
        "--rates", choices=methods.RATES, default="declared",
        help="p(omega | y_g) from the declared gyroscope noise (default), or from the spread among"
        " the gyroscopes of each sample, as paper 2021 does with measured data (30)",
    )  # fmt: skip
    parser.add_argument(
        "--steps", type=count, default=None, metavar="N", help="steps of each chain"
    )
    parser.add_argument(
        "--seed", type=seed, default=0, metavar="S", help="of the random numbers (default: 0)"
    )
