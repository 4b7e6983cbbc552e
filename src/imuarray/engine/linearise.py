"""The model's prediction and its derivatives over a recording, by automatic differentiation."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple, Self

import numpy as np

from imuarray.engine.derivatives import polynomial_derivative
from imuarray.engine.parameters import POSITION, Columns
from imuarray.engine.readings import Readings
from imuarray.linear import triangular_inverse
from imuarray.model import ArrayModel
from imuarray.model.array_model import by_effects, stacked
from imuarray.model.effects import Instant, Turning
from imuarray.model.jax64 import jax, jnp
from imuarray.motion.state import Motion

KNOWN = 9  # the motion that the papers' model knows: omega, omega_dot, s
CHUNK = 256  # samples per compiled call: one compiled shape, bounded memory


class RoughPrior(NamedTuple):
    """Normal prior of what rough motion adds to a sample's unknowns: mean and sd, (T, 9) each.

    omega double dot, s dot, and by how much the gyroscopes' omega dot differs: they and the
    accelerometers have filters, and what is too fast for the samples passes them differently.
    Six more where clocks are known reading by reading: omega double dot and omega of that kind.
    """

    mean: np.ndarray
    sd: np.ndarray
    own: np.ndarray  # (T, 3) sd of what the gyroscopes' omega dot has of its own, once free

    def freed(self) -> Self:
        """The gyroscopes' omega dot free."""
        return self._replace(sd=np.hstack([self.sd[:, :6], self.own]))

    def scaled(self, factors) -> Self:
        """The sds of each three components times a factor (G,)."""
        wide = np.repeat(factors, 3)
        return self._replace(sd=wide * self.sd, own=wide[6:9] * self.own)

    @property
    def free(self) -> bool:
        """True where the gyroscopes' omega dot is free."""
        return bool(np.any(self.sd[:, 6:9] == self.own))


class TurningPrior(NamedTuple):
    """Normal prior of omega_dot, of which the rate's own slope is the mean; (T, 3) each.

    ``follows`` (T,) bool: whether derivatives by parameters know that the mean moves with the rate.
    They do near the optimum; far from it such steps lead astray.
    """

    mean: np.ndarray
    sd: np.ndarray
    follows: np.ndarray

    @property
    def log_norm(self) -> np.ndarray:
        """(T,) minus its log density at the mean; none of it where the prior is flat."""
        known = np.isfinite(self.sd)
        return np.sum(np.log(np.where(known, self.sd * np.sqrt(2 * np.pi), 1.0)), axis=1)


class State(NamedTuple):
    """Where the model is linearised."""

    motion: np.ndarray  # (T, D): omega, omega_dot, s, and what is `RoughPrior`
    positions: np.ndarray  # (A, 3) m, relative to the reference
    parameters: np.ndarray  # (P,) of the model with all effects
    derivatives: tuple  # of its own course, as `imuarray.engine.derivatives.derivatives` has them
    rough_prior: RoughPrior | None = None  # where the motion is rough
    turning: TurningPrior | None = None

    def select(self, used) -> Self:
        """At the samples ``used``, (T,) bool or indices."""
        own = self.motion, self.derivatives, self.rough_prior, self.turning
        motion, derivatives, prior, turning = jax.tree.map(lambda field: field[used], own)
        return State(motion, self.positions, self.parameters, derivatives, prior, turning)

    @property
    def gyroscopes_free(self) -> bool:
        """True where the angular acceleration seen by the gyroscopes is free."""
        return self.rough_prior is not None and self.rough_prior.free

    @property
    def jerk(self) -> tuple[np.ndarray, np.ndarray]:
        """omega double dot and s dot (T, 3), free or from neighbours."""
        if self.rough_prior is None:
            return self.derivatives[0], self.derivatives[1]
        return self.motion[:, 9:12], self.motion[:, 12:15]


class Whitened(NamedTuple):
    """A chunk linearised at a state, in sds of its readings' noise."""

    index: np.ndarray  # (T,) its samples
    residual: np.ndarray  # (T, N, 6)
    motion: np.ndarray  # (T, 6 N, D) derivatives by the motion
    columns: np.ndarray  # (T, N, 6, m) of each IMU's readings by its own parameters

    def reweighted(self, former: Readings, readings: Readings) -> Self:
        """In the sds and weights of ``readings`` instead of the ``former`` ones."""
        before, now = former.weights_of(self.index), readings.weights_of(self.index)
        ratio = now / np.where(before > 0, before, 1.0)
        motion = self.motion * ratio.reshape(len(ratio), -1, 1)
        return Whitened(self.index, ratio * self.residual, motion, ratio[..., None] * self.columns)


