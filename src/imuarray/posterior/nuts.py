"""The no-U-turn sampler on a density with a gradient, whitened at its mode (numpyro's)."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from imuarray.errors import InputError
from imuarray.model.jax64 import jax, jnp
from imuarray.posterior.chains import Chains
from imuarray.streams import stream

# Of a density that is nearly standard normal: the acceptance wanted of the step length, the
# doublings of a trajectory, and the first step.
WHITE = {
    "target_accept_prob": 0.8, "max_tree_depth": 8, "adapt_mass_matrix": False, "step_size": 0.5,
}  # fmt: skip


@dataclass(frozen=True)
class Whitened:
    """theta = centre + factor z, and the density that z has."""

    log_density: object  # theta (size,) -> log density, traceable by JAX
    centre: np.ndarray
    factor: np.ndarray  # lower (size, size)

    def theta(self, z) -> np.ndarray:
        """theta (..., size) of z (..., size)."""
        return self.centre + np.asarray(z) @ self.factor.T

    def white(self, theta) -> np.ndarray:
        """z (..., size) of theta (..., size)."""
        away = np.asarray(theta) - self.centre
        return np.linalg.solve(self.factor, away[..., None])[..., 0]

    def potential(self, z):
        """Minus the log density of z."""
        return -self.log_density(jnp.asarray(self.centre) + jnp.asarray(self.factor) @ z)


def run_nuts(
    log_density, centre, covariance, starts, warmup: int, draws: int, seed: int,
    names=("nuts",), block: int = 100, quiet: bool = False,
) -> Chains:  # fmt: skip
    """One chain from each of ``starts`` (chains, size), side by side.

    Parameters
    ----------
    log_density : callable theta (size,) -> log density, traceable by JAX
    centre, covariance : (size,), (size, size)
        About the density's mode and the covariance there: what the sampler sees is then nearly
        a standard normal density.
    warmup, draws : int
        Transitions of the warm-up, in which the step length is chosen, not kept; and those kept.

    Raises
    ------
    InputError
        A start where the density or its gradient is not finite.
    """
    from numpyro.infer.hmc import hmc

    white = Whitened(log_density, np.asarray(centre), np.linalg.cholesky(covariance))
    starts = np.atleast_2d(np.asarray(starts, float))
    values = jax.jit(jax.vmap(jax.value_and_grad(log_density)))(starts)
    if not all(np.all(np.isfinite(part)) for part in values):
        raise InputError("nuts: expected a finite log density at every start, found none")
    begin, advance = hmc(white.potential, algo="NUTS")
    keys = [
        jax.random.key_data(jax.random.key(int(stream(seed, *names, chain).integers(2**31))))
        for chain in range(len(starts))
    ]

    @jax.jit
    def first(z, key):
        return begin(z, num_warmup=warmup, rng_key=key, **WHITE)

    states = [first(jnp.asarray(z), key) for z, key in zip(white.white(starts), keys, strict=True)]

    @jax.jit
    def run(state):
        def one(state, _):
            state = advance(state)
            return state, (state.z, -state.potential_energy, state.accept_prob, state.diverging)

        return jax.lax.scan(one, state, None, block)

    kept = [[] for _ in starts]
    seldom = 0.2 if sys.stderr.isatty() else 15.0
    blocks = -(-(warmup + draws) // block)
    with (
        ThreadPoolExecutor(len(starts)) as pool,
        tqdm(total=blocks * block, disable=quiet, unit="draw", mininterval=seldom) as bar,
    ):
        for _ in range(blocks):
            for chain, (state, made) in enumerate(pool.map(run, states)):
                states[chain] = state
                kept[chain].append([np.asarray(part) for part in made])
            bar.update(block)
    joined = [[np.concatenate(part) for part in zip(*blocks, strict=True)] for blocks in kept]
    cut = slice(warmup, warmup + draws)
    z, log_target, accepted, lost = (np.stack(part)[:, cut] for part in zip(*joined, strict=True))
    step = float(np.mean([state.adapt_state.step_size for state in states]))
    draws = white.theta(z)
    return Chains(draws, log_target, accepted.mean(axis=1), 1, step, int(lost.sum()))


def run_many(log_density, data, centres, factors, starts, warmup: int, draws: int, keys,
             threads: int = 1) -> np.ndarray:  # fmt: skip
    """One chain on each of many data sets of one shape, (sets, draws, size), compiled once.

    ``log_density(theta, data)``; ``data``, a list of pytrees, ``centres`` and ``starts``
    (sets, size), lower ``factors`` (sets, size, size) and ``keys``, one integer each, as
    `run_nuts` has them for one.
    """
    from numpyro.infer.hmc import hmc

    @jax.jit
    def one(data, centre, factor, z, seed):
        key = jax.random.key_data(jax.random.key(seed))
        begin, advance = hmc(lambda z: -log_density(centre + factor @ z, data), algo="NUTS")
        state = begin(z, num_warmup=warmup, rng_key=key, **WHITE)

        def step(state, _):
            state = advance(state)
            return state, state.z

        _, z = jax.lax.scan(step, state, None, warmup + draws)
        return z[warmup:] @ factor.T + centre

    whites = [
        np.linalg.solve(factor, start - centre)
        for start, centre, factor in zip(starts, centres, factors, strict=True)
    ]
    with ThreadPoolExecutor(threads) as pool:
        made = pool.map(lambda job: np.asarray(one(*job)), zip(
            data, centres, factors, whites, keys, strict=True
        ))  # fmt: skip
        return np.stack(list(made))
