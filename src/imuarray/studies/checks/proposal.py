"""The tuning rules that paper 2021 quotes in section III-C."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.stats import norm


def theory() -> dict:
    """Best acceptance of a random walk with exact and with noisy log density.

    Acceptance 2 Phi(-sqrt(l^2 + 2 v) / 2) for scaled step l and variance v of the log
    estimate (Sherlock et al.); jump l^2 x acceptance, cost of an estimate 1 / v.
    """

    def acceptance(step, variance):
        return 2 * norm.cdf(-0.5 * np.sqrt(step**2 + 2 * variance))

    exact = minimize(lambda x: -2 * x[0] - np.log(acceptance(np.exp(x[0]), 0.0)), [0.5],
                     method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13})  # fmt: skip
    noisy = minimize(
        lambda x: -2 * x[0] - x[1] - np.log(acceptance(np.exp(x[0]), np.exp(x[1]))), [0.5, 0.5],
        method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13},
    )  # fmt: skip
    step, variance = np.exp(noisy.x)
    return {
        "acceptance": float(acceptance(np.exp(exact.x[0]), 0.0)),
        "noisy_variance": float(variance), "noisy_acceptance": float(acceptance(step, variance)),
    }  # fmt: skip


def best_acceptance(rng, size: int, chains=400, steps=60, points=13) -> dict:
    """Acceptance at the largest mean squared jump of a random walk on N(0, I), ``size`` dims."""
    scaled = np.geomspace(0.8, 6.0, points)
    rates, jumps = [], []
    for length in scaled / np.sqrt(size):
        state = rng.standard_normal((chains, size))
        moved, jump = 0, 0.0
        for _ in range(steps):
            change = length * rng.standard_normal((chains, size))
            gain = -np.sum(change * (state + 0.5 * change), axis=1)
            taken = np.log(rng.random(chains)) < gain
            jump += np.sum(change[taken] ** 2)
            state[taken] += change[taken]
            moved += taken.sum()
        rates.append(moved / (chains * steps))
        jumps.append(jump)
    # a parabola through the top smooths the Monte Carlo noise of the maximum
    order = np.argsort(jumps)[-5:]
    fit = np.polyfit(np.log(scaled[order]), np.log(np.array(jumps)[order]), 2)
    best = np.exp(-fit[1] / (2 * fit[0]))
    return {"acceptance": float(np.interp(best, scaled, rates)), "size": size}


def acceptance_against_draws(target_of, theta, step, draws, count, rng) -> list[dict]:
    """Acceptance at one step length for each N in ``draws``; ``target_of(N)`` gives the target."""
    rows = []
    for number in draws:
        target = target_of(number)
        state = np.array(theta)
        value = target.log_target(state, rng)
        _, value = target.transitions(state, value, step, count // 2, rng)
        accepted, _ = target.transitions(state, value, step, count, rng)
        rows.append({"draws": int(number), "acceptance": accepted / count, "transitions": count})
    return rows