class Eliminated(NamedTuple):
    """A linearised recording, whitened, the motion eliminated sample by sample.

    Where the motion has a prior, it counts as so many readings more.
    """

    residual: np.ndarray  # (T, N, 6), the motion's share taken out
    whitened: np.ndarray  # (T, N, 6, m), each IMU's readings by its own parameters
    basis: np.ndarray  # (T, 6 N, D) of what the motion can explain, orthonormal with its prior's
    inverse: np.ndarray  # (T, D, D) of the factor of the motion's information
    absorbed: np.ndarray  # (T, D) the residual's coordinates in the basis
    expected: np.ndarray  # (T, D, 3) omega_dot's prior in that basis; (T, D, 0) where it has none
    innovation: np.ndarray  # (T, 3) what is left of it, in its sds
    prior_slope: np.ndarray  # (T, 3, N, m) derivatives of its mean, sign turned as of readings
    log_volume: np.ndarray  # (T,) log determinant of the motion's information
    misfit: np.ndarray  # (T,) squared residuals, the prior's included

    @property
    def projected(self) -> np.ndarray:
        """(T, N, D, m), the derivative's coordinates in that basis."""
        projected = projection_of(self.basis, self.whitened)
        if self.expected.shape[2]:
            projected += np.einsum("tdi,tikm->tkdm", self.expected, self.prior_slope)
        return projected


def _instant(x, positions, extra, time, span) -> Instant:
    """Quantities that effects may look at, at one sample."""
    jerk, force_rate, second, third, slow, deviation = (*extra, None, 0.0)[:6]
    own = None
    if len(x) > KNOWN:
        jerk, force_rate, slow = x[9:12], x[12:15], None
    if len(x) > 15:
        own = Turning(x[:3], x[3:6] + x[15:18], None)
    if len(x) > 18:
        own = Turning(x[:3] + x[21:24], own.acceleration, jerk + x[18:21])
    motion = Motion(x[:3], x[3:6], x[6:9], jerk, force_rate)
    more = {"slow": slow, "clock_deviation": deviation}
    return Instant(motion, positions, time, span, second, third, own, **more)


def reading(model, count, x, positions, parameters, extra, time, span):
    """(N, 6) predicted readings of one sample, of motion x as in `State`; traceable by JAX."""
    when = _instant(x, positions, extra, time, span)._asdict()
    return stacked(count, model.predict(parameters=parameters, **when))


def predicted(readings: Readings, model: ArrayModel, state: State, slopes=False):
    """(T, N, 6) readings at a state; and (T, N, 6, D) their ``slopes`` by the motion, if wanted."""
    extra = (*state.derivatives, readings.clock_deviations)
    given = state.positions, state.parameters
    return jax.tree.map(np.asarray, _predicted(
        model, readings.values.shape[1], slopes, state.motion, extra, readings.time, readings.span,
        *given,
    ))  # fmt: skip


def _with_slopes(function, x):
    """A function's value, and its derivatives by (D,) numbers last; traced once for both."""

    def twice(x):
        value = function(x)
        return value, value

    slopes, value = jax.jacfwd(twice, has_aux=True)(x)
    return value, slopes


@partial(jax.jit, static_argnums=(1, 2))
def _predicted(model, count, slopes, x, extra, time, span, positions, parameters):
    def one(x, extra, time):
        def at(x):
            return reading(model, count, x, positions, parameters, extra, time, span)

        return _with_slopes(at, x) if slopes else at(x)

    return jax.vmap(one)(x, extra, time)


@partial(jax.jit, static_argnums=(1, 2))
def _chunk(model, count, placed, x, extra, time, span, positions, parameters, data):
    """Whitened residual, its derivatives by the motion and by all columns.

    ``placed``: by the positions alone.
    """
    each = np.broadcast_to(np.eye(3)[:, None], (3, *positions.shape))

    def one(x, extra, time):
        def flat(x, positions):
            return reading(model, count, x, positions, parameters, extra, time, span)

        def moved(direction):
            return jax.jvp(lambda r: flat(x, r), (positions,), (direction,))[1]

        along = jax.vmap(moved, out_axes=-1)(each)
        if not placed:
            when = _instant(x, positions, extra, time, span)
            along = jnp.concatenate([along, by_effects(model, count, when, parameters)], axis=-1)
        return *_with_slopes(lambda x: flat(x, positions), x), along

    predicted, motion, shared = jax.vmap(one)(x, extra, time)
    values, weights = data
    motion = (weights[..., None] * motion).reshape(len(x), 6 * count, -1)
    return weights * (values - predicted), motion, weights[..., None] * shared


