"""Estimates by importance sampling for any list of effects, and a walk in plain Python: oracles."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from imuarray.model import ArrayModel
from imuarray.model.jax64 import cholesky, jax, jnp, log_determinant, solve_lower
from imuarray.posterior import generic
from imuarray.posterior.generic import Unknown
from imuarray.posterior.prior import GaussianPrior


def _log_weight(flat, x, scale, draw):
    """log p(y | omega) - log q(omega) of one draw, the linear motion integrated out."""
    rate = x[:3] + scale @ draw

    def rest(linear):
        return flat(jnp.concatenate([rate, linear]))

    value, jac = rest(x[3:]), jax.jacfwd(rest)(x[3:])
    factor = cholesky(jac.T @ jac)
    projected = solve_lower(factor, (jac.T @ value)[:, None])[:, 0]
    inside = -0.5 * (value @ value - projected @ projected) - 0.5 * log_determinant(factor)
    log_q = -0.5 * draw @ draw - jnp.sum(jnp.log(jnp.diagonal(scale)))
    return inside - log_q


@partial(jax.jit, static_argnums=(0, 1))
def _estimate(model, steps, parameters, given: Unknown, draws):
    residuals, volume = generic._whitened(model, parameters, given)

    def one(x, data, draws):
        def flat(x):
            return residuals(x, data)

        x, covariance = generic._mode(flat, x, steps)
        scale = cholesky(covariance[:3, :3])  # of omega
        weights = jax.vmap(lambda draw: _log_weight(flat, x, scale, draw))(draws)
        return jax.scipy.special.logsumexp(weights) - jnp.log(len(draws))

    return jnp.sum(jax.vmap(one)(given.start, given.readings, draws) - volume)


class GenericLikelihood:
    """log p-hat(y | theta, effect parameters): omega drawn around each sample's mode.

    The rest of the motion is integrated analytically; unbiased for models linear in it given
    omega. For the papers' model with its flat motion prior it equals (26a) in expectation, up to
    a constant.
    """

    def __init__(self, model: ArrayModel, readings, start, draws=4, steps=3, logs=None):
        self.model, self.draws, self.steps = model, draws, steps
        self.data = generic.unknown(readings, start, logs)

    def on(self, parameters, normals) -> float:
        """The estimate at p (P,) = (r_2 ... r_A, effects) on given normals (T, N, 3)."""
        return float(_estimate(self.model, self.steps, np.asarray(parameters), self.data, normals))

    def log_density(self, parameters):
        """The same by Laplace's method, without Monte Carlo noise."""
        return generic.log_laplace(self.model, parameters, self.data, self.steps)

    def __call__(self, parameters, rng) -> float:
        """The estimate with fresh draws."""
        return self.on(parameters, rng.standard_normal((len(self.data.start), self.draws, 3)))


@dataclass(frozen=True)
class GenericTarget:
    """As `CompiledTarget`, of any ``estimate(theta, rng)`` of log p-hat, a Python step at a time.

    ``scale``, (size,) or a lower factor (size, size): a step per parameter.
    """

    estimate: Callable
    prior: GaussianPrior
    scale: np.ndarray

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.prior.mean.size

    def log_target(self, theta, rng) -> float:
        """log prior + log p-hat."""
        away = theta - self.prior.mean
        root = np.diag(1.0 / self.prior.sd) if self.prior.root is None else self.prior.root
        return self.estimate(theta, rng) - 0.5 * float(np.sum((root @ away) ** 2))

    def transitions(self, theta, log_target, step, count, rng) -> tuple[int, float]:
        """`CompiledTarget.transitions` in plain Python."""
        accepted, shaped = 0, np.matmul if self.scale.ndim == 2 else np.multiply
        for _ in range(count):
            proposal = theta + step * shaped(self.scale, rng.standard_normal(self.size))
            value = self.log_target(proposal, rng)
            if np.log(rng.random()) < value - log_target:
                theta[:], log_target = proposal, value
                accepted += 1
        return accepted, log_target
