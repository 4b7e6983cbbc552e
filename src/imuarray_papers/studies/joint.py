"""The joint test of Geweke (2004): samplers and simulation by turns must keep the prior.

Measurements are drawn given the positions, then the positions are moved given the measurements.
Were the sampler, the likelihood or the simulator wrong, or not of one model, the positions would
drift away from their prior.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from imuarray.geometry import Array, positions_of
from imuarray.model import ArrayModel
from imuarray.motion import normal_motion
from imuarray.posterior.diagnostics import ess_of_mean
from imuarray.posterior.prior import GaussianPrior
from imuarray.simulation.recordings import measure
from imuarray.streams import stream
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray_papers.posterior.target import CompiledTarget
from imuarray_papers.studies.truths import misfit

# A problem whose data hardly narrow the prior: rounds then forget one another soon.
POSITIONS = np.array(
    [[0.0, 0.0, 0.0], [0.02, 0.0, 0.003], [0.0, 0.02, 0.0], [0.015, 0.018, -0.004]]
)
ACCELEROMETER_SD, GYROSCOPE_SD = 2.0, 0.1  # m/s^2, rad/s
PRIOR_SD = 2e-3  # m
MOTION_SD = (15.0, 500.0, 20.0)  # rad/s, rad/s^2, m/s^2; the last is flat to the samplers,
# who see differences between triads only
SAMPLES, DRAWS = 2, 5
# Length, transitions a round.
STEPS = {"walk": (1.0e-3, 10), "pcn": (0.6, 5)}
STREAMS = {"pcn": "autoregressive"}  # names of random streams, where not the sampler's
LEAPS, LEAP = 2, 0.5  # NUTS: transitions a round, step length in prior sds
NODES = 5


class Round(NamedTuple):
    """A round's measurements, with the motion that made them."""

    likelihood: Likelihood
    rate: np.ndarray  # (T, 3) rad/s


def problem() -> tuple[ArrayModel, GaussianPrior]:
    """Four triads, one gyroscope."""
    array = Array(POSITIONS, ("1", "2", "3", "4"), 1, "four")
    model = ArrayModel.isotropic(array, ACCELEROMETER_SD, GYROSCOPE_SD)
    return model, GaussianPrior.of(array.parameters, PRIOR_SD)


def simulated(model: ArrayModel, theta, rng) -> Round:
    """Motion from its prior, measurements given it and theta (P,)."""
    motion = normal_motion(rng, (SAMPLES,), *MOTION_SD)
    positions = positions_of(theta)
    force, rate, _ = measure(model, motion, positions, rng)
    likelihood = Likelihood.of(model, force, rate, motion_sd=MOTION_SD[:2])
    return Round(likelihood, np.asarray(motion.angular_rate))


def started(target: CompiledTarget, theta, data: Round, rng) -> float:
    """log target at theta with draws of omega as they are, given that theta made the data.

    One of N draws a sample is the omega that did: fresh ones alone would be of another law than
    the pseudo-marginal chain's own, and the test would fail for a right sampler.
    """
    drawn = target.likelihood.data
    xx, yx, yy, zx, zy, zz = drawn.factor
    u, v, w = rng.standard_normal((3, target.draws, SAMPLES))
    rates = drawn.mean.T[:, None] + np.stack([xx * u, yx * u + yy * v, zx * u + zy * v + zz * w]).T
    rates = np.ascontiguousarray(rates)
    rates[np.arange(SAMPLES), rng.integers(target.draws, size=SAMPLES)] = data.rate
    positions = positions_of(theta)
    return target.prior.log_density(theta) + target.likelihood.on(positions, rates)


def _target(name: str, likelihood: Likelihood, model: ArrayModel, prior) -> CompiledTarget:
    """The paper's ("walk"); or with preconditioned proposals.

    Omega is then drawn around each integrand's mode, at positions that do not hang on theta.
    """
    if name == "walk":
        return CompiledTarget(likelihood, prior, DRAWS)
    centred = likelihood.centred(model.array.relative)
    return CompiledTarget(centred, prior, DRAWS, prior.mean, np.diag(prior.sd))


