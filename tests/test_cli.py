"""The command line: exit status, one line on standard error, nothing written, no traceback."""

import json
import os
import subprocess
import sys
import types
import warnings

import pytest

import imuarray
from imuarray.cli import main
from imuarray.commands.output import Answer
from imuarray.errors import IdentifiabilityError, InputError


@pytest.fixture
def calls(monkeypatch, tmp_path):
    """Stand-ins for the commands, which note what they were called with."""
    seen = []
    for module, name in (
        ("recordings", "simulate"), ("calibrate", "calibrate"), ("sample", "sample")
    ):  # fmt: skip
        command = types.ModuleType(f"imuarray.commands.{module}")
        note = lambda *given, name=name: seen.append((name, given[0])) or Answer("", {})  # noqa: E731
        setattr(command, name, note)
        monkeypatch.setitem(sys.modules, f"imuarray.commands.{module}", command)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rec.nc").write_text("stands for a recording")
    (tmp_path / "c.yaml").write_text("scale: quick")
    (tmp_path / "folder").mkdir()
    return seen


def fail_with(monkeypatch, error):
    def command(arguments, _):
        raise error

    module = types.ModuleType("imuarray.commands.calibrate")
    module.calibrate = command
    monkeypatch.setitem(sys.modules, "imuarray.commands.calibrate", module)


def error_line(capsys):
    """What the command said: one line on standard error, nothing on standard output."""
    out, err = capsys.readouterr()
    assert out == "" and err.endswith("\n") and err.count("\n") == 1
    assert err.startswith("imuarray: ") and "Traceback" not in err
    return err


def test_simulate(calls):
    assert main(["simulate", "--duration", "5", "--out", "new.nc"]) == 0
    [(name, arguments)] = calls
    assert name == "simulate" and not arguments.quiet
    assert (arguments.duration, str(arguments.out)) == (5.0, "new.nc")


def test_calibrate(calls):
    command = "calibrate rec.nc --out cal.nc --quiet"
    assert main([*command.split(), "--effects", "size_effect, gyroscope_bias"]) == 0
    [(name, arguments)] = calls
    assert (name, arguments.model, arguments.quiet) == ("calibrate", "sensors", True)
    assert arguments.effects == ("size_effect", "gyroscope_bias")


def test_sample(calls):
    assert main("sample rec.nc --out p.nc --steps 50 --seed 3".split()) == 0
    assert main("sample rec.nc --out p.nc --model papers".split()) == 0
    first, second = (arguments for _, arguments in calls)
    assert (first.model, first.method, first.steps, first.seed) == ("sensors", "auto", 50, 3)
    assert (second.model, second.steps, second.seed, second.effects) == ("papers", None, 0, ())


BAD = {
    "": "required: command",
    "frobnicate": "invalid choice",
    "simulate": "required: --out",
    "calibrate --out new.nc": "required: recording",
    "calibrate no.nc --out new.nc": "no.nc: expected a file to read, found none",
    "calibrate folder --out new.nc": "folder: expected a file to read, found a folder",
    "calibrate rec.nc --out rec.nc/new.nc": "rec.nc/new.nc: expected a folder",
    "calibrate rec.nc --out rec.nc/a/new.nc": "rec.nc/a/new.nc: expected a folder",
    "calibrate rec.nc --out /dev/null": "expected a file to write, found a device",
    "calibrate rec.nc --out folder": "expected a file to write, found a folder",
    "calibrate rec.nc --out rec.nc": "expected another file than the input",
    "sample rec.nc --out new.nc --method magic": "invalid choice: 'magic'",
    "calibrate rec.nc --out new.nc --effects a,b,a": "expected each effect once, found 'a,b,a'",
    "calibrate rec.nc --out new.nc --steps 3": "--steps 3 (see 'imuarray calibrate --help')",
    "sample rec.nc --out new.nc --steps 0": "an integer of at least 1, found '0'",
    "sample rec.nc --out new.nc --steps many": "an integer of at least 1, found 'many'",
    "sample rec.nc --out new.nc --seed -1": "an integer of at least 0, found '-1'",
    "sample rec.nc --out new.nc --seed 1.5": "an integer of at least 0, found '1.5'",
}


@pytest.mark.parametrize("command", BAD)
def test_bad_command_lines(calls, capsys, tmp_path, command):
    before = sorted(path.name for path in tmp_path.iterdir())
    assert main(command.split()) == 2
    assert BAD[command] in error_line(capsys)
    assert calls == [] and sorted(path.name for path in tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (InputError("rec.nc: expected x,\n found y"), "imuarray: rec.nc: expected x, found y\n"),
        (IdentifiabilityError("too few"), "imuarray: too few\n"),
        (
            PermissionError(13, "Permission denied", "cal.nc"),
            "imuarray: cal.nc: Permission denied\n",
        ),
        (OSError("HDF5 says\nno"), "imuarray: HDF5 says no\n"),
        (OSError(28, "No space left on device"), "imuarray: No space left on device\n"),
    ],
)
def test_errors_of_a_command(calls, capsys, monkeypatch, error, message):
    fail_with(monkeypatch, error)
    assert main("calibrate rec.nc --out cal.nc".split()) == 2
    assert error_line(capsys) == message


def test_interruption(calls, capsys, monkeypatch):
    fail_with(monkeypatch, KeyboardInterrupt())
    assert main("calibrate rec.nc --out cal.nc".split()) == 130
    assert error_line(capsys) == "imuarray: interrupted\n"


