"""The console script `imuarray`; nothing heavy loads before a command is known to be sound."""

import argparse
import ctypes
import gc
import os
import signal
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from pkgutil import resolve_name
from typing import NoReturn

from imuarray.commands.argument_types import InputFile, InputLog
from imuarray.commands.parser import make_parser
from imuarray.errors import InputError, numbered, one_line, require

NETCDF = (".nc", ".nc4", ".h5")
PAGES = ("recording.nc", "cal.nc", "positions.csv", "report.html", "diagnosis.json")  # in folders
OK, UNFORESEEN, BAD_INPUT, UNTRUSTED, INTERRUPTED, CLOSED = 0, 1, 2, 3, 130, 141
AGAIN = 0.05  # s, after which an interrupt that was dropped comes again
COLLECTED = 100_000  # objects, after which Python looks for cycles
M_ARENA_MAX = -8  # of glibc's malloc.h
PATIENCE = 1.0  # s, in which an interrupted command may tidy up


def script() -> NoReturn:
    """`imuarray` in a shell.

    Interrupted, it does not wait for threads of compiled code: Python's shutdown would fault.
    """
    _end_soon()
    gc.set_threshold(COLLECTED)  # fonts and figures are many objects, hardly any in a cycle
    with suppress(OSError, AttributeError):  # not glibc
        # two heaps for all threads: of its own each would keep what another has freed
        ctypes.CDLL(None).mallopt(M_ARENA_MAX, 2)
    status = main()
    if status == INTERRUPTED:
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


def _end_soon() -> None:
    """A thread that ends an interrupted process: Python waits for compiled code to return."""

    def watch() -> None:
        while (number := os.read(read, 1)[0]) not in (signal.SIGINT, signal.SIGTERM):
            pass  # SIGALRM
        time.sleep(PATIENCE)
        said = "interrupted (SIGTERM)" if number == signal.SIGTERM else "interrupted"
        os.write(2, f"imuarray: {said}\n".encode())
        os._exit(INTERRUPTED)

    read, write = os.pipe()
    os.set_blocking(write, False)
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    os.register_at_fork(after_in_child=lambda: signal.set_wakeup_fd(-1))  # theirs are not ours
    threading.Thread(target=watch, daemon=True).start()


def main(argv: Sequence[str] | None = None, parser: argparse.ArgumentParser | None = None) -> int:
    """Run one command; returns the exit status.

    0; 2 for bad input, nothing written; 3 where what was written is not to be trusted (the last
    line says why); 130 when interrupted or terminated; 141 when nobody reads its output any more;
    1 for what was not foreseen, whose traceback ``--debug`` shows.

    `argv` are the arguments without the program's name, by default the process's own; ``parser``
    is by default that of `imuarray`.
    """
    arguments = argparse.Namespace()
    try:
        with _warnings_in_one_line(), _interruptions():
            (parser or make_parser()).parse_args(argv, arguments)
            _check_output(arguments)
            _read_effects(arguments)
            from imuarray.commands.output import Output

            output = Output(arguments)
            reasons = output.done(resolve_name(arguments.run)(arguments, output))
    except InputError as error:
        return _fail(error)
    except BrokenPipeError:
        # `| head` has read enough; the rest, and what is flushed at the end, goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CLOSED
    except OSError as error:
        # without the system's number
        named = error.strerror and error.filename is not None
        return _fail(f"{error.filename}: {error.strerror}" if named else error.strerror or error)
    except KeyboardInterrupt as error:
        return _fail(" ".join(["interrupted", *map(str, error.args)]), INTERRUPTED)
    except Exception as error:
        debug = getattr(arguments, "debug", False)
        if debug:
            traceback.print_exception(error)
        hint = "" if debug else " (--debug shows where)"
        return _fail(f"unforeseen: {type(error).__name__}: {error}{hint}", UNFORESEEN)
    if reasons:
        return _fail(f"not to be trusted: {numbered(reasons)}", UNTRUSTED)
    return OK


def _fail(message: object, status: int = BAD_INPUT) -> int:
    print(f"imuarray: {one_line(message)}", file=sys.stderr)
    return status


@contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    """A warning is for the user of the command, who did not write the line it comes from."""
    before = warnings.formatwarning
    warnings.formatwarning = lambda message, *_, **__: f"imuarray: warning: {one_line(message)}\n"
    try:
        yield
    finally:
        warnings.formatwarning = before


@contextmanager
def _interruptions() -> Iterator[None]:
    """SIGTERM ends a command as Ctrl-C does: what it has begun to write is removed.

    An interrupt that Python drops, as it comes in a destructor or a callback, comes again.
    """

    def interrupt(number: int, _: object) -> NoReturn:
        raise KeyboardInterrupt(*["(SIGTERM)"] * (number == signal.SIGTERM))

    def dropped(unraisable) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            return hook(unraisable)
        number = signal.SIGTERM if unraisable.exc_value.args else signal.SIGINT
        signal.signal(signal.SIGALRM, lambda *_: interrupt(number, None))
        signal.setitimer(signal.ITIMER_REAL, AGAIN)

    if threading.current_thread() is not threading.main_thread():  # signals are not for it
        yield
        return
    hook, sys.unraisablehook = sys.unraisablehook, dropped
    before = {n: signal.getsignal(n) for n in (signal.SIGTERM, signal.SIGALRM)}
    signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        sys.unraisablehook = hook
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in before.items():
            signal.signal(number, handler)


def _check_output(arguments: argparse.Namespace) -> None:
    """Refuse an output that cannot be written now, not after an hour of sampling."""
    out: Path = arguments.out
    _require_writable(out, arguments.folder)
    values = (value if isinstance(value, list) else [value] for value in vars(arguments).values())
    for source in (x for each in values for x in each if isinstance(x, InputFile)):
        bag = isinstance(source, InputLog) and source.is_dir()
        found = "a folder" if source.is_dir() else "none"
        require(source.is_file() or bag, str(source), "a file to read", found)
        same = out.is_file() and out.samefile(source)
        require(not same, f"--out {out}", "another file than the input", "the same")
        if arguments.folder and source.name in PAGES and source.resolve().parent == out.resolve():
            raise InputError(f"--out {out}: expected a folder without the input {source.name}")
        if source.suffix in NETCDF:
            from imuarray.recording.channels import require_readable

            require_readable(source)


def _require_writable(out: Path, folder: bool) -> None:
    """InputError unless a file, or a folder, can be written there."""
    # folders that are missing are made, in the first that is there
    parent = next(p for p in Path(os.path.realpath(out)).parents if os.path.lexists(p))
    where = f"--out {out}"
    require(parent.is_dir(), where, "a folder", f"the file {parent}")
    require(os.access(parent, os.W_OK | os.X_OK), where, "a folder one may write to", parent)
    if folder:
        found = "a file" if out.exists() else "a link to nothing"
        return require(out.is_dir() or not os.path.lexists(out), where, "a folder", found)
    from imuarray.provenance import target_of

    try:
        target_of(out)
    except OSError as error:
        raise InputError(f"{where}: {error.strerror}") from None


def _read_effects(arguments: argparse.Namespace) -> None:
    """The user's own effects into the catalogue."""
    files = getattr(arguments, "effect_file", None)
    if not files:
        return
    from imuarray.model import read_effects

    new = [name for path in files for name in read_effects(path)]
    of_file = isinstance(getattr(arguments, "model", None), InputFile)
    if hasattr(arguments, "effects") and not of_file:
        wanted = f"--effects that names what to use of {', '.join(new)}"
        require(arguments.effects, "--effect-file", wanted, "none")


if __name__ == "__main__":
    script()
