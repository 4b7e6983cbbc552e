"""A second look at what `snakemake validate` finds, with other seeds and more of them.

`python benchmarks/again.py [--truths 10000] [--runs 8] [--out results/again.md]`: the mean squared
score of maximum likelihood at T = 50, and Geweke's joint test repeated: its scores should be
standard normal, and their means over runs as well.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np  # noqa: E402
from scipy import stats  # noqa: E402
from written import publish  # noqa: E402

from imuarray_papers.config import read_config  # noqa: E402
from imuarray_papers.figures.uncertainty import WHOLE  # noqa: E402
from imuarray_papers.studies.joint import independent, scores_of  # noqa: E402
from imuarray_papers.studies.sbc import pit_values  # noqa: E402
from imuarray_papers.studies.truths import setting_from  # noqa: E402

ROUNDS = 20_000
SEEDS = 31, 78  # of the joint test's first run and of the truths, not the configuration's


def width(path: Path, truths: int) -> str:
    """A row: maximum likelihood's mean squared score in the paper's setting at T = 50."""
    setting = setting_from({**read_config(path), "seed": SEEDS[1]}, "paper", 50)
    values = pit_values(setting, range(truths), methods=["ML"])
    values = values[~values.quantity.isin(WHOLE)].dropna(subset="pit")
    square = stats.norm.ppf(values.pit) ** 2
    means = values.assign(square=square).groupby("replicate").square.mean()
    error = means.std() / np.sqrt(len(means))
    what = f"maximum likelihood, T = 50, {len(means)} truths: mean squared score"
    return f"| {what} | {means.mean():.4f} ± {error:.4f} |"


def one(job) -> np.ndarray:
    """Scores of one run of the joint test."""
    name, seed = job
    return scores_of(name, seed, ROUNDS, independent(seed, ROUNDS))[0]


def repeated(pool, name: str, runs: int) -> str:
    """A row: all scores' mean square, and the largest mean over runs in its standard errors."""
    scores = np.array(list(pool.map(one, [(name, SEEDS[0] + k) for k in range(runs)])))
    pooled = np.abs(scores.mean(axis=0) * np.sqrt(runs)).max()
    what = f"joint test, {name}, {runs} runs of {ROUNDS} rounds, {scores.size} scores"
    said = "their mean square; largest mean over runs, in its standard errors"
    return f"| {what}: {said} | {np.mean(scores**2):.2f}; {pooled:.1f} |"


def main():
    """Run both and print; write where --out says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--truths", type=int, default=10_000)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--out", type=Path, default=Path("results/again.md"))
    parser.add_argument("--config", type=Path, default=Path("config.yaml"))
    given = parser.parse_args()
    lines = ["| what | found |", "|---|---|", width(given.config, given.truths)]
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        lines += [repeated(pool, name, given.runs) for name in ("walk", "pcn", "nuts")]
    publish("\n".join(lines) + "\n", given.out)


if __name__ == "__main__":
    main()
