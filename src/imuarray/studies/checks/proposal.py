"""The tuning rules that paper 2021 quotes in section III-C."""

import numpy as np
from scipy.optimize import minimize
from scipy.special import ndtr

from imuarray.geometry import positions_of


def theory() -> dict:
    """Best acceptance of a random walk with exact and with noisy log density.

    Acceptance 2 Phi(-sqrt(l^2 + 2 v) / 2) for scaled step l and variance v of the log
    estimate (Sherlock et al.); jump l^2 x acceptance, cost of an estimate 1 / v.
    """

    def acceptance(step, variance):
        return 2 * ndtr(-0.5 * np.sqrt(step**2 + 2 * variance))

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


def best_acceptance(rng, size: int, repeats=4) -> dict:
    """Acceptance at the largest mean squared jump of a random walk on N(0, I), ``size`` dims."""
    found = [_best_of_walks(rng, size) for _ in range(repeats)]
    error = np.std(found, ddof=1) / np.sqrt(repeats)
    return {"acceptance": float(np.mean(found)), "se": float(error), "size": size}


def _best_of_walks(rng, size, chains=150, steps=40, points=13) -> float:
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
    return float(np.interp(best, scaled, rates))


def acceptance_against_variance(targets, theta, step, count, rng) -> list[dict]:
    """Acceptance at one step length for each target, with its variance of log p-hat at ``theta``.

    ``targets`` maps a label to a `CompiledTarget`. The error allows for accepted proposals
    coming in clusters: it is taken from 20 blocks of the run.
    """
    rows, blocks = [], 20
    for label, target in targets.items():
        state = np.array(theta)
        positions = positions_of(state)
        logs = target.likelihood.realisations(positions, target.draws, 200, rng)
        value = target.log_target(state, rng)
        _, value = target.transitions(state, value, step, count // 2, rng)
        shares = np.empty(blocks)
        for block in range(blocks):
            accepted, value = target.transitions(state, value, step, count // blocks, rng)
            shares[block] = accepted / (count // blocks)
        rows.append(
            {
                "target": label,
                "draws": target.draws,
                "log_variance": logs.var(ddof=1),
                "acceptance": shares.mean(),
                "transitions": blocks * (count // blocks),
                "acceptance_se": shares.std(ddof=1) / np.sqrt(blocks),
            }  # fmt: skip
        )
    return rows
