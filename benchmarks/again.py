"""A second look at what `snakemake validate` finds, with other truths and more of them.

`python benchmarks/again.py [--truths 10000] [--out results/again.md]`: the mean squared score of
maximum likelihood at T = 50.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy import stats
from written import publish

from imuarray_papers.config import read_config
from imuarray_papers.figures.uncertainty import WHOLE
from imuarray_papers.studies.sbc import pit_values
from imuarray_papers.studies.truths import setting_from

SEED = 78  # not the configuration's


def width(path: Path, truths: int) -> str:
    """A row: maximum likelihood's mean squared score in the paper's setting at T = 50."""
    setting = setting_from({**read_config(path), "seed": SEED}, "paper", 50)
    values = pit_values(setting, range(truths), methods=["ML"])
    values = values[~values.quantity.isin(WHOLE)].dropna(subset="pit")
    square = stats.norm.ppf(values.pit) ** 2
    means = values.assign(square=square).groupby("replicate").square.mean()
    error = means.std() / np.sqrt(len(means))
    what = f"maximum likelihood, T = 50, {len(means)} truths: mean squared score"
    return f"| {what} | {means.mean():.4f} ± {error:.4f} |"


def main():
    """Print; write where --out says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--truths", type=int, default=10_000)
    parser.add_argument("--out", type=Path, default=Path("results/again.md"))
    parser.add_argument("--config", type=Path, default=Path("config.yaml"))
    given = parser.parse_args()
    lines = ["| what | found |", "|---|---|", width(given.config, given.truths)]
    publish("\n".join(lines) + "\n", given.out)


if __name__ == "__main__":
    main()
