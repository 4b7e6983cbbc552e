"""Commands on a recording larger than memory: an hour at 1 kHz of 32 IMUs, 5.5 GB.

`python -m benchmarks.hour [--minutes 60] [--folder .]`, from the project's root: makes the
recording in a temporary folder there, part by part, and prints core seconds and peak memory of
`select`, `calibrate` of what that leaves, and `apply`; needs 13 GB of disk for an hour.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.growth import spent
from benchmarks.written import publish
from imuarray.motion.state import hand_twisting
from imuarray.provenance import stamp, write_netcdf_parts
from imuarray.recording import Recording
from imuarray.recording.record import PART
from imuarray.simulation.recordings import measure
from imuarray_papers.config import model_from, read_config

RATE = 1000.0  # Hz
COMMANDS = {
    "select": "select recording.nc --out few.nc",
    "select --samples 500": "select recording.nc --samples 500 --out some.nc",
    "calibrate": "calibrate some.nc --out cal.nc",
    "apply": "apply cal.nc recording.nc --out motion.nc",
}


def parts(samples: int, seed: int):
    """Datasets of a made-up recording, one after the other."""
    model, rng = model_from(read_config(Path("config.yaml"))), np.random.default_rng(seed)
    array, motion = model.array, hand_twisting(rng, 4.0, 5.0)
    places = array.relative + np.vstack([np.zeros(3), 1e-3 * rng.standard_normal((31, 3))])
    labels = tuple(str(number) for number in range(1, 33))
    sds = [np.sqrt(part[0, 0]) for part in (model.noise.accelerometer, model.noise.gyroscope)]
    for first in range(0, samples, PART):
        time = np.arange(first, min(first + PART, samples)) / RATE
        force, rate, _ = measure(model, motion.at(time), places, rng)
        made = Recording(
            time, force, rate, array.positions, labels, labels, *sds, np.inf, np.inf, 3e-3
        )
        yield made.to_dataset().assign_attrs(stamp({}, seed))


def rows(folder: Path, minutes: float):
    """A line of the table for each command."""
    recording, samples = folder / "recording.nc", round(60 * minutes * RATE)
    write_netcdf_parts(parts(samples, 1), samples, recording)
    size = recording.stat().st_size / 1e9
    for name, line in COMMANDS.items():
        seconds, memory = spent(line, folder)
        yield f"| `{name}` | {minutes:g} min, {size:.2g} GB | {seconds:.0f} | {memory:.2f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--folder", type=Path, default=Path())
    parser.add_argument("--out", type=Path, default=Path("results/hour.md"))
    chosen = parser.parse_args()
    lines = ["| command | recording | core seconds | peak memory, GB |", "|---|---|---|---|"]
    with tempfile.TemporaryDirectory(dir=chosen.folder) as folder:
        publish("\n".join([*lines, *rows(Path(folder), chosen.minutes)]) + "\n", chosen.out)


if __name__ == "__main__":
    main()
