"""The console script `imuarray`; nothing heavy loads before a command is known to be sound."""

import argparse
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from imuarray.commands.argument_types import InputFile
from imuarray.commands.parser import make_parser
from imuarray.errors import InputError

NETCDF = (".nc", ".nc4", ".h5")
FIGURES = (".png", ".pdf")
OK, BAD_INPUT, INTERRUPTED, CLOSED = 0, 2, 130, 141


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status: 0, 2 for bad input, 130 when interrupted,
    141 when nobody reads its output any more.

    `argv` are the arguments without the program's name, by default the process's own.
    """
    try:
        with _warnings_in_one_line():
            arguments = make_parser().parse_args(argv)
            _check_output(arguments)
            _read_effects(arguments)
            arguments.run(arguments)
    except InputError as error:
        return _fail(str(error))
    except BrokenPipeError:
        # `| head` has read enough; the rest, and what is flushed at the end, goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CLOSED
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
    _require_writable("--out", out, arguments.folder)
    figure: Path | None = getattr(arguments, "figure", None)
    if figure is not None:
        _require_writable("--figure", figure)
        if figure.suffix.lower() not in FIGURES:
            found = figure.suffix or "no ending"
            raise InputError(f"--figure {figure}: expected {' or '.join(FIGURES)}, found {found}")
        if figure.resolve() == out.resolve():
            raise InputError(f"--figure {figure}: expected another file than --out, found the same")
    for source in _inputs(arguments):
        if not source.is_file():
            found = "a folder" if source.is_dir() else "none"
            raise InputError(f"{source}: expected a file to read, found {found}")
        if out.is_file() and out.samefile(source):
            raise InputError(f"--out {out}: expected another file than the input, found the same")
        if source.suffix in NETCDF:
            from imuarray.recording.apart import require_readable

            require_readable(source)


def _require_writable(option: str, path: Path, folder: bool = False) -> None:
    """InputError unless a file, or a folder, can be written there."""
    if folder:
        if path.exists() and not path.is_dir():
            raise InputError(f"{option} {path}: expected a folder, found a file")
    elif path.is_dir():
        raise InputError(f"{option} {path}: expected a file to write, found a folder")
    parent = path.parent
    if not parent.is_dir():
        raise InputError(f"{option} {path}: expected an existing folder, found no {parent}")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"{option} {path}: expected a folder one may write to, found {parent}")


def _read_effects(arguments: argparse.Namespace) -> None:
    """The user's own effects into the catalogue."""
    files = getattr(arguments, "effect_file", None)
    if not files:
        return
    from imuarray.model import read_effects

    new = [name for path in files for name in read_effects(path)]
    if hasattr(arguments, "effects") and not (arguments.effects or arguments.diagnosis):
        raise InputError(
            f"--effect-file: expected --effects that names what to use of {', '.join(new)}, found"
            " none"
        )


def _inputs(arguments: argparse.Namespace) -> list[InputFile]:
    """The files a command reads."""
    values = (value if isinstance(value, list) else [value] for value in vars(arguments).values())
    return [item for each in values for item in each if isinstance(item, InputFile)]


if __name__ == "__main__":
    sys.exit(main())
