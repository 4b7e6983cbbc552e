"""What a command costs: core seconds of all threads, seconds, peak memory; its exit status."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

# A child's peak memory counts from its parent's, at the fork: the parent is therefore a small one.
LAUNCHER = """
import json, os, sys, time
start = time.perf_counter()
child = os.spawnv(os.P_NOWAIT, sys.argv[2], sys.argv[2:])
_, status, used = os.wait4(child, 0)
seconds, cores = time.perf_counter() - start, used.ru_utime + used.ru_stime
with open(sys.argv[1], "w") as file:
    json.dump([os.waitstatus_to_exitcode(status), cores, seconds, used.ru_maxrss / 2**20], file)
"""


class Cost(NamedTuple):
    """Core seconds, seconds, GB at most; and what was printed."""

    cores: float
    seconds: float
    memory: float
    said: str


def cost(words, folder=None, environment=None) -> Cost:
    """Of ``imuarray`` with these words, in a folder; RuntimeError where its status is an error."""
    command = [str(Path(sys.executable).with_name("imuarray")), *map(str, words), "--quiet"]
    with tempfile.TemporaryDirectory() as place:
        report = Path(place, "report.json")
        launcher = [sys.executable, "-S", "-c", LAUNCHER, str(report), *command]
        said = subprocess.run(
            launcher, check=True, stdout=subprocess.PIPE, text=True, cwd=folder, env=environment
        ).stdout
        status, *used = json.loads(report.read_text(encoding="utf-8"))
    if status not in (0, 3):
        raise RuntimeError(f"{' '.join(command)}: expected exit status 0 or 3, found {status}")
    return Cost(*used, said)
