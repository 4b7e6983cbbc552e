"""Samplers of the positions' posterior side by side: effective draws per core second.

`python benchmarks/samplers.py [--samples 5 50 500] [--seconds 60] [--out results/samplers.md]`.
Every sampler runs twice on the same data of section IV-A of paper 2021: PmMH's walks and NUTS from
starts spread over the prior, emcee's walkers around the mode, whose search is not counted; NUTS 300
+ 1000 draws, the others for a budget of core seconds. ESS is the smallest over all parameters,
bulk, after the burn-in that the chains themselves show; emcee's by its own autocorrelation time, as
its walkers are not independent, and R-hat between two ensembles.
Core seconds are those of all threads.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import emcee
import numpy as np
from samplers_figure import CONVERGED, statistics
from written import publish

from imuarray.engine.parameters import model_of
from imuarray.geometry import positions_of
from imuarray.posterior.diagnostics import ess, find_burn_in, rhat
from imuarray.posterior.prior import GaussianPrior
from imuarray.provenance import write_csv
from imuarray_papers import reference
from imuarray_papers.config import read_config
from imuarray_papers.posterior import tuning
from imuarray_papers.posterior.pmmh import run_chains
from imuarray_papers.sampling import flat
from imuarray_papers.studies.bayes import simulate_dataset

WIDENING = 1.005  # of the draws of omega beyond the integrand's curvature
PAPER_CORE_SECONDS = 320 * 3600.0  # 8 hours on 40 cores, T = 500
ENOUGH = 1000
KEPT = 10_000  # draws of a chain


@dataclass
class Row:
    """One sampler on one data set."""

    method: str
    samples: int
    ess: float
    rhat: float
    core_seconds: float
    setup: float  # core seconds of choosing N, steps and the like; of a compilation
    draws: np.ndarray

    @property
    def rate(self) -> float:
        """Effective draws per core second."""
        return self.ess / self.core_seconds


class Problem:
    """A recording of T samples with all that the samplers start from."""

    def __init__(self, config, samples):
        self.samples = samples
        self.recording, _ = simulate_dataset(config, samples)
        self.model = model_of(self.recording)
        found = flat(self.recording)
        self.log_density, self.likelihood = found.exact(), found.likelihood
        _, _, self.prior, self.mode, self.covariance, *_ = found.posterior
        self.factor = np.linalg.cholesky(self.covariance)

    def starts(self, rng, apart=None):
        """Two starts spread over the prior, or ``apart`` posterior sds around the mode."""
        normals = rng.standard_normal((2, self.mode.size))
        if apart is None:
            return self.prior.mean + self.prior.sd * normals
        return self.mode + apart * normals @ self.factor.T

    @property
    def centre(self):
        """The mode as positions (A, 3)."""
        return positions_of(self.mode)


def timed(function):
    """(result, core seconds of all threads)."""
    start = time.process_time()
    result = function()
    return result, time.process_time() - start


def judged(name, problem, chains, seconds, setup) -> Row:
    """A row from chains, burn-in left out."""
    burn_in = find_burn_in(chains.draws, chains.log_target)[0]
    left = chains.draws[:, burn_in:]
    return Row(name, problem.samples, ess(left).min(), rhat(left).max(), seconds, setup, left)


def compiled(problem, name, tuned, starts, seconds) -> Row:
    """PmMH for about so many core seconds; ``tuned()`` gives (what is said of it, target, step)."""
    (said, target, step), setup = timed(tuned)
    theta, rng = starts[0].copy(), np.random.default_rng(1)
    value = target.log_target(theta, rng)
    target.transitions(theta, value, step, 10, rng)
    _, cost = timed(lambda: target.transitions(theta, value, step, 200, rng))
    transitions = seconds / 2 / (cost / 200)
    draws = int(np.clip(transitions, 200, KEPT))
    thin = max(1, int(transitions / draws))
    chains, spent = timed(
        lambda: run_chains(target, starts, step, draws, thin, 1, ("bench", name), quiet=True)
    )
    return judged(f"{name}{said}", problem, chains, spent, setup)


def pmmh_rows(problem, seconds, rng):
    """The paper's walk, then one improvement after the other."""
    prior = GaussianPrior.of(problem.prior.mean, problem.prior.sd)

    def walk(likelihood):
        sweeps = tuning.Sweeps(problem.prior.sd[0] * np.geomspace(1e-6, 0.3, 16))
        found = tuning.tune(
            likelihood, prior, problem.centre, lambda _: problem.mode, sweeps, lambda _: rng,
            may_centre=False,
        )  # fmt: skip
        return f", N = {found.target.draws}", found.target, found.step

    spread = problem.starts(rng)
    yield compiled(
        problem, "PmMH, isotropic walk (27)", lambda: walk(problem.likelihood), spread, seconds
    )
    centred = problem.likelihood.centred(problem.centre, WIDENING)
    name = "the same, omega drawn around each mode"
    yield compiled(problem, name, lambda: walk(centred), spread, seconds)


def nuts_row(problem, rng) -> Row:
    """NUTS on the exact marginal likelihood, warm-up and compilation included."""
    from imuarray.posterior.nuts import run_nuts

    chains, spent = timed(
        lambda: run_nuts(
            problem.log_density, problem.mode, problem.covariance, problem.starts(rng), 300, 1000,
            1, quiet=True,
        )
    )  # fmt: skip
    return judged("NUTS, exact marginal, compilation included", problem, chains, spent, 0.0)


