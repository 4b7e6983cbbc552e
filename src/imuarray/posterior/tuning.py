"""Tuning as in section III-C of paper 2021: first N, then sigma_q."""

from __future__ import annotations

import numpy as np

from imuarray.posterior.likelihood import Likelihood
from imuarray.posterior.target import Target


def variance_sweep(likelihood: Likelihood, positions, draws, count: int, rng) -> np.ndarray:
    """Variance of log p-hat at ``positions`` for each N in ``draws`` (figure 2), (len(draws),)."""
    return np.array([likelihood.realisations(positions, n, count, rng).var(ddof=1) for n in draws])


def choose_draws(draws, variances, target: float = 0.1) -> int:
    """The smallest N whose variance is at most ``target``, by the law variance = c / N.

    c is the geometric mean of N x variance where the variance is below one, the regime
    in which the law holds (everywhere if it is nowhere).
    """
    draws, variances = np.asarray(draws, float), np.asarray(variances, float)
    regime = variances < 1.0 if np.any(variances < 1.0) else variances > 0
    scale = np.exp(np.mean(np.log(draws[regime] * variances[regime])))
    return max(1, int(np.ceil(scale / target)))


def acceptance(target: Target, start, step: float, count: int, rng) -> float:
    """Share of accepted proposals over ``count`` transitions, after as many to settle."""
    theta = np.array(start, float)
    value = target.log_target(theta, rng)
    _, value = target.transitions(theta, value, step, count, rng)
    accepted, _ = target.transitions(theta, value, step, count, rng)
    return accepted / count


def acceptance_sweep(target: Target, start, steps, count: int, rng) -> np.ndarray:
    """`acceptance` for each sigma_q in ``steps`` (metres), (len(steps),)."""
    return np.array([acceptance(target, start, step, count, rng) for step in steps])


def choose_step(steps, rates, target: float = 0.18) -> float:
    """sigma_q at which the acceptance crosses ``target``, by interpolation in log sigma_q."""
    order = np.argsort(steps)
    logs, rates = np.log(np.asarray(steps, float)[order]), np.asarray(rates, float)[order]
    falling = np.minimum.accumulate(rates)
    return float(np.exp(np.interp(-target, -falling, logs)))
