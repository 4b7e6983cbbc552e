"""`imuarray sample` as a whole: seconds, memory and effective draws over the samples.

`python -m benchmarks.sample_command [--samples 500 5000 50000] [--model papers] [--out FILE]`.
Data of section IV-A of paper 2021, 32 triads. Each command runs twice, in a process of its own; the
second time is taken, compiled code at hand. Core seconds are those of all threads, start-up
included.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from benchmarks.cost import cost
from benchmarks.written import publish
from imuarray.recording import write_recording
from imuarray_papers.config import read_config
from imuarray_papers.studies.bayes import simulate_dataset

HEAD = (
    "| T | sampler | core seconds | s | GB | ESS | R-hat | Pareto's k |\n"
    "|---|---|---|---|---|---|---|---|"
)


def row(folder: Path, config, samples: int, model: str, runs: int) -> str:
    """A line of the table."""
    recording = folder / f"{samples}.nc"
    write_recording(simulate_dataset(config, samples)[0], recording)
    words = ["sample", recording, "--model", model, "--json"]
    words += ["--out", recording.with_suffix(".posterior.nc")]
    used = [cost(words) for _ in range(runs)][-1]
    said = json.loads(used.said)
    k = said.get("pareto_k")
    return (
        f"| {samples} | {said['sampler']} | {used.cores:.0f} | {used.seconds:.0f}"
        f" | {used.memory:.2f}"
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
