"""The likelihood estimate for any list of effects, by importance sampling of omega.

For each sample the motion's mode and curvature are found by Gauss-Newton; omega is drawn
from that Gaussian, the rest of the motion (omega_dot, s and, where effects need them,
omega double dot and s dot: the 12-column H) is integrated analytically at each draw. The
estimate of p(y | theta) is unbiased for models linear in that rest given omega, and its
variance falls as 1/N as in (26a). For the papers' model with its flat motion prior it equals
(26a) in expectation, up to a constant. Effects that have a gauge need a proper motion prior
(`ArrayModel.with_motion`): flat, each sample would carry a power of the gauge's scale.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from imuarray.errors import InputError
from imuarray.estimation.blocks import Problem, problem, residual
from imuarray.model import ArrayModel
from imuarray.model.jax64 import jax, jnp
from imuarray.model.small_linear import cholesky, log_determinant, solve_lower, solve_upper


def _mode(flat, x, steps):
    """Gauss-Newton on one sample's motion; returns x and the information's factor."""
    for _ in range(steps):
        jac = jax.jacfwd(flat)(x)
        factor = cholesky(jac.T @ jac)
        gradient = (jac.T @ flat(x))[:, None]
        x = x - solve_upper(factor, solve_lower(factor, gradient))[:, 0]
    jac = jax.jacfwd(flat)(x)
    return x, cholesky(jac.T @ jac)


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
def _estimate(model, steps, start, p, data, span, whiten_force, whiten_rate, draws):
    def one(x, data, draws):
        def flat(x):
            return residual(model, x, p, *data, span, whiten_force, whiten_rate)

        x, factor = _mode(flat, x, steps)
        whole = solve_lower(factor, jnp.eye(x.size)[:, :3])
        scale = cholesky(whole.T @ whole)  # covariance of omega: the inverse's first block
        weights = jax.vmap(lambda draw: _log_weight(flat, x, scale, draw))(draws)
        return jax.scipy.special.logsumexp(weights) - jnp.log(len(draws))

    return jax.vmap(one)(start, data, draws).sum()


def _log_laplace(model, steps, start, p, data, span, whiten_force, whiten_rate):
    """log p(y | theta) by Laplace's method over each sample's whole motion, to be differentiated.

    The search for the mode carries no derivative; one step of Newton's method from the mode,
    its curvature fixed, has the mode's own. The derivative leaves out that of the residual's
    second derivatives, which is far below what a sampler's steps would notice.
    """

    def one(x, data):
        def flat(x, p=p):
            return residual(model, x, p, *data, span, whiten_force, whiten_rate)

        fixed = jax.lax.stop_gradient(p)
        mode, factor = _mode(lambda x: flat(x, fixed), jax.lax.stop_gradient(x), steps)
        mode, factor = jax.lax.stop_gradient((mode, factor))
        slope = jax.grad(lambda x: 0.5 * jnp.sum(flat(x) ** 2))(mode)[:, None]
        x = mode - solve_upper(factor, solve_lower(factor, slope))[:, 0]
        value, jac = flat(x), jax.jacfwd(flat)(x)
        factor = cholesky(jac.T @ jac)
        # the rest of the second derivative, to first order: it need not be positive far away;
        # so small a term needs no derivative of its own
        still = jax.lax.stop_gradient
        bend = jax.hessian(lambda z: flat(z, fixed) @ still(value))(still(x))
        inner = solve_upper(still(factor), solve_lower(still(factor), bend))
        return -0.5 * (value @ value + log_determinant(factor) + jnp.trace(inner))

    return jax.vmap(one)(start, data).sum()


class GenericLikelihood:
    """log p-hat(y | theta, effect parameters) for a model with any effects.

    ``start`` (T, 9 or 15) is where each sample's Gauss-Newton begins (the motion at the
    calibrated parameters, say); ``draws`` is N, ``steps`` the Gauss-Newton steps.
    """

    def __init__(
        self, model: ArrayModel, specific_force, angular_rate, start, draws=4, steps=3,
        saturated=None, time=None,
    ):  # fmt: skip
        self.given: Problem = problem(model, specific_force, angular_rate, saturated, time=time)
        seen = self.given.keep.reshape(len(self.given.keep), -1, 3).any(axis=1).all(axis=1)
        if not seen.all():
            raise InputError(
                "gyroscopes: expected one unsaturated per axis in every sample, found none in"
                f" sample {np.flatnonzero(~seen)[0]} (and {np.sum(~seen) - 1} more)"
            )
        self.start, self.draws, self.steps = np.asarray(start), draws, steps

    def on(self, parameters, normals) -> float:
        """The estimate at p (P,) = (r_2 ... r_A, effects) on given normals (T, N, 3)."""
        given = self.given
        return float(
            _estimate(
                given.model,
                self.steps,
                self.start,
                np.asarray(parameters),
                (given.specific_force, given.angular_rate, given.keep, given.time),
                given.span,
                given.whiten_force,
                given.whiten_rate[0],  # the declared noise, the same in every sample
                normals,
            )  # fmt: skip
        )

    def log_density(self, parameters):
        """log p(y | p) by Laplace's method, to be traced and differentiated by JAX.

        Its constant is that of `on`; it is exact where residuals are linear in the motion.
        """
        given = self.given
        return _log_laplace(
            given.model, self.steps, self.start, parameters,
            (given.specific_force, given.angular_rate, given.keep, given.time),
            given.span, given.whiten_force, given.whiten_rate[0],
        )  # fmt: skip

    def __call__(self, parameters, rng) -> float:
        """The estimate with fresh draws; -inf where it is not a number."""
        normals = rng.standard_normal((len(self.start), self.draws, 3))
        value = self.on(parameters, normals)
        return value if np.isfinite(value) else -np.inf
