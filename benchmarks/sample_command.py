"""`imuarray sample` as a whole: seconds, memory and effective draws over the samples.

`python benchmarks/sample_command.py [--samples 500 5000 50000] [--model papers] [--out FILE]`.
Data of section IV-A of paper 2021, 32 triads. Each command runs twice, in a process of its own; the
second time is taken, compiled code at hand. Core seconds are those of all threads, start-up
included.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from written import publish

from imuarray.config import read_config
from imuarray.recording import write_recording
from imuarray.studies.bayes import simulate_dataset

HEAD = (
    "| T | sampler | core seconds | s | MB | ESS | R-hat | Pareto's k |\n"
    "|---|---|---|---|---|---|---|---|"
)


def run(recording: Path, model: str) -> tuple[dict, float, float, float]:
    """(what the command says, core seconds, seconds, MB at most) of one run."""
    command = [sys.executable, "-m", "imuarray.cli", "sample", recording, "--model", model]
    command += ["--json", "--quiet", "--out", recording.with_suffix(".posterior.nc")]
    start = time.perf_counter()
    with subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE) as process:
        said = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    seconds = time.perf_counter() - start
    if process.returncode not in (0, 3):
        raise SystemExit(f"imuarray sample: exit status {process.returncode}")
    return json.loads(said), usage.ru_utime + usage.ru_stime, seconds, usage.ru_maxrss / 1024


def row(folder: Path, config, samples: int, model: str, runs: int) -> str:
    """A line of the table."""
    recording = folder / f"{samples}.nc"
    write_recording(simulate_dataset(config, samples)[0], recording)
    said, cores, seconds, memory = [run(recording, model) for _ in range(runs)][-1]
    k = said.get("pareto_k")
    return (
        f"| {samples} | {said['sampler']} | {cores:.0f} | {seconds:.0f} | {memory:.0f}"
        f" | {said['ess_min']:.0f} | {said['rhat_max']:.3f} | {'' if k is None else f'{k:.2f}'} |"
    )


def main():
    """Run all, print, and write where --out says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, nargs="+", default=[500, 5000, 50_000])
    parser.add_argument("--model", default="papers")
    parser.add_argument("--runs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("results/sample_command.md"))
    parser.add_argument("--config", type=Path, default=Path("config.yaml"))
    arguments = parser.parse_args()
    config, lines = read_config(arguments.config), [HEAD]
    with tempfile.TemporaryDirectory() as folder:
        for samples in arguments.samples:
            lines.append(row(Path(folder), config, samples, arguments.model, arguments.runs))
            print(lines[-1], flush=True)
    publish("\n".join(lines) + "\n", arguments.out)


if __name__ == "__main__":
    main()
