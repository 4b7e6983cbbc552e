"""What `calibrate` and `diagnose` cost as recordings get longer and boards larger.

`python -m benchmarks.growth [--out results/growth.md]`, from the project's root: core seconds (user
and system) and peak memory of each command on simulated recordings, compiled code cached, with the
growth's exponent between the two largest sizes. Other jobs change core seconds little.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr

from benchmarks.written import publish
from imuarray.blind.cases import Case, make
from imuarray.recording import write_recording

RATE = 125.0  # Hz
DURATIONS, IMUS = (24.0, 48.0, 96.0), (8, 16, 32)
COMMANDS = {
    "calibrate": ("calibrate", "{recording}", "--out", "{out}/cal.nc"),
    "diagnose": ("diagnose", "{recording}", "--out", "{out}/diagnosis"),
}


def cost(words, recording: Path, folder: Path, times: int = 2) -> tuple[float, float]:
    """(core seconds, peak memory in GB) of a command's last run of ``times``."""
    words = [word.format(recording=recording, out=folder) for word in words]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    for _ in range(times):
        job = subprocess.Popen(
            [Path(sys.executable).with_name("imuarray"), *words, "--quiet"], env=environment
        )
        _, status, used = os.wait4(job.pid, 0)
        job.returncode = os.waitstatus_to_exitcode(status)
        if job.returncode not in (0, 3):
            raise RuntimeError(f"{words[0]}: expected exit status 0 or 3, found {job.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 2**20


def simulated(folder: Path, imus: int, duration: float) -> Path:
    """A board of 8 or 32 IMUs, one gyroscope of them scaled."""
    case = Case(
        "growth", (("gyroscope_scale", (2,)),), 20.0, kind="one", imus=imus, duration=duration
    )
    path = folder / f"{imus}_{duration:g}.nc"
    write_recording(make(case, 5)[0], path)
    return path


def smaller(path: Path, imus: int) -> Path:
    """The same recording of its first IMUs."""
    made = path.with_name(f"first_{imus}.nc")
    with xr.open_dataset(path) as whole:
        part = slice(imus)
        whole.isel(accelerometer=part, gyroscope=part).to_netcdf(made)
    return made


def rows(folder: Path):
    """A line of the table for each command and kind of growth."""
    longer = [simulated(folder, 8, duration) for duration in DURATIONS]
    largest = simulated(folder, IMUS[-1], DURATIONS[0])
    larger = [*(smaller(largest, imus) for imus in IMUS[:-1]), largest]
    for name in COMMANDS:
        samples = [round(duration * RATE) for duration in DURATIONS]
        for what, sizes, paths in (("samples", samples, longer), ("IMUs", IMUS, larger)):
            seconds, memory = zip(
                *(cost(COMMANDS[name], path, folder) for path in paths), strict=True
            )
            exponent = np.log(seconds[-1] / seconds[-2]) / np.log(sizes[-1] / sizes[-2])
            listed = ", ".join(
                f"{n}: {s:.1f} s, {m:.2f} GB"
                for n, s, m in zip(sizes, seconds, memory, strict=True)
            )
            yield f"| {name}, growth in {what} | {listed} | {exponent:.2f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/growth.md"))
    out = parser.parse_args().out
    lines = ["| what | core seconds, peak memory | last exponent |", "|---|---|---|"]
    with tempfile.TemporaryDirectory() as folder:
        publish("\n".join([*lines, *rows(Path(folder))]) + "\n", out)


if __name__ == "__main__":
    main()
