"""The marginal likelihood for any list of effects, by Laplace's method over each sample's motion.

For each sample the motion's mode and curvature are found by Gauss-Newton: omega, omega_dot, s and,
where effects need them, omega double dot and s dot. It is exact where residuals are linear in the
motion; for the papers' model with its flat motion prior it is near (26a), up to a constant. Effects
that have a gauge need a proper motion prior (`ArrayModel.motion_sd`): flat, each sample would
carry a power of the gauge's scale.

Parameters may end in logs of factors on the sds of the noise and of the motion's prior, as
`Unknown` says which: those sds are then unknown, too.
"""

from typing import NamedTuple

import numpy as np

from imuarray.engine.linearise import reading
from imuarray.engine.readings import Readings
from imuarray.errors import InputError
from imuarray.model.effects import Prediction
from imuarray.model.jax64 import jax, jnp
from imuarray.posterior.settings import SETTINGS

# Of noise and of the motion's prior; `posterior.marginal.scaled` has all but the last.
SCALES = (
    "accelerometer_noise", "gyroscope_noise", "angular_rate", "angular_acceleration",
    "specific_force",
)  # fmt: skip


def _inverse(matrix):
    """(inverse, log determinant) of one (n, n) positive definite matrix, by sweeps of its rows.

    A loop: unrolled for 15 rows, or by the steps of `_mode`, it would take a minute to compile.
    """
    here = jnp.arange(len(matrix))

    def sweep(k, state):
        matrix, log = state
        pivot, row, column = matrix[k, k], matrix[k] / matrix[k, k], matrix[:, k]
        swept = jnp.where(here[:, None] == k, row, matrix - jnp.outer(column, row))
        own = jnp.where(here == k, 1.0, -column) / pivot
        return jnp.where(here == k, own[:, None], swept), log + jnp.log(pivot)

    return jax.lax.fori_loop(0, len(matrix), sweep, (matrix, 0.0))


def _mode(flat, x, steps):
    """Gauss-Newton on one sample's motion; returns x and the inverse information near it."""

    def step(_, state):
        x, _ = state
        jac = jax.jacfwd(flat)(x)
        inverse, _ = _inverse(jac.T @ jac)
        return x - inverse @ (jac.T @ flat(x)), inverse

    return jax.lax.fori_loop(0, steps, step, (x, jnp.zeros((x.size, x.size))))


class Unknown(NamedTuple):
    """A recording as the compiled likelihood wants it, and the sds that are unknown (K)."""

    start: np.ndarray  # (T, 9 or 15)
    readings: tuple  # values and weights (T, N, 6), as `Readings` has them; time (T,)
    span: float
    logs: np.ndarray  # (5, K) from the last K parameters to the logs of `SCALES`


def unknown(readings: Readings, start, logs=None) -> Unknown:
    """Arguments of `log_laplace`; ``start`` (T, 9 or 15) is where each sample's search begins.

    ``logs`` (5, K) maps the last K parameters to logs of factors on the sds that `SCALES` names.
    Raises InputError for a sample without gyroscopes.
    """
    informed = readings.keep[..., 3:].any(axis=1).all(axis=1)
    if not informed.all():
        raise InputError(
            "gyroscopes: expected one unsaturated per axis in every sample, found none in"
            f" sample {np.flatnonzero(~informed)[0]} (and {np.sum(~informed) - 1} more)"
        )
    return Unknown(
        np.asarray(start), (readings.values, readings.weights, readings.time), readings.span,
        np.zeros((5, 0)) if logs is None else logs,
    )  # fmt: skip


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


def log_laplace(model, parameters, given: Unknown, steps: int = SETTINGS.laplace_steps):
    """log p(y | theta) by Laplace's method over each sample's whole motion, to be differentiated.

    The search for the mode carries no derivative; one step of Newton's method from the mode,
    its curvature fixed, has the mode's own. That of the residual's second derivatives is left out.
    """
    residuals, volume = _whitened(model, parameters, given)
    still = jax.lax.stop_gradient
    fixed, _ = _whitened(model, still(parameters), given)

    def one(x, data):
        mode, inverse = still(_mode(lambda x: fixed(x, data), still(x), steps))
        x = mode - inverse @ jax.grad(lambda x: 0.5 * jnp.sum(residuals(x, data) ** 2))(mode)
        value, jac = residuals(x, data), jax.jacfwd(lambda x: residuals(x, data))(x)
        known = jac.T @ jac
        inverse, log = _inverse(still(known))
        # the determinant's derivative is that of the trace
        spread = log + jnp.sum(inverse * (known - still(known)))
        # the rest of the second derivative, to first order: it need not be positive far away; it
        # is so small that it needs no derivative of its own
        bend = jax.hessian(lambda z: fixed(z, data) @ still(value))(still(x))
        return -0.5 * (value @ value + spread + jnp.sum(inverse * bend))

    count = len(given.start)
    parts = -(-count // SETTINGS.chunk)
    size = -(-count // parts)
    # parts of one size, the last sample again and again: another size is compiled once more
    index = np.minimum(np.arange(parts * size), count - 1)
    samples = jax.tree.map(lambda values: values[index], (given.start, given.readings))
    if parts == 1:
        return jnp.sum(jax.vmap(one)(*samples) - volume)
    found = jax.lax.map(jax.checkpoint(lambda s: one(*s)), samples, batch_size=size)
    return jnp.sum(found[:count] - volume)
