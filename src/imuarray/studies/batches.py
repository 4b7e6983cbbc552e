"""Monte Carlo realisations in batches, each with a random stream of its own."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from tqdm import tqdm

BATCH = 25  # realisations; part of the streams' definition, so results hang on it


def run_batches(function, jobs, threads: int, quiet: bool, label: str) -> list:
    """``function(job)`` for each job on ``threads`` threads, results in the jobs' order."""
    with ThreadPoolExecutor(threads) as pool:
        results = pool.map(function, jobs)
        return list(tqdm(results, total=len(jobs), disable=quiet, desc=label, mininterval=15.0))


def batches(realisations: int):
    """(number, size) of each batch."""
    full, rest = divmod(realisations, BATCH)
    return [(i, BATCH) for i in range(full)] + ([(full, rest)] if rest else [])


def share(jobs, part: int, parts: int) -> list:
    """The jobs of one of ``parts`` neighbouring shares, as even as may be."""
    jobs = list(jobs)
    ends = [len(jobs) * number // parts for number in (part, part + 1)]
    return jobs[slice(*ends)]


def root_mean_square(squares) -> tuple[float, float]:
    """RMSE and its Monte Carlo standard error from mean squared errors (realisations,)."""
    squares = np.asarray(squares, float)
    mean = squares.mean()
    error = squares.std(ddof=1) / np.sqrt(squares.size) if squares.size > 1 else np.nan
    return float(np.sqrt(mean)), float(error / (2 * np.sqrt(mean))) if mean > 0 else 0.0