def pmmh_rounds(name: str, seed: int, rounds: int) -> Iterator[np.ndarray]:
    """(theta, misfit of the measurements at it) after each round of PmMH."""
    model, prior = problem()
    rng = stream(seed, "joint", STREAMS.get(name, name))
    step, count = STEPS[name]
    theta = prior.mean + prior.sd * rng.standard_normal(prior.mean.size)
    for _ in range(rounds):
        data = simulated(model, theta, rng)
        target = _target(name, data.likelihood, model, prior)
        target.transitions(theta, started(target, theta, data, rng), step, count, rng)
        yield np.append(theta, misfit(data.likelihood, theta))


def nuts_rounds(name: str, seed: int, rounds: int) -> Iterator[np.ndarray]:
    """Rounds of NUTS, its step fixed, on the exact marginal likelihood."""
    from numpyro.infer.hmc import hmc

    from imuarray.model.jax64 import jax, jnp
    from imuarray.posterior.marginal import log_marginal

    model, prior = problem()
    rng = stream(seed, "joint", name)
    theta = prior.mean + prior.sd * rng.standard_normal(prior.mean.size)
    nodes = weights = None

    @jax.jit
    def moved(z, data, key):
        def potential(z):
            positions = jnp.concatenate(
                [jnp.zeros((1, 3)), (prior.mean + prior.sd * z).reshape(-1, 3)]
            )
            return 0.5 * jnp.sum(z**2) - log_marginal(positions, data, nodes, weights)

        begin, advance = hmc(potential, algo="NUTS")
        state = begin(
            z, num_warmup=0, adapt_step_size=False, adapt_mass_matrix=False, step_size=LEAP,
            max_tree_depth=5, rng_key=jax.random.key_data(jax.random.key(key)),
        )  # fmt: skip
        return jax.lax.fori_loop(0, LEAPS, lambda _, state: advance(state), state).z

    for _ in range(rounds):
        data = simulated(model, theta, rng)
        positions = positions_of(theta)
        marginal = data.likelihood.marginal(positions, NODES)
        nodes, weights = marginal.nodes, marginal.log_weights
        z = moved((theta - prior.mean) / prior.sd, marginal.data, int(rng.integers(2**31)))
        theta = prior.mean + prior.sd * np.asarray(z)
        yield np.append(theta, misfit(data.likelihood, theta))


SAMPLERS: dict[str, tuple[str, Callable]] = {
    "walk": ("PmMH, (27)", pmmh_rounds),
    "pcn": ("PmMH, pCN, centred", pmmh_rounds),
    "nuts": ("NUTS", nuts_rounds),
}


def independent(seed: int, rounds: int) -> np.ndarray:
    """Misfits of truths and measurements drawn together, (rounds,): what those should be like."""
    model, prior = problem()
    rng = stream(seed, "joint", "independent")
    found = np.empty(rounds)
    for number in range(rounds):
        theta = prior.mean + prior.sd * rng.standard_normal(prior.mean.size)
        found[number] = misfit(simulated(model, theta, rng).likelihood, theta)
    return found


def scores_of(name: str, seed: int, rounds: int, right):
    """Scores of the means of theta, its squares and the misfit, (2 P + 1,), and effective sizes.

    In Monte Carlo standard errors; ``right`` (R,) are misfits as `independent` draws them.
    """
    _, prior = problem()
    draws = np.array(list(SAMPLERS[name][1](name, seed, rounds)))
    z = (draws[:, :-1] - prior.mean) / prior.sd
    values = np.hstack([z, z**2, draws[:, -1:]])
    size = ess_of_mean(values[None])
    expected = np.concatenate([np.zeros(z.shape[1]), np.ones(z.shape[1]), [right.mean()]])
    error = values.var(axis=0) / size
    error[-1] += right.var() / len(right)
    return (values.mean(axis=0) - expected) / np.sqrt(error), size


def joint_test(seed: int, rounds: int, names=tuple(SAMPLERS)) -> pd.DataFrame:
    """A row for each sampler: how far means and squares of theta are from the prior's, and the
    misfit of the measurements from that of independent draws of both."""
    right = independent(seed, rounds)
    rows = []
    for name in names:
        found, size = scores_of(name, seed, rounds, right)
        scores, count = np.abs(found), len(found) // 2
        rows.append(
            {"sampler": SAMPLERS[name][0], "rounds": rounds, "parameters": count,
             "ess_min": size.min(), "mean_z": scores[:count].max(),
             "square_z": scores[count:-1].max(), "misfit_z": scores[-1],
             "p": min(1.0, len(scores) * 2 * stats.norm.sf(scores.max()))}
        )  # fmt: skip
    return pd.DataFrame(rows)
