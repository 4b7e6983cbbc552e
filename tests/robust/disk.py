"""A full disk and a read-only folder: `python -m tests.robust.disk` (root, for the mounts).

Commands and the quick pipeline write to small file systems: each has to say so in one line, leave
nothing half-written, and, given room, end with the results of an undisturbed run.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.robust.kill import fresh, started
from tests.trees import differences

SIZES = 4, 40, 400, 4000  # kB that commands get
ROOM = 200, 1000, 3000  # kB that the pipeline gets, before it gets enough
COMMANDS = (
    "simulate --out {out}",
    "calibrate {recording} --model papers --out {out}",
    "sample {recording} --steps 2000 --out {out}",
    "select {recording} --out {out}",
    "board {recording} --out {folder}/answer",
    "diagnose {recording} --out {folder}/diagnosis",
)


@contextmanager
def mounted(folder: Path, kilobytes: int) -> Iterator[None]:
    """A file system of that size at ``folder``."""
    folder.mkdir(exist_ok=True)
    subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", folder], check=True
    )
    try:
        yield
    finally:
        subprocess.run(["umount", folder], check=True)


def remount(folder: Path, options: str) -> None:
    """With other options, such as a size, or ``ro``."""
    subprocess.run(["mount", "-o", f"remount,{options}", folder], check=True)


def imuarray(line: str) -> subprocess.CompletedProcess:
    """The console script."""
    call = [sys.executable, "-m", "imuarray.cli", *line.split(), "--quiet"]
    return subprocess.run(call, capture_output=True, text=True, check=False)


def commands(folder: Path, names: dict[str, Path]) -> list[str]:
    """What is wrong with commands that write to a small or a read-only ``folder``."""
    wrong = []
    for size in (*SIZES, 0):
        for command in COMMANDS:
            with mounted(folder, size or 1000):
                if not size:
                    remount(folder, "ro")
                run = imuarray(command.format(folder=folder, out=folder / "out.nc", **names))
                # a chain's checkpoint is whole, and what a second try goes on with
                left = sorted(p.name for p in folder.iterdir() if p.suffix != ".npz")
            said = run.stderr.splitlines()
            refused = run.returncode == 2 and len(said) == 1 and not left
            written = len(said) == {0: 0, 3: 1}.get(run.returncode)  # 3: not to be trusted
            allowed = written and size >= SIZES[2]
            state = f"{command.split()[0]} on {size or 'read-only'}: {run.returncode}"
            print(state, *said, flush=True)
            if not (refused or allowed):
                wrong.append(f"{state}, left {left}, said {len(said)} lines")
    return wrong


def pipeline(where: Path) -> list[str]:
    """What is wrong with the quick pipeline on a disk that is full, read-only, large enough."""
    undisturbed, here = fresh("undisturbed", where), fresh("disturbed", where)
    if started(undisturbed, "quick").wait() != 0:
        raise SystemExit((undisturbed / "log.txt").read_text(encoding="utf-8")[-2000:])
    wrong, results = [], here / "results"
    with mounted(results, ROOM[0]):
        for options in (*(f"size={size}k" for size in ROOM), "ro"):
            remount(results, options)
            log = here / "log.txt"
            log.write_text("")
            status = started(here, "quick").wait()
            said = log.read_text(encoding="utf-8")
            words = "found one that is read-only" if options == "ro" else "No space left on device"
            named = [line for line in said.splitlines() if words in line]
            print(f"quick, {options}: {status}", *named[:1], flush=True)
            if status == 0 or not named or "Traceback" in said:
                wrong.append(f"quick, {options}: status {status}, said\n{said[-3000:]}")
            wrong += [
                name
                for name in differences(undisturbed / "results", results)
                if "only in" not in name
            ]
        remount(results, "rw,size=1g")
        if started(here, "quick").wait() != 0:
            wrong.append("quick with room again: did not end")
        wrong += differences(undisturbed / "results", results)
    return wrong


def main() -> None:
    """Print what each said; exit status 1 where something is wrong."""
    with tempfile.TemporaryDirectory() as temporary:
        where = Path(temporary)
        config, recording = fresh("given", where) / "config.yaml", where / "rec.nc"
        text = config.read_text(encoding="utf-8")
        config.write_text(text.replace("duration: 100.0", "duration: 5.0"), encoding="utf-8")
        if imuarray(f"simulate --out {recording}").returncode:
            raise SystemExit("disk: expected a recording to try with, found none")
        names = {"config": config, "recording": recording}
        wrong = commands(where / "small", names) + pipeline(where)
    print(f"{len(wrong)} wrong", *wrong, sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
