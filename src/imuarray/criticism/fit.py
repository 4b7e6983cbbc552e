"""Weighted least squares for any subset of the parameters, the motion eliminated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imuarray.criticism.columns import POSITION, Columns
from imuarray.criticism.linearise import Linear, State, derivatives, linearise, no_derivatives
from imuarray.criticism.readings import Readings

STEPS = 25
SETTLED = 0.02  # of a parameter's own sd


@dataclass(frozen=True)
class Fit:
    """A model fitted to readings, and what score tests need at that point.

    Attributes
    ----------
    active : (N, m) bool, the parameters that were fitted
    residual : (T, N, 6) in the units of the noise sd, the motion's share taken out
    whitened : (T, N, 6, m) derivative by the shared parameters, in those units
    basis : (T, 6 N, 9) orthonormal basis of what the motion can explain
    through : (T, 9, N, m) the derivative's coordinates in that basis
    log_volume : (T,) log determinant of the motion's information
    misfit : sum of squared residuals
    """

    readings: Readings
    columns: Columns
    state: State
    active: np.ndarray
    residual: np.ndarray
    whitened: np.ndarray
    basis: np.ndarray
    through: np.ndarray
    log_volume: np.ndarray
    misfit: float
    converged: bool

    @property
    def leverage(self) -> np.ndarray:
        """Share of each reading's variance that the motion takes up, (T, N, 6)."""
        return np.einsum("tij,tij->ti", self.basis, self.basis).reshape(self.residual.shape)

    @property
    def free(self) -> int:
        """Degrees of freedom left: readings less motion less fitted parameters."""
        used = int(self.readings.keep.sum())
        return used - 9 * len(self.residual) - int(self.active.sum())


def eliminate(readings: Readings, linear: Linear):
    """(residual, whitened, basis, through, log volume, motion's step) at a state."""
    samples, count = readings.values.shape[:2]
    weights = readings.weights
    residual = weights * (readings.values - linear.predicted)
    motion = (weights[..., None] * linear.motion).reshape(samples, 6 * count, 9)
    factor = np.linalg.cholesky(np.swapaxes(motion, 1, 2) @ motion)
    inverse = np.linalg.inv(factor)
    basis = motion @ np.swapaxes(inverse, 1, 2)
    whitened = weights[..., None] * linear.shared
    blocks = np.swapaxes(basis.reshape(samples, count, 6, 9), 2, 3) @ whitened
    through = np.ascontiguousarray(np.swapaxes(blocks, 1, 2))
    flat = residual.reshape(samples, -1)
    taken = np.einsum("tri,tr->ti", basis, flat)
    left = (flat - np.einsum("tri,ti->tr", basis, taken)).reshape(residual.shape)
    volume = 2 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(1)
    return left, whitened, basis, through, volume, (inverse, taken)


def pick(through, chosen) -> tuple[np.ndarray, np.ndarray]:
    """The (imu, column) pairs (n, 2) of ``chosen`` (N, m) bool, and through's columns (T, 9, n)."""
    pairs = np.argwhere(chosen)
    return pairs, through[:, :, pairs[:, 0], pairs[:, 1]]


def normal(residual, whitened, through, chosen, part=slice(None)):
    """Information (n, n) and score (n,) of the chosen parameters, motion projected out."""
    pairs, seen = pick(through[part], chosen)
    flat = seen.reshape(-1, len(pairs))
    information = -(flat.T @ flat)
    score = np.empty(len(pairs))
    for imu in np.unique(pairs[:, 0]):
        rows = np.flatnonzero(pairs[:, 0] == imu)
        block = whitened[part, imu][..., pairs[rows, 1]].reshape(-1, len(rows))
        information[np.ix_(rows, rows)] += block.T @ block
        # the residual is orthogonal to the motion already
        score[rows] = block.T @ residual[part, imu].ravel()
    return information, score


