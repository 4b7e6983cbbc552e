"""The likelihood estimate for any list of effects, by importance sampling of omega.

For each sample the motion's mode and curvature are found by Gauss-Newton; omega is drawn
from that Gaussian, the rest of the motion (omega_dot, s and, where effects need them,
omega double dot and s dot: the 12-column H) is integrated analytically at each draw. The
estimate of p(y | theta) is unbiased for models linear in that rest given omega, and its
variance falls as 1/N as in (26a). For the papers' model with its flat motion prior it equals
(26a) in expectation, up to a constant. Effects that have a gauge need a proper motion prior
(`ArrayModel.with_motion`): flat, each sample would carry a power of the gauge's scale.

Parameters may end in logs of factors on the sds of the noise and of the motion's prior, as
`Unknown` says which: those sds are then unknown, too.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from imuarray.engine.linearise import reading
from imuarray.engine.readings import Readings
from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.model.effects import Prediction
from imuarray.model.jax64 import cholesky, jax, jnp, log_determinant, solve_lower, solve_upper

# Of noise and of the motion's prior; `posterior.marginal.scaled` has all but the last.
SCALES = (
    "accelerometer_noise", "gyroscope_noise", "angular_rate", "angular_acceleration",
    "specific_force",
)  # fmt: skip
CHUNK = 1000  # samples whose densities are in memory at a time, with their derivatives


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


class Unknown(NamedTuple):
    """A recording as the compiled likelihood wants it, and the sds that are unknown (K)."""

    start: np.ndarray  # (T, 9 or 15)
    readings: tuple  # values and weights (T, N, 6), as `Readings` has them; time (T,)
    span: float
    logs: np.ndarray  # (5, K) from the last K parameters to the logs of `SCALES`


def residual(model, x, p, values, weights, time, span):
    """Residuals of one sample in their sds, (6 N + the motion's priors,)."""
    split = 3 * (model.array.accelerometers - 1)
    positions = jnp.concatenate([jnp.zeros((1, 3)), p[:split].reshape(-1, 3)])
    known = jnp.zeros(3), jnp.zeros(3), Prediction(0.0, 0.0), Prediction(0.0, 0.0)
    predicted = reading(model, len(values), x, positions, p[split:], known, time, span)
    sds = *model.motion_sd, *(model.derivative_sd if model.needs_derivatives else ())
    priors = [x[3 * k : 3 * k + 3] / sd for k, sd in enumerate(sds) if np.isfinite(sd)]
    return jnp.concatenate([(weights * (values - predicted)).ravel(), *priors])


def _whitened(model, parameters, given: Unknown):
    """(function of a sample's motion and readings that gives its residuals, of p and of readings
    alone; what each sample's likelihood is divided by, (T,) of logs)."""
    size = parameters.size - given.logs.shape[1]
    logs = given.logs @ parameters[size:]
    weights = given.readings[1]
    triads = jnp.exp(-jnp.repeat(logs[:2], 3))
    counts = [3 * int(np.isfinite(sd)) for sd in model.motion_sd]
    wide = [jnp.tile(triads, weights.shape[1])]
    wide += [jnp.full(n, jnp.exp(-log)) for n, log in zip(counts, logs[2:], strict=True)]
    wide = jnp.concatenate([*wide, jnp.ones(6 * model.needs_derivatives)])

    def flat(x, data):
        return wide * residual(model, x, parameters[:size], *data, given.span)

    used = jnp.sum((weights > 0).reshape(len(weights), -1, 2, 3), axis=(1, 3))
    return flat, used @ logs[:2] + sum(n * log for n, log in zip(counts, logs[2:], strict=True))


@partial(jax.jit, static_argnums=(0, 1))
def _estimate(model, steps, parameters, given: Unknown, draws):
    residuals, volume = _whitened(model, parameters, given)

    def one(x, data, draws):
        def flat(x):
            return residuals(x, data)

        x, factor = _mode(flat, x, steps)
        whole = solve_lower(factor, jnp.eye(x.size)[:, :3])
        scale = cholesky(whole.T @ whole)  # covariance of omega: the inverse's first block
        weights = jax.vmap(lambda draw: _log_weight(flat, x, scale, draw))(draws)
        return jax.scipy.special.logsumexp(weights) - jnp.log(len(draws))

    return jnp.sum(jax.vmap(one)(given.start, given.readings, draws) - volume)


def log_laplace(model, steps, parameters, given: Unknown):
    """log p(y | theta) by Laplace's method over each sample's whole motion, to be differentiated.

    The search for the mode carries no derivative; one step of Newton's method from the mode,
    its curvature fixed, has the mode's own. The derivative leaves out that of the residual's
    second derivatives, which is far below what a sampler's steps would notice.
    """
    residuals, volume = _whitened(model, parameters, given)
    still = jax.lax.stop_gradient
    fixed, _ = _whitened(model, still(parameters), given)

    def one(x, data):
        mode, factor = still(_mode(lambda x: fixed(x, data), still(x), steps))
        slope = jax.grad(lambda x: 0.5 * jnp.sum(residuals(x, data) ** 2))(mode)[:, None]
        x = mode - solve_upper(factor, solve_lower(factor, slope))[:, 0]
        value, jac = residuals(x, data), jax.jacfwd(lambda x: residuals(x, data))(x)
        factor = cholesky(jac.T @ jac)
        # the rest of the second derivative, to first order: it need not be positive far away;
        # so small a term needs no derivative of its own
        bend = jax.hessian(lambda z: fixed(z, data) @ still(value))(still(x))
        inner = solve_upper(still(factor), solve_lower(still(factor), bend))
        return -0.5 * (value @ value + log_determinant(factor) + jnp.trace(inner))

    samples = given.start, given.readings
    if len(given.start) <= CHUNK:
        return jnp.sum(jax.vmap(one)(*samples) - volume)
    parts = jax.lax.map(jax.checkpoint(lambda s: one(*s)), samples, batch_size=CHUNK)
    return jnp.sum(parts - volume)


class GenericLikelihood:
    """log p-hat(y | theta, effect parameters) for a model with any effects.

    ``readings`` are what is known, their ``sd`` the noise. ``start`` (T, 9 or 15) is where each
    sample's Gauss-Newton begins (the motion at the calibrated parameters, say); ``draws`` is N,
    ``steps`` the Gauss-Newton steps. ``logs`` (5, K) maps the last K parameters to logs of factors
    on the sds that `SCALES` names; none by default.
    """

    def __init__(
        self, model: ArrayModel, readings: Readings, start, draws=4, steps=3, logs=None,
    ):  # fmt: skip
        seen = readings.keep[..., 3:].any(axis=1).all(axis=1)
        if not seen.all():
            raise InputError(
                "gyroscopes: expected one unsaturated per axis in every sample, found none in"
                f" sample {np.flatnonzero(~seen)[0]} (and {np.sum(~seen) - 1} more)"
            )
        self.model, self.draws, self.steps = model, draws, steps
        self.data = Unknown(
            np.asarray(start), (readings.values, readings.weights, readings.time), readings.span,
            np.zeros((5, 0)) if logs is None else logs,
        )  # fmt: skip

    def on(self, parameters, normals) -> float:
        """The estimate at p (P,) = (r_2 ... r_A, effects[, logs]) on given normals (T, N, 3)."""
        return float(_estimate(self.model, self.steps, np.asarray(parameters), self.data, normals))

    def log_density(self, parameters):
        """log p(y | p) by Laplace's method, to be traced and differentiated by JAX.

        Its constant is that of `on`; it is exact where residuals are linear in the motion.
        """
        return log_laplace(self.model, self.steps, parameters, self.data)

    def __call__(self, parameters, rng) -> float:
        """The estimate with fresh draws; -inf where it is not a number."""
        normals = rng.standard_normal((len(self.data.start), self.draws, 3))
        value = self.on(parameters, normals)
        return value if np.isfinite(value) else -np.inf
