"""Simulation-based calibration: is the truth where the posterior says, as often as it says?

Positions are drawn from their prior and motion as in section IV-A of paper 2021, measurements
from both; a sampler that is right puts the truth at a uniform quantile of its posterior.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from imuarray.config import model_from
from imuarray.errors import InputError
from imuarray.estimation.newton import descend
from imuarray.geometry import Array
from imuarray.model import ArrayModel
from imuarray.motion import normal_motion
from imuarray.posterior import (
    AutoregressiveTarget,
    CompiledTarget,
    GaussianPrior,
    Likelihood,
    tuning,
)
from imuarray.posterior.diagnostics import ess
from imuarray.simulation import measure
from imuarray.streams import stream
from imuarray.studies.batches import run_batches

DRAWS = 199  # kept of each posterior, nearly independent: 200 ranks divide into 20 bins
APART = 2.0  # posterior sds by which chains start off the mode
WARMUP, SPACING = 200, 4  # NUTS: transitions to settle in, transitions between kept draws
PILOT, PILOT_ESS = 20000, 200  # transitions of PmMH at a time, until so many are effective
STARTS, GOOD = 50, 2.0  # of the search for a mode; mean square of residuals that ends it
WIDER = 1.05  # than the mode's curvature, for autoregressive proposals
LEVELS = (0.5, 0.9, 0.95)


class Setting(NamedTuple):
    """What is simulated: model, prior sd (m), motion sds (rad/s, rad/s^2, m/s^2), T, seed."""

    model: ArrayModel
    prior_sd: float
    motion_sd: tuple[float, float, float]
    samples: int
    seed: int

    @property
    def prior(self) -> GaussianPrior:
        """Of r_2 ... r_A, around the nominal ones."""
        return GaussianPrior.of(self.model.array.parameters, self.prior_sd)


def setting_from(settings: dict, samples: int) -> Setting:
    """From a configuration: noise, motion and prior of ``paper2021``."""
    paper, whole = settings["paper2021"], model_from(settings)
    array = sub_array(whole.array, settings["validation"]["triads"])
    noise = settings["noise"]
    model = ArrayModel.isotropic(
        array, noise["accelerometer_sd"], np.radians(noise["gyroscope_sd_dps"])
    )
    motion = (
        np.radians(paper["angular_rate_sd_dps"]), np.radians(paper["angular_acceleration_sd_dps2"]),
        paper["specific_force_sd"],
    )  # fmt: skip
    return Setting(model, paper["prior_sd"], motion, samples, settings["seed"])


class Replicate(NamedTuple):
    """A truth from the prior, what was measured of it, and where its posterior is."""

    truth: np.ndarray  # (P,) m
    likelihood: Likelihood
    mode: np.ndarray  # (P,)
    covariance: np.ndarray  # (P, P)
    ml: np.ndarray  # (P,) the most likely positions without a prior
    ml_sd: np.ndarray  # (P,) and what their information says of them


def sub_array(array: Array, triads: int) -> Array:
    """``triads`` of an array's IMUs, spread evenly over its list."""
    if triads >= array.accelerometers:
        return array
    chosen = np.linspace(0, array.accelerometers - 1, triads).round().astype(int)
    labels = tuple(array.labels[k] for k in chosen)
    return Array(array.positions[chosen], labels, triads, array.name, array.package)


def replicate(setting: Setting, number: int) -> Replicate:
    """Number ``number``: the same for all samplers."""
    rng = stream(setting.seed, "calibrated", setting.samples, number)
    model, prior = setting.model, setting.prior
    truth = prior.mean + prior.sd * rng.standard_normal(prior.mean.size)
    motion = normal_motion(rng, (setting.samples,), *setting.motion_sd)
    force, rate, _ = measure(model, motion, np.vstack([np.zeros(3), truth.reshape(-1, 3)]), rng)
    likelihood = Likelihood.of(model, force, rate, motion_sd=setting.motion_sd[:2])
    best = _most_likely(setting, likelihood, rng)
    plain = descend(likelihood.collapsed, best.positions)
    if not (best.converged and plain.converged):
        raise InputError(f"replicate {number}: expected a calibration that converges, found none")
    return Replicate(
        truth, likelihood, best.positions[1:].ravel(), best.covariance,
        plain.positions[1:].ravel(), np.sqrt(np.diag(plain.covariance)),
    )  # fmt: skip