def test_what_was_not_foreseen_is_one_line(calls, capsys, monkeypatch):
    fail_with(monkeypatch, ZeroDivisionError("a defect\nof two lines"))
    assert main("calibrate rec.nc --out cal.nc".split()) == 1
    line = "imuarray: unforeseen: ZeroDivisionError: a defect of two lines"
    assert error_line(capsys) == f"{line} (--debug shows where)\n"
    assert main("calibrate rec.nc --out cal.nc --debug".split()) == 1
    err = capsys.readouterr().err
    assert err.startswith("Traceback") and err.splitlines()[-1] == line


def test_an_answer_not_to_be_trusted(calls, capsys, monkeypatch):
    reasons = ["positions off\x1b[31m", "residual 7 times"]

    def command(arguments, _):
        return Answer("", {"x": 1.0}, reasons)

    monkeypatch.setattr(sys.modules["imuarray.commands.calibrate"], "calibrate", command)
    assert main("calibrate rec.nc --out cal.nc --json".split()) == 3
    out, err = capsys.readouterr()
    said = ["positions off\\x1b[31m", "residual 7 times"]
    assert json.loads(out) == {"out": "cal.nc", "x": 1.0, "trusted": False, "reasons": said}
    assert err == f"imuarray: not to be trusted: (1) {said[0]}; (2) {said[1]}\n"
    reasons.clear()
    assert main("calibrate rec.nc --out cal.nc --json".split()) == 0
    expected = {"out": "cal.nc", "x": 1.0, "trusted": True, "reasons": []}
    assert json.loads(capsys.readouterr().out) == expected


def run_as_calibrate(code: str, tmp_path) -> tuple[int, str]:
    """Status and standard error of the console script, ``code`` having defined its `command`."""
    around = (
        "import ctypes, os, signal, sys, threading, time, types, warnings\n"
        "from imuarray.cli import script\n"
        "from imuarray.provenance import atomic_write\n"
        # a job in a shell's background ignores it
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"{code}"
        "m = sys.modules['imuarray.commands.calibrate'] = types.ModuleType('m')\n"
        "m.calibrate = command\n"
        "sys.argv = ['imuarray', 'calibrate', sys.executable, '--out', 'cal.nc']\n"
        "script()"
    )
    call = [sys.executable, "-c", around]
    run = subprocess.run(call, capture_output=True, text=True, cwd=tmp_path, timeout=15)
    return run.returncode, run.stderr


def test_termination_leaves_nothing_half_written(tmp_path):
    code = (
        "def command(arguments, _):\n"
        "    with atomic_write(arguments.out) as temporary:\n"
        "        temporary.write_text('half')\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "        signal.pause()\n"
    )
    assert run_as_calibrate(code, tmp_path) == (130, "imuarray: interrupted (SIGTERM)\n")
    assert not list(tmp_path.iterdir())


def test_termination_does_not_wait_for_compiled_code(tmp_path):
    code = (
        "def command(arguments, _):\n"
        "    kill = lambda: os.kill(os.getpid(), signal.SIGTERM)\n"
        "    threading.Timer(0.1, kill).start()\n"
        "    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})\n"  # would end the sleep
        "    ctypes.CDLL(None).sleep(60)\n"
    )
    assert run_as_calibrate(code, tmp_path) == (130, "imuarray: interrupted (SIGTERM)\n")


def test_an_interrupt_that_python_drops_comes_again(tmp_path):
    """In a destructor nothing can be raised."""
    code = (
        "class Deaf:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "        time.sleep(0.01)\n"
        "def command(arguments, _):\n"
        "    Deaf()\n"
        "    time.sleep(20)\n"
    )
    assert run_as_calibrate(code, tmp_path) == (130, "imuarray: interrupted\n")


def test_no_message_reaches_the_terminal_as_a_command(calls, capsys, monkeypatch):
    fail_with(monkeypatch, InputError("found a column 'a\x1b[2J\x07\x9b\udc80'"))
    assert main("calibrate rec.nc --out cal.nc".split()) == 2
    assert "'a\\x1b[2J\\x07\\x9b\\udc80'" in error_line(capsys)


def test_a_warning_is_one_line(tmp_path):
    """In a process of its own: pytest collects warnings before they are printed."""
    code = (
        "from imuarray.commands.output import Answer\n"
        "def command(arguments, _):\n"
        "    warnings.warn('a gap\\nin time', stacklevel=1)\n"
        "    return Answer('', {})\n"
    )
    assert run_as_calibrate(code, tmp_path) == (0, "imuarray: warning: a gap in time\n")


def test_warnings_are_left_as_they_were(calls):
    main("calibrate rec.nc --out cal.nc".split())
    assert warnings.formatwarning.__module__ == "warnings"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(calls, capsys, tmp_path):
    (tmp_path / "folder").chmod(0o500)
    assert main("calibrate rec.nc --out folder/cal.nc".split()) == 2
    assert "expected a folder one may write to" in error_line(capsys)


@pytest.mark.parametrize("command", ["simulate", "calibrate", "sample"])
def test_help_has_an_example(capsys, command):
    with pytest.raises(SystemExit) as info:
        main([command, "--help"])
    assert info.value.code == 0
    assert f"example: imuarray {command}" in capsys.readouterr().out


def test_version(capsys):
    with pytest.raises(SystemExit) as info:
        main(["--version"])
    assert info.value.code == 0
    assert capsys.readouterr().out == f"imuarray {imuarray.__version__}\n"


def test_the_package_runs_as_a_module():
    run = [sys.executable, "-m", "imuarray", "calibrate", "none.nc", "--out", "cal.nc"]
    said = subprocess.run(run, capture_output=True, text=True, check=False)
    assert said.returncode == 2 and said.stderr.count("\n") == 1


def test_start_is_fast():
    """Help and refusals need neither numpy nor JAX."""
    heavy = "('numpy', 'jax', 'xarray')"
    code = f"import sys, imuarray.cli; print([m for m in {heavy} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "[]\n"
