"""Tuning as in section III-C of paper 2021: first N, then sigma_q."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from imuarray.posterior.likelihood import Likelihood
    from imuarray.posterior.target import Target


COUNTS = (1, 2, 5, 10, 20, 50, 100)  # numbers N of draws that are tried


def _each(function, jobs, threads: int) -> np.ndarray:
    """``function`` of every job on ``threads`` threads; the kernels release the interpreter."""
    with ThreadPoolExecutor(threads) as pool:
        return np.array(list(pool.map(function, jobs)))


def variance_sweep(
    likelihood: Likelihood, positions, draws, count: int, rng, threads: int = 1
) -> np.ndarray:
    """Variance of log p-hat at ``positions`` for each N in ``draws`` (figure 2), (len(draws),).

    Each N has a stream spawned from ``rng``, so the threads do not matter.
    """

    def one(job):
        number, own = job
        return likelihood.realisations(positions, number, count, own).var(ddof=1)

    return _each(one, list(zip(draws, rng.spawn(len(draws)), strict=True)), threads)


def choose_draws(draws, variances, target: float = 0.1) -> int:
    """The smallest N whose variance is at most ``target``, by the law variance = c / N.

    c is the geometric mean of N x variance where the variance is below one, the regime
    in which the law holds (everywhere if it is nowhere).
    """
    draws, variances = np.asarray(draws, float), np.asarray(variances, float)
    regime = variances < 1.0 if np.any(variances < 1.0) else variances > 0
    scale = np.exp(np.mean(np.log(draws[regime] * variances[regime])))
    return max(1, int(np.ceil(scale / target)))


def enough_draws(likelihood: Likelihood, positions, rng, target: float = 0.1) -> int:
    """N for a variance of log p-hat of at most ``target`` at ``positions`` (A, 3) m."""
    variances = variance_sweep(likelihood, positions, COUNTS, 200, rng)
    return choose_draws(COUNTS, variances, target)


def acceptance(target: Target, start, step: float, count: int, rng) -> float:
    """Share of accepted proposals over ``count`` transitions, after as many to settle."""
    theta = np.array(start, float)
    value = target.log_target(theta, rng)
    _, value = target.transitions(theta, value, step, count, rng)
    accepted, _ = target.transitions(theta, value, step, count, rng)
    return accepted / count


def acceptance_sweep(target: Target, start, steps, count: int, rng, threads: int = 1) -> np.ndarray:
    """`acceptance` for each sigma_q in ``steps`` (metres), (len(steps),); streams as above."""

    def one(job):
        step, own = job
        return acceptance(target, start, step, count, own)

    return _each(one, list(zip(steps, rng.spawn(len(steps)), strict=True)), threads)


def choose_step(steps, rates, target: float = 0.18) -> float:
    """sigma_q at which the acceptance crosses ``target``, by interpolation in log sigma_q."""
    order = np.argsort(steps)
    logs, rates = np.log(np.asarray(steps, float)[order]), np.asarray(rates, float)[order]
    falling = np.minimum.accumulate(rates)
    return float(np.exp(np.interp(-target, -falling, logs)))