def _most_likely(setting: Setting, likelihood: Likelihood, rng):
    """The mode, searched from the nominal positions and, where that ends badly, from others.

    Few triads, few samples and a wide prior have local optima: from the nominal positions alone
    the search ends in one in some 3 % of data sets of 4 triads and 5 samples with positions off
    by 3 mm. Their residuals, far beyond the noise, give them away.
    """
    prior, data = setting.prior, likelihood.collapsed
    enough = GOOD * 3 * setting.model.array.accelerometers * setting.samples
    best, start = None, prior.mean
    for _ in range(STARTS):
        found = descend(data, _positions(start), (prior.mean, np.diag(prior.sd**-2.0)))
        if best is None or found.cost[-1] < best.cost[-1]:
            best = found
        if best.cost[-1] < enough:
            break
        start = prior.mean + prior.sd * rng.standard_normal(prior.mean.size)
    return best


def levels_ml(setting: Setting, made, threads: int = 1) -> np.ndarray:
    """Quantile of each truth under a normal density around the ML estimate, (R, P)."""
    return np.array([stats.norm.cdf((one.truth - one.ml) / one.ml_sd) for one in made])


def _levels(made, draws) -> np.ndarray:
    """Quantile of each truth among draws (R, L, P), uniform between ranks, (R, P)."""
    truths = np.array([one.truth for one in made])
    return (np.sum(draws < truths[:, None], axis=1) + 0.5) / (draws.shape[1] + 1)


def _start(setting: Setting, one: Replicate, name: str, number: int) -> np.ndarray:
    rng = stream(setting.seed, "calibrated", name, "start", setting.samples, number)
    return rng.multivariate_normal(one.mode, APART**2 * one.covariance)


def levels_nuts(setting: Setting, made, threads: int = 1) -> np.ndarray:
    """The same by NUTS on the exact marginal likelihood."""
    from imuarray.model.jax64 import jnp
    from imuarray.posterior.marginal import Marginal, log_marginal
    from imuarray.posterior.nuts import run_many

    prior = setting.prior
    first = Marginal.of(made[0].likelihood, _positions(made[0].mode))
    count = round(len(first.nodes) ** (1 / 3))
    marginals = [Marginal.of(m.likelihood, _positions(m.mode), count) for m in made]
    nodes, weights = marginals[0].nodes, marginals[0].log_weights

    def log_density(theta, data):
        positions = jnp.concatenate([jnp.zeros((1, 3)), theta.reshape(-1, 3)])
        off = (theta - prior.mean) / prior.sd
        return log_marginal(positions, data, nodes, weights) - 0.5 * jnp.sum(off**2)

    starts = [_start(setting, one, "nuts", k) for k, one in enumerate(made)]
    keys = stream(setting.seed, "calibrated", "nuts", setting.samples).integers(
        2**31, size=len(made)
    )
    draws = run_many(
        log_density, [m.data for m in marginals], [m.mode for m in made],
        [np.linalg.cholesky(m.covariance) for m in made], starts, WARMUP, DRAWS * SPACING, keys,
        threads,
    )  # fmt: skip
    return _levels(made, draws[:, SPACING - 1 :: SPACING])


def _positions(theta) -> np.ndarray:
    return np.vstack([np.zeros(3), theta.reshape(-1, 3)])


def _walk(setting: Setting, pilot: Replicate, rng):
    """The paper's: (target of a replicate, step), N and sigma_q chosen as in section III-C.

    But N at the mode: here the prior's mean is as far off as the prior says, not a thirtieth of it.
    """
    counts = [1, 2, 5, 10, 20, 50, 100]
    variances = tuning.variance_sweep(pilot.likelihood, _positions(pilot.mode), counts, 200, rng)
    draws = tuning.choose_draws(counts, variances)

    def target(one):
        return CompiledTarget(one.likelihood, setting.prior, draws)

    steps = np.sqrt(np.diag(pilot.covariance)).mean() * np.geomspace(1e-3, 3.0, 12)
    rates = tuning.acceptance_sweep(target(pilot), pilot.mode, steps, 1000, rng)
    return target, tuning.choose_step(steps, rates)


def _autoregressive(setting: Setting, pilot: Replicate, rng):
    """The same likelihood, N = 1 drawn around each mode, proposals of the posterior's shape."""

    def target(one):
        centred = one.likelihood.centred(_positions(one.mode))
        factor = WIDER * np.linalg.cholesky(one.covariance)
        return AutoregressiveTarget(centred, setting.prior, 1, one.mode, factor)

    lengths = np.geomspace(0.05, 0.99, 10)
    rates = tuning.acceptance_sweep(target(pilot), pilot.mode, lengths, 1000, rng)
    return target, float(lengths[np.argmax(rates * lengths**2)])


