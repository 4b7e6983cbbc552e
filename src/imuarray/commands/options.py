"""What several commands' options have in common; nothing heavy loads here."""

import argparse
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from imuarray.commands.argument_types import effects, positive
from imuarray.errors import InputError


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


def later(module: str, name: str) -> Callable[[argparse.Namespace], None]:
    """The function ``name`` of ``imuarray.commands.<module>``, loaded when it is called."""

    def run(arguments: argparse.Namespace) -> None:
        getattr(import_module(f"imuarray.commands.{module}"), name)(arguments)

    return run


def add_command(commands, name, run, summary, example, out, full=None) -> argparse.ArgumentParser:
    """One subcommand, with what all of them have; ``full`` is its name after another one."""
    parser = commands.add_parser(
        name, help=summary, description=summary,
        epilog=f"example: imuarray {full or name} {example}",
    )  # fmt: skip
    parser.add_argument("--out", required=True, type=Path, metavar="FILE", help=out)
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    parser.add_argument(
        "--json", action="store_true", help="the summary as one JSON object (SI units)"
    )
    parser.set_defaults(run=run)
    return parser


def add_recording(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path, help="NetCDF-4 recording to read")


def add_model(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--accelerometer-noise", type=positive, default=None, metavar="SD",
        help="assumed sd, m/s^2 (default: as the recording declares)",
    )  # fmt: skip
    add_effects(parser)


def add_effect_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--effect-file", type=Path, action="append", metavar="FILE",
        help="Python file with effects of your own, which is run: they join the catalogue; may be"
        " given again",
    )  # fmt: skip


def add_effects(parser: argparse.ArgumentParser) -> None:
    add_effect_file(parser)
    parser.add_argument(
        "--effects", type=effects, default=(), metavar="A,B",
        help="effects that extend the measurement model, separated by commas (default: none)",
    )  # fmt: skip
    parser.add_argument(
        "--diagnosis", type=Path, default=None, metavar="FILE",
        help="diagnosis.json whose extended model to use: its effects, their values, its noise",
    )  # fmt: skip
