"""Kill it anywhere: `python -m tests.robust.kill [--kills 20] [--seed 1] [--target quick]`.

Runs the quick pipeline and kills, at random instants and with `kill -9`, snakemake, one of its
jobs or all of them at once; runs it again until it ends, and compares every result with those of
an undisturbed run. Some ten minutes. Exit status 1 where a result differs.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.trees import differences

ROOT = Path(__file__).parents[2]
WAIT = (1.0, 20.0)  # seconds from the start to the kill
VICTIMS = ("snakemake", "job", "all")


def command(*arguments: str) -> list[str]:
    """snakemake as the README has it, in whatever directory."""
    return [
        sys.executable, "-m", "snakemake", "-s", str(ROOT / "Snakefile"), "--configfile",
        "config.yaml", "--cores", "2", "--quiet", "rules", "--rerun-incomplete",
        "--workflow-profile", "none", *arguments,
    ]  # fmt: skip


def started(directory: Path, *arguments: str) -> subprocess.Popen:
    """In a session of its own, so that all of it can be killed."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    with open(directory / "log.txt", "ab") as log:
        return subprocess.Popen(
            command(*arguments), cwd=directory, stdout=log, stderr=log,
            env={**os.environ, "PATH": path}, start_new_session=True,
        )  # fmt: skip


def children(pid: int) -> list[int]:
    """Processes below ``pid``, however far down (Linux)."""
    found, waiting = [], [pid]
    while waiting:
        parent = waiting.pop()
        try:
            tasks = list(Path(f"/proc/{parent}/task").iterdir())
            below = [int(n) for task in tasks for n in (task / "children").read_text().split()]
        except OSError:
            continue
        found += below
        waiting += below
    return found


def kill(process: subprocess.Popen, victim: str, rng: random.Random) -> None:
    """Snakemake alone (its jobs live on), one job alone, or all of the session."""
    jobs = children(process.pid)
    if victim == "all":
        os.killpg(process.pid, signal.SIGKILL)
    elif victim == "job" and jobs:
        _kill(rng.choice(jobs))
    else:
        _kill(process.pid)


def _kill(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        pass  # it has just ended by itself


def disturbed(directory: Path, target: str, kills: int, rng: random.Random) -> int:
    """Run ``target`` to its end, killed at most ``kills`` times; how often it was."""
    count = 0
    while True:
        subprocess.run(command("--unlock", target), cwd=directory, capture_output=True, check=False)
        process = started(directory, target)
        try:
            process.wait(rng.uniform(*WAIT) if count < kills else None)
        except subprocess.TimeoutExpired:
            victim = rng.choice(VICTIMS)
            kill(process, victim, rng)
            process.wait()
            count += 1
            print(f"killed: {victim}", flush=True)
            continue
        if process.returncode == 0:
            return count
        if count >= kills:
            raise SystemExit(f"kill: expected a run that ends, see {directory / 'log.txt'}")


def fresh(name: str, where: Path) -> Path:
    """A directory with the project's configuration."""
    directory = where / name
    directory.mkdir()
    shutil.copy(ROOT / "config.yaml", directory)
    return directory


def main() -> None:
    """Run until there were kills enough; print the count and what differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--target", default="quick")
    given = parser.parse_args()
    rng, killed, found, runs = random.Random(given.seed), 0, [], 0
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as temporary:
        undisturbed = fresh("undisturbed", Path(temporary))
        if started(undisturbed, given.target).wait() != 0:
            raise SystemExit((undisturbed / "log.txt").read_text(encoding="utf-8")[-2000:])
        while killed < given.kills:
            runs += 1
            here = fresh(f"run_{runs}", Path(temporary))
            killed += disturbed(here, given.target, given.kills - killed, rng)
            found += differences(undisturbed / "results", here / "results")
    minutes = (time.monotonic() - start) / 60
    print(f"{killed} kills in {runs} runs, {minutes:.0f} min; results that differ: {len(found)}")
    print("\n".join(found))
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