def levels_pmmh(
    setting: Setting, made, threads: int = 1, kernel: Callable = _walk, name: str = "walk"
) -> np.ndarray:
    """The same by PmMH: step and thinning from a pilot data set of its own."""
    rng = stream(setting.seed, "calibrated", name, "pilot", setting.samples)
    pilot = replicate(setting, 2**40)
    make, step = kernel(setting, pilot, rng)
    thin = _thinning(make(pilot), pilot.mode, step, rng)

    def chain(job):
        number, one = job
        target = make(one)
        own = stream(setting.seed, "calibrated", name, setting.samples, number)
        theta = _start(setting, one, name, number)
        value = target.log_target(theta, own)
        _, value = target.transitions(theta, value, step, DRAWS * thin // 4, own)
        out = np.empty((DRAWS, theta.size))
        for row in out:
            _, value = target.transitions(theta, value, step, thin, own)
            row[:] = theta
        return out

    draws = run_batches(chain, list(enumerate(made)), threads, True, name)
    return _levels(made, np.array(draws))


def levels_autoregressive(setting: Setting, made, threads: int = 1) -> np.ndarray:
    """The same by PmMH with autoregressive proposals."""
    return levels_pmmh(setting, made, threads, _autoregressive, "autoregressive")


def _thinning(target, start, step, rng) -> int:
    """Transitions after which a chain has nearly forgotten, for the slowest parameter."""
    theta = start.copy()
    value = target.log_target(theta, rng)
    blocks, effective = [], 0.0
    while effective < PILOT_ESS and len(blocks) < 500:
        kept = np.empty((PILOT // 20, theta.size))
        for row in kept:
            _, value = target.transitions(theta, value, step, 20, rng)
            row[:] = theta
        blocks.append(kept)
        if len(blocks) in (1, 2, 5, 10, 20, 50, 100, 200, 500):
            effective = ess(np.concatenate(blocks)[None]).min()
    return max(1, int(np.ceil(2 * PILOT * len(blocks) / effective)))


METHODS = {
    "ML": levels_ml,
    "PmMH": levels_pmmh,
    "PmMH, autoregressive": levels_autoregressive,
    "NUTS": levels_nuts,
}


def calibrated(setting: Setting, replicates: int, threads: int = 1, methods=METHODS):
    """A row for each method, replicate and parameter; ``level`` is uniform if all is right."""
    made = run_batches(
        lambda number: replicate(setting, number), range(replicates), threads, True, "replicates"
    )
    frames = []
    for name in methods:
        levels = METHODS[name](setting, made, threads)
        rows, columns = np.indices(levels.shape)
        frames.append(
            pd.DataFrame(
                {"method": name, "samples": setting.samples, "replicate": rows.ravel(),
                 "parameter": columns.ravel(), "level": levels.ravel()}
            )
        )  # fmt: skip
    return pd.concat(frames, ignore_index=True)


def coverage(levels: pd.DataFrame) -> pd.DataFrame:
    """How often central intervals hold the truth, and whether levels are uniform.

    A row for each method and T: ``covered_50`` and so on with standard errors over replicates
    (parameters of one replicate are not independent); ``shift_z`` and ``width_z``, the mean
    normal score and the mean squared one less 1, over all parameters of a replicate, in standard
    errors; and ``p``, the smallest Kolmogorov-Smirnov p-value of a parameter times their number.
    """
    rows = []
    for (method, samples), part in levels.groupby(["method", "samples"], sort=False):
        grid = part.pivot(index="replicate", columns="parameter", values="level").to_numpy()
        row = {"method": method, "samples": samples, "replicates": len(grid)}
        for share in LEVELS:
            inside = (np.abs(grid - 0.5) < share / 2).mean(axis=1)
            row[f"covered_{100 * share:.0f}"] = inside.mean()
            row[f"se_{100 * share:.0f}"] = inside.std(ddof=1) / np.sqrt(len(grid))
        scores = stats.norm.ppf(grid)
        for name, each in (("shift", scores), ("width", scores**2 - 1)):
            # parameters of a replicate are not independent: replicates are
            row[f"{name}_z"] = _mean_z(each)
        smallest = min(stats.kstest(column, "uniform").pvalue for column in grid.T)
        rows.append({**row, "p": min(1.0, smallest * grid.shape[1])})
    return pd.DataFrame(rows)


def _mean_z(scores) -> float:
    """Mean of (R, P) over its standard error from the means of the replicates."""
    means = scores.mean(axis=1)
    return float(means.mean() / (means.std(ddof=1) / np.sqrt(len(means))))