def _course(readings: Readings, index, whitened, sd) -> np.ndarray:
    """`Eliminated`'s, of the rate's own slope as the mean, with its ``sd`` (T, 3).

    What a gyroscope's parameter changes in its reading, it changes in the rate with the sign
    turned, and with the share that the gyroscope has in it.
    """
    weights = readings.weights_of(index)[..., 3:]
    total = np.maximum(np.sum(weights**2, axis=1), np.finfo(float).tiny)
    share = np.swapaxes(weights[..., None] * whitened[..., 3:, :], 1, 2) / total[..., None, None]
    run = readings.run[index]
    slope = polynomial_derivative(readings.time, run, share, readings.window, 1)
    return slope / sd[..., None, None]


def _less_motion(residual, basis, inverse, away, sd):
    """(residual left, what the motion takes, what is left of its prior, misfit) of samples."""
    expected = inverse[:, :, inverse.shape[1] - sd.shape[1] :] / sd[:, None]
    flat = residual.reshape(len(residual), -1, 1)
    absorbed = np.swapaxes(basis, 1, 2) @ flat + expected @ away[..., None]
    left = (flat - basis @ absorbed)[..., 0]
    innovation = (away[..., None] - np.swapaxes(expected, 1, 2) @ absorbed)[..., 0]
    misfit = np.sum(left**2, axis=1) + np.sum(innovation**2, axis=1)
    return left.reshape(residual.shape), absorbed[..., 0], innovation, misfit


def leverage_of(basis) -> np.ndarray:
    """Share of each reading's variance that the motion takes up, (T, N, 6)."""
    return np.einsum("tij,tij->ti", basis, basis).reshape(len(basis), -1, 6)


def projection_of(basis, whitened) -> np.ndarray:
    """(T, N, D, m) coordinates in the motion's basis of each IMU's derivatives (T, N, 6, m)."""
    return np.swapaxes(basis.reshape(*whitened.shape[:3], -1), 2, 3) @ whitened


THREADS = 2


def linearise(
    readings: Readings, columns: Columns, state: State, wanted=None, last=None
) -> Eliminated:
    """Residual and derivatives at a state, the motion eliminated.

    ``wanted`` : indices of the columns to differentiate by, all if None.
    ``last`` : a former answer whose memory may be used again. LinAlgError where the readings do
    not determine the motion.
    """
    directions = np.arange(columns.size) if wanted is None else np.asarray(wanted, int)

    def one(start):
        return chunk_at(readings, columns, state, directions, start)

    return Eliminated(*_joined(one, len(readings.values), last))


def relinearised(readings: Readings, columns: Columns, state: State, last: Eliminated):
    """The residual at another state by the derivatives of one near by: a chord's, not a tangent's.

    Without the derivatives and the products of them, most of the work of `linearise`.
    """
    count, first = readings.values.shape[1], last.innovation.shape[1]

    def one(start):
        index = padded(start, len(readings.values))
        x, extra, (mean, sd) = _rows_of(readings, state, index)
        values = np.asarray(_predicted(
            columns.model, count, False, x, extra, readings.time[index], readings.span,
            state.positions, state.parameters,
        ))  # fmt: skip
        residual = readings.weights_of(index) * (readings.values[index] - values)
        away = (mean - x[:, x.shape[1] - sd.shape[1] :]) / sd
        basis, inverse = last.basis[index], last.inverse[index]
        return _less_motion(residual, basis, inverse, away, sd)

    left, absorbed, innovation, misfit = _joined(one, len(readings.values))
    return last._replace(
        residual=left, absorbed=absorbed, innovation=innovation[:, :first], misfit=misfit
    )


def chunk_at(readings: Readings, columns: Columns, state: State, directions, start) -> Eliminated:
    """The `CHUNK` samples from ``start`` on, or as many as there are."""
    return eliminated(readings, state, whitened_at(readings, columns, state, directions, start))


def whitened_at(readings: Readings, columns: Columns, state: State, directions, start) -> Whitened:
    """The samples of `chunk_at`, the motion not eliminated."""
    index, used = padded(start, len(readings.values)), slice(0, len(readings.values) - start)
    rows = _run_of(index)
    x, extra, _ = _rows_of(readings, state, rows)
    placed = bool(np.all(directions < columns.of(POSITION).size)) or not columns.model.chain
    model, parameters = columns.model, state.parameters
    if placed and not parameters.any():  # the same readings, several times as fast
        model, parameters = model.plain, parameters[:0]
    made = _chunk(
        model, readings.values.shape[1], placed, x, extra, readings.time[rows], readings.span,
        state.positions, parameters, (readings.values[rows], readings.weights_of(rows)),
    )  # fmt: skip
    residual, motion, whitened = (np.asarray(part)[used] for part in made)
    if len(directions) < whitened.shape[-1]:
        whitened = np.take(whitened, directions, axis=-1)
    return Whitened(index[used], residual, motion, whitened)