def emcee_row(problem, seconds, rng) -> Row:
    """A peer: emcee's stretch moves on the exact marginal, 4 walkers a dimension, two ensembles."""
    from imuarray.model.jax64 import jax

    size = problem.mode.size
    density = jax.jit(jax.vmap(lambda theta: problem.log_density(theta)))
    count = 4 * size
    density(np.tile(problem.mode, (count // 2, 1)))
    made, spent = timed(
        lambda: [_ensemble(problem, density, count, seconds / 2, rng) for _ in "ab"]
    )
    steps = min(len(one) for one in made)
    kept = [one[steps // 4 : steps] for one in made]
    times = [emcee.autocorr.integrated_time(one, tol=0) for one in kept]
    effective = sum(
        (one.shape[0] * count / time).min() for one, time in zip(kept, times, strict=True)
    )
    draws = np.stack([one.reshape(-1, size) for one in kept])  # in the order of time
    few = draws[:, :: max(1, draws.shape[1] // KEPT)]
    return Row(
        "emcee's stretch moves, exact marginal", problem.samples, effective, rhat(few).max(), spent,
        0.0, draws,
    )  # fmt: skip


def _ensemble(problem, density, count, seconds, rng):
    """Draws (steps, walkers, parameters) for a budget of core seconds."""
    size, first = problem.mode.size, time.process_time()
    state = problem.mode + rng.standard_normal((count, size)) @ problem.factor.T
    sampler = emcee.EnsembleSampler(count, size, lambda p: np.asarray(density(p)), vectorize=True)
    while time.process_time() - first < seconds:
        state = sampler.run_mcmc(state, 20, skip_initial_state_check=True)
    return sampler.get_chain()


def rows_of(problem, seconds, rng):
    """All samplers, one after the other."""
    yield from pmmh_rows(problem, seconds, rng)
    yield nuts_row(problem, rng)
    yield emcee_row(problem, seconds, rng)


def direct_ratio(problem, rng) -> float:
    """How much slower (26a) is evaluated directly, in 3 A dimensions a sample, N = 20."""
    draws, noise = 20, problem.model.noise
    force, rate = problem.recording.specific_force, problem.recording.angular_rate

    def direct():
        rates = reference.draw_rates(rate, np.sqrt(noise.gyroscope[0, 0]), draws, rng)
        reference.log_likelihood(force, problem.centre, noise.accelerometer, rates)

    def fast():
        problem.likelihood.estimate(problem.centre, draws, rng)

    times = []
    for function in (direct, fast):
        function()
        times.append(min(timed(function)[1] for _ in range(3)))
    return times[0] / max(times[1], 1e-9)


def table(rows, ratios) -> str:
    """Markdown: a line for each sampler and T."""
    lines = [
        "| T | sampler | R-hat | core seconds of tuning | ESS per core second "
        "| core seconds to ESS 1000 | against the paper's walk, evaluated directly "
        "| against 320 core hours, had they bought ESS 1000 |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        first = next(r for r in rows if r.samples == row.samples)
        start = f"| {row.samples} | {row.method} | {row.rhat:.3f} | {row.setup:.2g}"
        if row.rhat > CONVERGED:  # an effective size means nothing there
            lines.append(f"{start} | not converged | | | |")
            continue
        hours = PAPER_CORE_SECONDS / (ENOUGH / row.rate) if row.samples == 500 else None
        direct = row.rate / (first.rate / ratios[row.samples])
        against = f"{direct:.3g}" if first.rhat <= CONVERGED else ""
        lines.append(
            f"{start} | {row.rate:.3g} | {ENOUGH / row.rate:.3g} | {against}"
            f" | {'' if hours is None else f'{hours:.0e}'} |"
        )
    return "\n".join(lines) + "\n"


def agreement(rows) -> str:
    """Largest departure of each sampler's means and sds from NUTS', in posterior sds."""
    lines = []
    for samples in sorted({row.samples for row in rows}):
        same = [row for row in rows if row.samples == samples]
        reference = next((row for row in same if row.method.startswith("NUTS")), same[-1])
        flat = reference.draws.reshape(-1, reference.draws.shape[-1])
        mean, sd = flat.mean(axis=0), flat.std(axis=0)
        for row in same:
            other = row.draws.reshape(-1, flat.shape[1])
            apart = np.abs((other.mean(axis=0) - mean) / sd).max()
            ratio = np.abs(other.std(axis=0) / sd - 1).max()
            lines.append(f"T = {samples}, {row.method}: means within {apart:.2f} sd, sds within"
                         f" {100 * ratio:.0f} %")  # fmt: skip
    return "\n".join(lines) + "\n"


def main():
    """Run all and print; write where --out says, and beside it the table of the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, nargs="+", default=[5, 50, 500])
    parser.add_argument("--seconds", type=float, default=60.0, help="core seconds of a PmMH row")
    parser.add_argument("--out", type=Path, default=Path("results/samplers.md"))
    parser.add_argument("--config", type=Path, default=Path("config.yaml"))
    arguments = parser.parse_args()
    config, rows, ratios = read_config(arguments.config), [], {}
    for samples in arguments.samples:
        rng = np.random.default_rng(samples)
        problem = Problem(config, samples)
        ratios[samples] = direct_ratio(problem, rng)
        for row in rows_of(problem, arguments.seconds, rng):
            rows.append(row)
            spent = f"ESS {row.ess:.0f} in {row.core_seconds:.1f} s"
            print(samples, row.method, spent, flush=True)
    text = table(rows, ratios) + "\n" + agreement(rows)
    publish(text, arguments.out)
    write_csv(statistics(rows), arguments.out.with_suffix(".csv"))


if __name__ == "__main__":
    main()
