"""Tuning of PmMH as in section III-C of paper 2021: first N, then sigma_q."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from imuarray.geometry import positions_of
from imuarray.posterior.prior import GaussianPrior
from imuarray_papers.posterior.likelihood import CompiledTarget, Likelihood


class Sweeps(NamedTuple):
    """Grids that are tried to choose N and sigma_q, and the aim."""

    steps: Sequence[float] | np.ndarray  # m, sigma_q
    draws: Sequence[int] = (1, 2, 5, 10, 20, 50, 100)  # N
    realisations: int = 200  # of log p-hat, for each N
    transitions: int = 1000  # for each sigma_q, after as many of burn-in
    variance: float = 0.1  # of log p-hat
    acceptance: float = 0.18


class Tuned(NamedTuple):
    """The walk (27) ready to run."""

    target: CompiledTarget
    step: float  # m, sigma_q
    variances: np.ndarray  # of log p-hat with omega from p(omega | y_g), for each N tried
    centred: bool  # whether omega is drawn around the integrand's mode instead


def tune(
    likelihood: Likelihood, prior: GaussianPrior, positions, mode: Callable, sweeps: Sweeps,
    rng: Callable, threads: int = 1, may_centre: bool = True,
) -> Tuned:  # fmt: skip
    """N by the variance of log p-hat, then sigma_q by the acceptance.

    Where not even the largest N brings the variance near what is aimed at, as in measured data,
    omega is drawn around the integrand's mode instead (`Likelihood.centred`).

    Parameters
    ----------
    positions : (A, 3) m, where the variance is looked at
    mode : callable, whether omega is drawn around the integrand's mode -> theta (P,) m
        Where the sweep of sigma_q starts.
    rng : callable, "variance" or "acceptance" -> numpy.random.Generator
    may_centre : bool
        False: omega from p(omega | y_g), however large the variance.
    """
    sizes = sweeps.draws, sweeps.realisations
    first = found = variance_sweep(likelihood, positions, *sizes, rng("variance"), threads)
    centred = may_centre and bool(found.min() > 2 * sweeps.variance)
    start = mode(centred)
    if centred:
        positions = positions_of(start)
        likelihood = likelihood.centred(positions)
        found = variance_sweep(likelihood, positions, *sizes, rng("variance"), threads)
    draws = choose_draws(sweeps.draws, found, sweeps.variance)
    target = CompiledTarget(likelihood, prior, draws)
    rates = acceptance_sweep(
        target, start, sweeps.steps, sweeps.transitions, rng("acceptance"), threads
    )
    return Tuned(target, choose_step(sweeps.steps, rates, sweeps.acceptance), first, centred)


def _each(function, values, rng, threads: int) -> np.ndarray:
    """``function`` of each value and a stream of its own, which ``rng`` spawns.

    So the threads do not matter; the kernels release the interpreter.
    """
    with ThreadPoolExecutor(threads) as pool:
        return np.array(list(pool.map(function, values, rng.spawn(len(values)))))


def variance_sweep(
    likelihood: Likelihood, positions, draws, count: int, rng, threads: int = 1
) -> np.ndarray:
    """Variance of log p-hat at ``positions`` for each N in ``draws`` (figure 2), (len(draws),)."""

    def one(number, own):
        return likelihood.realisations(positions, number, count, own).var(ddof=1)

    return _each(one, draws, rng, threads)


def choose_draws(draws, variances, target: float = 0.1) -> int:
    """The smallest N whose variance is at most ``target``, by the law variance = c / N.

    c is the geometric mean of N x variance where the variance is below one, the regime
    in which the law holds (everywhere if it is nowhere).
    """
    draws, variances = np.asarray(draws, float), np.asarray(variances, float)
    regime = variances < 1.0 if np.any(variances < 1.0) else variances > 0
    scale = np.exp(np.mean(np.log(draws[regime] * variances[regime])))
    return max(1, int(np.ceil(scale / target)))


def acceptance(target: CompiledTarget, start, step: float, count: int, rng) -> float:
    """Share of accepted proposals over ``count`` transitions, after as many of burn-in."""
    theta = np.array(start, float)
    value = target.log_target(theta, rng)
    _, value = target.transitions(theta, value, step, count, rng)
    accepted, _ = target.transitions(theta, value, step, count, rng)
    return accepted / count


def acceptance_sweep(
    target: CompiledTarget, start, steps, count: int, rng, threads: int = 1
) -> np.ndarray:
    """`acceptance` for each sigma_q in ``steps`` (metres), (len(steps),)."""
    return _each(lambda step, own: acceptance(target, start, step, count, own), steps, rng, threads)


def choose_step(steps, rates, target: float = 0.18) -> float:
    """sigma_q at which the acceptance crosses ``target``, by interpolation in log sigma_q."""
    order = np.argsort(steps)
    logs, rates = np.log(np.asarray(steps, float)[order]), np.asarray(rates, float)[order]
    falling = np.minimum.accumulate(rates)
    return float(np.exp(np.interp(-target, -falling, logs)))