def eliminated(readings: Readings, state: State, chunk: Whitened) -> Eliminated:
    """A chunk, the motion projected out: of the state that it is linearised at, but for its prior.

    A prior of the motion's last k numbers, its sd infinite where it has none.
    """
    x, _, (mean, sd) = _rows_of(readings, state, _run_of(chunk.index))
    away = (mean - x[:, x.shape[1] - sd.shape[1] :]) / sd
    prior_slope = np.zeros((len(x), 0, *chunk.columns[:, :, 0].shape[1:]))
    if state.turning is not None and state.turning.follows.any():
        prior_slope = _course(readings, chunk.index, chunk.columns, sd[:, :3])
    free, first = np.arange(x.shape[1] - sd.shape[1], x.shape[1]), prior_slope.shape[1]
    # factorisations are LAPACK's, called from here (see `jax64`)
    gram = chunk.motion.mT @ chunk.motion
    gram[:, free, free] += sd**-2.0
    factor = np.linalg.cholesky(gram)
    inverse = triangular_inverse(factor)
    basis = chunk.motion @ inverse.mT
    left, absorbed, innovation, misfit = _less_motion(chunk.residual, basis, inverse, away, sd)
    volume = 2 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
    expected = (inverse[:, :, free] / sd[:, None])[..., :first]
    return Eliminated(
        left, chunk.columns, basis, inverse, absorbed, expected, innovation[:, :first], prior_slope,
        volume, misfit,
    )  # fmt: skip


def padded(start: int, samples: int) -> np.ndarray:
    """Indices (CHUNK,) of a chunk's samples, the last one repeated where there are fewer."""
    return np.minimum(np.arange(start, start + CHUNK), samples - 1)


def _run_of(index):
    """`padded` indices as a slice, whose rows are not copied, where none is repeated."""
    whole = index[-1] - index[0] == len(index) - 1
    return slice(index[0], index[-1] + 1) if whole else index


def _rows_of(readings: Readings, state: State, index):
    """(motion, derivatives, the motion's prior) of the samples ``index``, a run or any."""
    whole = *state.derivatives, readings.clock_deviations
    extra = jax.tree.map(lambda field: field[index], whole)
    motion = state.motion[index]
    prior = 2 * (np.zeros((len(motion), 0)),)
    if state.rough_prior is not None:
        prior = state.rough_prior.mean[index], state.rough_prior.sd[index]
    if state.turning is not None:
        free = np.zeros((len(motion), 3)), np.full((len(motion), 3), np.inf)  # of s
        parts = zip((part[index] for part in state.turning[:2]), free, prior, strict=True)
        prior = tuple(np.hstack(part) for part in parts)
    return motion, extra, prior


def motion_equations(readings: Readings, model: ArrayModel, state: State, index, rails=None):
    """Normal equations of the motion of samples ``index``: (n, D, D), (n, D), costs (n,).

    Information, score and squared residuals, the prior's included. ``rails`` (T, N, 6): weights of
    readings that count as far as the prediction falls short of them.
    """
    x, extra, (mean, sd) = _rows_of(readings, state, index)
    predicted, slopes = map(np.asarray, _predicted(
        model, readings.values.shape[1], True, x, extra, readings.time[index], readings.span,
        state.positions, state.parameters,
    ))  # fmt: skip
    values, weights = readings.values[index], readings.weights_of(index)
    if rails is not None:
        weights = weights + rails[index] * (np.sign(values) * (values - predicted) > 0)
    motion = (weights[..., None] * slopes).reshape(len(x), -1, x.shape[1])
    residual = (weights * (values - predicted)).reshape(len(x), -1, 1)
    gram, slope = motion.mT @ motion, (motion.mT @ residual)[..., 0]
    free = np.arange(gram.shape[1] - sd.shape[1], gram.shape[1])
    gram[:, free, free] += sd**-2.0
    off = (mean - x[:, free]) / sd
    slope[:, free] += off / sd
    return gram, slope, np.sum(residual**2, axis=(1, 2)) + np.sum(off**2, axis=1)


def _joined(one, samples, last=None) -> list[np.ndarray]:
    """All chunks, one after the other, without the last one's padding."""
    first = one(0)
    shapes = [(samples, *part.shape[1:]) for part in first]
    reused = last is not None and [part.shape for part in last] == shapes
    out = list(last) if reused else [np.empty(shape) for shape in shapes]

    def put(start, found=None):
        for target, part in zip(out, one(start) if found is None else found, strict=True):
            target[start : start + CHUNK] = np.asarray(part)[: samples - start]

    put(0, first)
    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(put, range(CHUNK, samples, CHUNK)))
    return out
