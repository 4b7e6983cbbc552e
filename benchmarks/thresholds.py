"""Critical values of a diagnosis: the whole procedure on clean recordings.

    python benchmarks/thresholds.py --count 400 --out clean.csv

One row a recording: what was named, whether `unexplained`, the smallest log p of the effects'
tests on the papers' model and of the checks at the end. The summary says how often each would pass
the thresholds in src/imuarray/diagnosis/settings.py, and what the smallest of so many
recordings reached: a threshold below that of most tests, by a margin, keeps all of them together
under 5 % false alarms.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import beta

from imuarray.diagnosis.adoption import proposals
from imuarray.diagnosis.procedure import run_procedure
from imuarray.diagnosis.settings import SETTINGS
from imuarray_papers.blind.cases import Case, make


def one(seed: int) -> dict:
    """The procedure on a clean recording; every fourth has rails."""
    recording, _ = make(Case(f"threshold-{seed}", rails=seed % 4 == 3), seed)
    found = run_procedure(recording)
    named = [c.effect for c in (*found.reading_faults, *found.search.causes, *found.in_noise)]
    row = {"seed": seed, "named": " ".join(named), "unexplained": found.unexplained}
    if not found.search.causes:
        tests: dict[str, float] = {}
        for score in proposals(found.search):
            effect = score.candidate.effect
            tests[effect] = min(tests.get(effect, 0.0), float(score.log_p))
        row |= {f"test {name}": value for name, value in tests.items()}
    return row | {f"check {c.name}": float(c.log_p) for c in found.checks}


def limits(hits: int, count: int) -> tuple[float, float]:
    """Clopper-Pearson, 95 %."""
    low = beta.ppf(0.025, hits, count - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, count - hits) if hits < count else 1.0
    return float(low), float(high)


def summary(table: pd.DataFrame) -> str:
    """False alarms with limits, and the smallest log p of each test."""
    count = len(table)
    lines = []
    for what, hit in (("named", table.named != ""), ("unexplained", table.unexplained)):
        low, high = limits(int(hit.sum()), count)
        lines.append(f"{what}: {hit.sum()} of {count} ({100 * low:.1f} to {100 * high:.1f} %)")
    for name in table.columns[3:]:
        values = np.sort(table[name].dropna())
        limit = SETTINGS.limit(name[5:]) if name.startswith("test ") else SETTINGS.check
        beyond = int(np.sum(values < limit))
        lines.append(f"{name}: smallest {values[:3].round(1)}, beyond {limit}: {beyond}")
    return "\n".join(lines)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--first", type=int, default=0, help="seed of the first recording")
    parser.add_argument("--out", type=Path, default=Path("clean.csv"))
    arguments = parser.parse_args()
    rows = []
    for seed in range(arguments.first, arguments.first + arguments.count):
        rows.append(one(seed))
        pd.DataFrame(rows).to_csv(arguments.out, index=False)
        print(seed, rows[-1]["named"] or "-", flush=True)
    print(summary(pd.DataFrame(rows)))


if __name__ == "__main__":
    main()