def fit(
    readings: Readings, columns: Columns, active, state: State, smooth=True, steps=STEPS
) -> Fit:
    """Gauss-Newton over motion and the active parameters from a state, priors included.

    ``smooth`` says whether the motion's time derivatives may be had from its neighbours.
    """
    prior_mean = prior_means(readings, columns)[active]
    precision = 1.0 / np.broadcast_to(columns.prior_sd, active.shape)[active] ** 2
    wanted = np.flatnonzero(active.any(axis=0))
    few, converged, last = active[:, wanted], False, np.inf
    for number in range(steps):
        state = with_derivatives(readings, state, smooth)
        linear = linearise(readings, columns, state, wanted)
        residual, whitened, _, through, _, (inverse, taken) = eliminate(readings, linear)
        information, score = normal(residual, whitened, through, few)
        offset = flat_parameters(columns, state)[active] - prior_mean
        score = score - precision * offset
        step, sds = scaled_solve(information + np.diag(precision), score)
        moved, astray = np.max(np.abs(step) / sds, initial=0.0), float(np.sum(taken**2))
        if (moved < SETTLED and astray < 0.01 * len(residual)) or score @ step + astray < 1e-3:
            converged = True
            break
        cost = float(np.sum(residual**2)) + astray + float(precision @ offset**2)
        if number > 6 and cost > last * (1 - 1e-5):
            break  # it wanders around the optimum, by less than anything told apart here
        last = cost
        state = advance(columns, state, active, step, few, through, inverse, taken)
    return at(readings, columns, active, state, converged)


def at(readings: Readings, columns: Columns, active, state: State, converged: bool) -> Fit:
    """The fit's quantities at a state, with the derivative by every parameter."""
    linear = linearise(readings, columns, state)
    residual, whitened, basis, through, volume, _ = eliminate(readings, linear)
    return Fit(
        readings, columns, state, active, residual, whitened, basis, through, volume,
        float(np.sum(residual**2)), converged,
    )  # fmt: skip


def advance(columns, state, active, step, few, through, inverse, taken) -> State:
    """The state after a step of the active parameters, and the motion's own."""
    _, seen = pick(through, few)
    move = np.einsum("tji,tj->ti", inverse, taken - seen @ step)
    whole = flat_parameters(columns, state)
    whole[active] += step
    return from_flat(columns, state._replace(motion=state.motion + move), whole)


def scaled_solve(information, right):
    """(solution, sds) of a positive definite system, scaled to a unit diagonal first."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    values = np.maximum(values, 1e-13)
    solution = (vectors @ ((vectors.T @ (right / scale)) / values)) / scale
    return solution, np.sqrt(np.sum(vectors**2 / values, axis=1)) / scale


def with_derivatives(readings, state, smooth) -> State:
    """The state with the time derivatives of its own motion, or none."""
    if smooth:
        found = derivatives(readings, state.motion, state.positions)
    else:
        found = no_derivatives(len(state.motion), len(state.positions))
    return state._replace(derivatives=found)


def flat_parameters(columns: Columns, state: State) -> np.ndarray:
    """Positions and effect parameters by IMU and column, (N, m); zero where there is none."""
    count = columns.owner.shape[0]
    out = np.zeros((count, columns.size))
    out[: len(state.positions), columns.of(POSITION)] = state.positions
    values = columns.model.split(state.parameters)
    for name, value in values.items():
        rows = np.asarray(value).reshape(len(value), -1)
        out[: len(rows), columns.of(name)] = rows
    return out


def from_flat(columns: Columns, state: State, whole) -> State:
    """The inverse of `flat_parameters`, into a state."""
    shapes = dict(zip(columns.model.effects, columns.model.shapes, strict=True))
    values = {n: whole[: s[0], columns.of(n)].reshape(s) for n, s in shapes.items()}
    positions = whole[: len(state.positions), columns.of(POSITION)]
    return state._replace(positions=positions, parameters=columns.model.join(values))


def prior_means(readings: Readings, columns: Columns) -> np.ndarray:
    """(N, m): nominal positions, no effect."""
    out = np.zeros(columns.owner.shape)
    nominal = readings.array.relative
    out[: len(nominal), columns.of(POSITION)] = nominal
    return out
