"""The no-U-turn sampler on a density with a gradient, whitened at its mode (numpyro's)."""

import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from imuarray.errors import InputError
from imuarray.model.jax64 import jax
from imuarray.posterior.chains import Chains
from imuarray.streams import stream

# Of a density that is nearly standard normal: the acceptance wanted of the step length, the
# doublings of a trajectory, and the first step.
WHITE = {
    "target_accept_prob": 0.8, "max_tree_depth": 8, "adapt_mass_matrix": False, "step_size": 0.5,
}  # fmt: skip


class White(NamedTuple):
    """theta = centre + factor z, and what the density of theta hangs on besides."""

    centre: np.ndarray
    factor: np.ndarray  # lower (size, size)
    data: tuple

    def theta(self, z) -> np.ndarray:
        """theta (..., size) of z (..., size)."""
        return self.centre + z @ self.factor.T

    def white(self, theta) -> np.ndarray:
        """z (..., size) of theta (..., size)."""
        away = np.asarray(theta) - self.centre
        return np.linalg.solve(self.factor, away[..., None])[..., 0]


@contextmanager
def side_by_side(threads: int, total: int, quiet: bool) -> Iterator[tuple]:
    """(pool of threads for the chains, bar that counts draws)."""
    seldom = 0.2 if sys.stderr.isatty() else 15.0
    bar = tqdm(total=total, disable=quiet, unit="draw", mininterval=seldom)
    with ThreadPoolExecutor(threads) as pool, bar:
        yield pool, bar


def _kernel(log_density, white: White):
    """numpyro's (beginning, transition) on the density of z."""
    from numpyro.infer.hmc import hmc

    return hmc(lambda z: -log_density(white.theta(z), *white.data), algo="NUTS")


@partial(jax.jit, static_argnums=(0, 1))
def _begin(log_density, warmup, white, z, key):
    return _kernel(log_density, white)[0](z, num_warmup=warmup, rng_key=key, **WHITE)


@partial(jax.jit, static_argnums=(0, 1, 2))
def _advance(log_density, warmup, block, white, state):
    """A block of transitions; compiled once for each density, whatever its data."""
    begin, advance = _kernel(log_density, white)
    begin(state.z, num_warmup=warmup, rng_key=state.rng_key, **WHITE)  # tells it the warm-up

    def one(state, _):
        state = advance(state)
        return state, (state.z, -state.potential_energy, state.accept_prob, state.diverging)

    return jax.lax.scan(one, state, None, block)


def run_nuts(
    log_density, centre, covariance, starts, warmup: int, draws: int, seed: int,
    names=("nuts",), block: int = 100, quiet: bool = False, data: tuple = (), threads: int = 2,
) -> Chains:  # fmt: skip
    """One chain from each of ``starts`` (chains, size), side by side.

    ``log_density``: a function of theta (size,) and ``data``, pytrees of arrays, traceable by JAX;
    it is compiled once for each function and shapes of data. ``centre`` (size,) and ``covariance``
    are about the density's mode and the covariance there: the sampler then sees nearly a standard
    normal density. ``warmup`` transitions, in which the step length is chosen, are not kept.
    InputError for a start where the density or its gradient is not finite.
    """
    white = White(np.asarray(centre), np.linalg.cholesky(covariance), data)
    starts = np.atleast_2d(np.asarray(starts, float))
    values = _values(log_density, starts, data)
    if not all(np.all(np.isfinite(part)) for part in values):
        raise InputError("nuts: expected a finite log density at every start, found none")
    keys = [
        jax.random.key_data(jax.random.key(int(stream(seed, *names, chain).integers(2**31))))
        for chain in range(len(starts))
    ]
    states = [
        _begin(log_density, warmup, white, z, key)
        for z, key in zip(white.white(starts), keys, strict=True)
    ]
    kept = [[] for _ in starts]
    blocks = -(-(warmup + draws) // block)
    run = partial(_advance, log_density, warmup, block, white)
    with side_by_side(threads, blocks * block, quiet) as (pool, bar):
        for _ in range(blocks):
            for chain, (state, made) in enumerate(pool.map(run, states)):
                states[chain] = state
                kept[chain].append([np.asarray(part) for part in made])
            bar.update(block)
    joined = [[np.concatenate(part) for part in zip(*blocks, strict=True)] for blocks in kept]
    cut = slice(warmup, warmup + draws)
    z, log_target, accepted, lost = (np.stack(part)[:, cut] for part in zip(*joined, strict=True))
    step = float(np.mean([state.adapt_state.step_size for state in states]))
    theta = np.asarray(white.theta(z))
    return Chains(theta, log_target, accepted.mean(axis=1), 1, step, int(lost.sum()))


@partial(jax.jit, static_argnums=0)
def _values(log_density, starts, data):
    return jax.vmap(jax.value_and_grad(lambda theta: log_density(theta, *data)))(starts)
