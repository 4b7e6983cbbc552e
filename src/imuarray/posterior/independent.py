"""Independence Metropolis-Hastings: every proposal is drawn from the normal density at the mode.

That is what a posterior of many samples nearly is. The tail of the importance weights tells how far
it is from it (Vehtari, Simpson, Gelman, Yao and Gabry, Pareto smoothed importance sampling, 2024).
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from imuarray.model.jax64 import jax
from imuarray.posterior.chains import Chains
from imuarray.posterior.diagnostics import ess, pareto_k, rhat
from imuarray.posterior.nuts import White, side_by_side
from imuarray.posterior.settings import SETTINGS
from imuarray.streams import stream


def run_independent(
    log_density, centre, covariance, draws: int | None, seed: int, names=("independent",),
    quiet: bool = False, data: tuple = (), threads: int = 2,
) -> tuple[Chains, float]:  # fmt: skip
    """(chains, Pareto's k of the proposals' importance weights); arguments as `run_nuts` has them.

    ``draws`` of each of four chains; None: until R-hat and ESS are `rhat` and `effective` of the
    settings, 4000 at most, fewer where that will not be or k is above `unreliable`.
    """
    white = White(np.asarray(centre), np.linalg.cholesky(covariance), data)
    with side_by_side(threads, 0, quiet) as (pool, bar):
        weigh = partial(_weights, log_density, pool, bar)
        white = centred(white, weigh, stream(seed, *names, "centre"))
        z = np.empty((SETTINGS.chains, 0, len(white.centre)))
        weights = np.empty((SETTINGS.chains, 0))
        for batch in range(SETTINGS.batches):
            rngs = [stream(seed, *names, chain, batch) for chain in range(SETTINGS.chains)]
            size = draws or SETTINGS.batch, z.shape[2]
            fresh = np.stack([rng.standard_normal(size) for rng in rngs])
            z = np.concatenate([z, fresh], axis=1)
            weighed = weigh(white, fresh.reshape(-1, z.shape[2])).reshape(SETTINGS.chains, -1)
            weights = np.concatenate([weights, weighed], axis=1)
            chains, k = _chains(white, z, weights, seed, names), pareto_k(weights)
            if draws or not k <= SETTINGS.unreliable or _settled(chains, batch + 1):
                break
    return chains, k


def _settled(chains: Chains, batches: int) -> bool:
    """True where the chains are enough, or so many as may be will hardly be."""
    size = ess(chains.draws).min()
    enough = size >= SETTINGS.effective and rhat(chains.draws).max() <= SETTINGS.rhat
    return bool(enough or size * SETTINGS.batches < SETTINGS.effective * batches)


def _chains(white: White, z, weights, seed: int, names) -> Chains:
    accept = [stream(seed, *names, chain, "accept") for chain in range(SETTINGS.chains)]
    place = walked(weights, np.log([rng.random(z.shape[1]) for rng in accept]))
    z = np.take_along_axis(z, place[..., None], axis=1)
    log_target = np.take_along_axis(weights, place, axis=1) - 0.5 * np.sum(z**2, axis=2)
    accepted = np.mean(np.diff(place, axis=1) != 0, axis=1)
    return Chains(np.asarray(white.theta(z)), log_target, accepted, 1, 1.0)


def walked(weights, thresholds) -> np.ndarray:
    """The number of the proposal accepted last, of log weights and log uniforms (chains, n)."""
    place, chains = np.zeros(weights.shape, int), np.arange(len(weights))
    for i in range(1, weights.shape[1]):
        before = place[:, i - 1]
        with np.errstate(invalid="ignore"):  # neither may have a density
            better = thresholds[:, i] < weights[:, i] - weights[chains, before]
        place[:, i] = np.where(better, i, before)
    return place


def centred(white: White, weigh: Callable, rng) -> White:
    """With the centre where log weights, ``weigh(white, z)`` (n,), have no slope left on average.

    By Stein's lemma E[z w(z)] is w's mean slope; a shift by it takes it away where the density is
    normal. Slopes within their error are left.
    """
    for _ in range(SETTINGS.rounds):
        z = rng.standard_normal((SETTINGS.pilot, len(white.centre)))
        weights = weigh(white, z)
        if not np.all(np.isfinite(weights)):
            break
        products = z * (weights - weights.mean())[:, None]
        slope, error = products.mean(axis=0), products.std(axis=0) / SETTINGS.pilot**0.5
        observed = np.abs(slope) > SETTINGS.observed * error
        if not observed.any():
            break
        white = white._replace(centre=white.centre + white.factor @ np.where(observed, slope, 0.0))
    return white


def _weights(log_density, pool, bar, white: White, z) -> np.ndarray:
    """Log density (n,) over the standard normal's at z (n, size), -inf where not a number."""
    theta = white.theta(z)
    padded = np.concatenate([theta, np.repeat(theta[:1], -len(z) % SETTINGS.block, axis=0)])
    bar.total = (bar.total or 0) + len(padded)  # as far as is known by now
    bar.refresh()
    parts = []
    for part in pool.map(
        lambda block: np.asarray(_values(log_density, block, white.data)),
        padded.reshape(-1, SETTINGS.block, z.shape[1]),
    ):
        parts.append(part)
        bar.update(SETTINGS.block)
    weights = np.concatenate(parts)[: len(z)] + 0.5 * np.sum(z**2, axis=1)
    return np.where(np.isfinite(weights), weights, -np.inf)


@partial(jax.jit, static_argnums=0)
def _values(log_density, thetas, data):
    """One after the other: the memory is that of one."""
    return jax.lax.map(lambda theta: log_density(theta, *data), thetas)
