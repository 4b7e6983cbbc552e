"""Weighted least squares for any subset of the parameters, the motion eliminated."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from imuarray.engine.derivatives import derivatives, no_derivatives
from imuarray.engine.linearise import (
    CHUNK,
    THREADS,
    Eliminated,
    RoughPrior,
    State,
    leverage_of,
    linearise,
    seen_again,
    through_of,
)
from imuarray.engine.parameters import POSITION, Columns, columns_of, prior_precision
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS
from imuarray.engine.start import turned
from imuarray.linear import scaled_eigh


@dataclass(frozen=True)
class Fit:
    """A model fitted to readings, and what score tests need at that point.

    Attributes
    ----------
    active : (N, m) bool, the parameters that were fitted
    wanted : (w,) the columns that derivatives are by
    residual : (T, N, 6) in the units of the noise sd, the motion's share taken out
    whitened : (T, N, 6, w) derivative by the shared parameters, in those units
    basis : (T, 6 N, D) basis of what the motion can explain, orthonormal with its prior's
    expected, unexpected, course : of omega_dot's prior, as `Eliminated` has them
    log_volume : (T,) log determinant of the motion's information
    misfits : (T,) sums of squared residuals, the motion's prior included
    """

    readings: Readings
    columns: Columns
    state: State
    active: np.ndarray
    wanted: np.ndarray
    residual: np.ndarray
    whitened: np.ndarray
    basis: np.ndarray
    expected: np.ndarray
    unexpected: np.ndarray
    course: np.ndarray
    log_volume: np.ndarray
    misfits: np.ndarray
    converged: bool

    @property
    def misfit(self) -> float:
        """Misfit of all samples."""
        return float(np.sum(self.misfits))

    @property
    def leverage(self) -> np.ndarray:
        """Share of each reading's variance that the motion takes up, (T, N, 6)."""
        return leverage_of(self.basis)

    def less_motion(self, values) -> np.ndarray:
        """Whitened readings (T, N, 6) without what the motion can explain of them."""
        flat = values.reshape(len(values), -1, 1)
        taken = np.swapaxes(self.basis, 1, 2) @ flat
        return (flat - self.basis @ taken).reshape(values.shape)

    @property
    def described(self) -> np.ndarray:
        """(N, m) bool: the parameters that there are derivatives by."""
        return self.columns.owner & np.isin(np.arange(self.columns.size), self.wanted)

    def only_active(self) -> Fit:
        """The fit with derivatives by the active parameters' columns alone."""
        kept = self.active.any(axis=0)[self.wanted]
        return replace(
            self,
            wanted=self.wanted[kept],
            whitened=self.whitened[..., kept],
            course=self.course[..., kept],
        )

    def along(self, step) -> np.ndarray:
        """Change of the whitened readings (T, N, 6) with the wanted parameters' step (N, m)."""
        moved = step[:, self.wanted]
        used = moved.any(axis=0)
        return np.einsum("tkim,km->tki", self.whitened[..., used], moved[:, used], optimize=True)

    def normal(self, chosen, part=slice(None)) -> tuple[np.ndarray, np.ndarray]:
        """Information (n, n) and score (n,) of the ``chosen`` (N, m) bool, of some samples."""
        return summed_normal(self, chosen[:, self.wanted], part)

    def through(self, columns) -> np.ndarray:
        """(T, N, D, n) some columns' coordinates in the motion's basis."""
        place = np.searchsorted(self.wanted, columns)
        return through_of(self.basis, self.whitened[..., place])

    @property
    def free(self) -> int:
        """Degrees of freedom left: readings less motion less fitted parameters."""
        used = int(self.readings.keep.sum())
        motion = 9 if self.state.turning is None else 6
        return used - motion * len(self.residual) - int(self.active.sum())


def pick(through, chosen) -> tuple[np.ndarray, np.ndarray]:
    """The (imu, column) pairs (n, 2) of ``chosen`` (N, m) bool, and through's columns (T, D, n)."""
    pairs = np.argwhere(chosen)
    seen = np.empty((len(through), through.shape[2], len(pairs)))
    for imu in np.unique(pairs[:, 0]):
        own = np.flatnonzero(pairs[:, 0] == imu)
        seen[..., own] = through[:, imu][..., pairs[own, 1]]
    return pairs, seen


def seen_through(whitened, basis, chosen):
    """The n ``chosen`` (N, m) bool in the motion's basis: (T, D, n), and [(imu, places, block)].

    A block is an IMU's own part of the derivatives ``whitened`` (T, N, 6, m), (T, 6, n_imu).
    """
    counts = chosen.sum(axis=1)
    through, blocks = np.empty((len(basis), basis.shape[2], counts.sum())), []
    for imu in np.flatnonzero(counts):
        block = whitened[:, imu]
        if not chosen[imu].all():
            block = block[..., chosen[imu]]
        places = slice(counts[:imu].sum(), counts[: imu + 1].sum())
        own = np.swapaxes(basis[:, 6 * imu : 6 * imu + 6], 1, 2)
        np.matmul(own, block, out=through[..., places])
        blocks.append((imu, places, block))
    return through, blocks


def summed_normal(seen, chosen, part=slice(None)):
    """`normal` of many samples, chunk by chunk: what is made of each is small."""
    first, last, _ = part.indices(len(seen.residual))

    def over(starts):
        information, score = np.zeros((chosen.sum(), chosen.sum())), np.zeros(chosen.sum())
        for start in starts:
            inner, slope = normal(seen, chosen, slice(start, min(start + CHUNK, last)))
            information += inner
            score += slope
        return information, score

    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(over, np.array_split(np.arange(first, last, CHUNK), THREADS)))
    return sum(inner for inner, _ in found), sum(slope for _, slope in found)


def normal(seen, chosen, part):
    """Information (n, n) and score (n,) of the chosen parameters, motion projected out.

    ``seen``: an `Eliminated` or a `Fit`.
    """
    through, blocks = seen_through(seen.whitened[part], seen.basis[part], chosen)
    course = np.empty((*seen.unexpected[part].shape, through.shape[2]))
    for imu, places, _ in blocks:
        course[..., places] = seen.course[part, :, imu][..., chosen[imu]]
    if course.shape[1]:
        through += seen.expected[part] @ course
    flat, prior = (x.reshape(x.shape[0] * x.shape[1], x.shape[2]) for x in (through, course))
    information = prior.T @ prior - flat.T @ flat
    for _, places, block in blocks:
        own = block.reshape(-1, block.shape[-1])
        information[places, places] += own.T @ own
    return information, score_of(seen, chosen, part)


def score_of(seen, chosen, part=slice(None)):
    """Score (n,) of the chosen parameters; the residual is orthogonal to the motion already."""
    score = np.einsum("tkim,tki->km", seen.whitened[part], seen.residual[part])
    score += np.einsum("tdkm,td->km", seen.course[part], seen.unexpected[part])
    return score[chosen]


def fit(
    readings: Readings, columns: Columns, active, state: State, smooth=True, rough=False,
    all_columns=True,
) -> Fit:  # fmt: skip
    """Gauss-Newton over motion and the active parameters from a state, priors included.

    ``smooth`` says whether the motion's time derivatives may be had from its neighbours, ``rough``
    that it may stop when a step gains little; ``all_columns`` as for `at`.
    """
    state, converged, _ = search_optimum(readings, columns, active, state, smooth, rough)
    return at(readings, columns, active, state, converged, all_columns)


def search_optimum(readings, columns, active, state, smooth, rough):
    """(state, whether it converged, the recording as seen there or a step before).

    A step from the derivatives of one before it is enough where what is left is noise; where a
    model lacks something, what is left moves the optimum as these change.
    """
    whole, active = columns, movable(columns, active, [state])
    columns, kept = in_use(whole, active, state)
    parameters, active = flat_parameters(whole, state), active[:, kept]
    state = from_flat(columns, state, parameters[:, kept])
    prior_mean = prior_means(readings, columns)[active]
    precision = prior_precision(columns, active)
    wanted = np.flatnonzero(active.any(axis=0))
    few = active[:, wanted]
    converged, last, length, seen, near, predicted = False, np.inf, 1.0, None, False, np.inf
    enough = SETTINGS.rough_gain if rough else SETTINGS.fine_gain
    noisy = SETTINGS.noisy * (readings.keep.sum() - state.motion.size)
    for number in range(SETTINGS.steps):
        state = with_derivatives(readings, state, smooth)
        if near:
            seen = seen_again(readings, columns, state, seen)
            score = score_of(seen, few)
        else:
            seen = linearise(readings, columns, state, wanted, seen)
            information, score = summed_normal(seen, few)
        misfit, former = float(np.sum(seen.misfit)), predicted
        offset = flat_parameters(columns, state)[active] - prior_mean
        score = score - precision @ offset
        step, sds = scaled_solve(information + precision, score)
        moved, in_motion = np.max(np.abs(step) / sds, initial=0.0), float(np.sum(seen.taken**2))
        predicted = score @ step + in_motion
        still = moved < SETTINGS.converged and in_motion < 0.01 * len(seen.taken)
        if still or predicted < max(SETTINGS.least_step, enough * misfit):
            # what the last step leaves is of second order in what it predicted
            state = advance(columns, state, active, step, few, seen, 1.0)
            converged = True
            break
        begun = predicted < SETTINGS.near_by * (former if near else misfit)
        near, stale = begun and misfit < noisy and state.turning is None, near
        cost = misfit + in_motion + float(offset @ precision @ offset)
        if number > 3 and not stale and abs(cost - last) < 0.3 * enough * last:
            converged = True
            break  # it stays around the optimum, by less than anything distinguished here
        # full steps may alternate across a valley: half of them lead into it
        length = max(length / 2, SETTINGS.shortest) if cost > last else min(1.0, 1.2 * length)
        last = cost
        state = advance(columns, state, active, step, few, seen, length)
    parameters[:, kept] = flat_parameters(columns, state)
    return from_flat(whole, state, parameters), converged, seen


def in_use(columns: Columns, active, state: State, also=()) -> tuple[Columns, np.ndarray]:
    """Columns of the effects that are active or not zero, or in ``also``; (m,) bool, which."""
    used = (active | (flat_parameters(columns, state) != 0)).any(axis=0)
    names = {name for name, one in zip(columns.names, used, strict=True) if one} | {*also}
    kept = np.isin(columns.names, [POSITION, *names])
    effects = [name for name in columns.model.effects if name in names]
    few = columns_of(columns.model.array, effects, columns.prior_sd[0])
    return replace(few, prior_sd=columns.prior_sd[kept]), kept


def movable(columns: Columns, active, states) -> np.ndarray:
    """The active parameters (N, m) less those that stay where any gyroscopes' turning is free."""
    if not any(state.gyroscopes_free for state in states):
        return active
    found = active.copy()
    for item in columns.model.chain:
        found[:, columns.of(item.id)[list(item.held_rough)]] = False
    return found


def at(
    readings: Readings, columns: Columns, active, state: State, converged: bool, all_columns=True
) -> Fit:
    """The fit's quantities at a state, with the derivative by every parameter or the active."""
    wanted = np.arange(columns.size) if all_columns else np.flatnonzero(active.any(axis=0))
    seen = linearise(readings, columns, state, wanted)
    return Fit(
        readings, columns, state, active, wanted, seen.residual, seen.whitened, seen.basis,
        seen.expected, seen.unexpected, seen.course, seen.log_volume, seen.misfit, converged,
    )  # fmt: skip


def advance(columns, state, active, step, few, seen: Eliminated, length) -> State:
    """The state after a step of the active parameters, and the motion's own.

    ``length`` is the share of the parameters' step that is taken.
    """
    step = length * step
    blocks = np.zeros(few.shape)
    blocks[few] = step
    along = np.einsum("tkim,km->tki", seen.whitened, blocks, optimize=True)
    moved = (along.reshape(len(along), 1, -1) @ seen.basis)[:, 0]
    moved += np.einsum("tdi,tikm,km->td", seen.expected, seen.course, blocks, optimize=True)
    move = np.einsum("tji,tj->ti", seen.inverse, seen.taken - moved)
    return stepped(state._replace(motion=state.motion + move), columns, active, step)


def stepped(state: State, columns: Columns, active, step) -> State:
    """The state after a step (n,) of the ``active`` parameters (N, m) bool."""
    whole = flat_parameters(columns, state)
    whole[active] += step
    return from_flat(columns, state, whole)


def scaled_solve(information, right):
    """(solution, sds) of a positive definite system, scaled to a unit diagonal first."""
    values, vectors, scale = scaled_eigh(information)
    values = np.maximum(values, 1e-13)
    solution = (vectors @ ((vectors.T @ (right / scale)) / values)) / scale
    return solution, np.sqrt(np.sum(vectors**2 / values, axis=1)) / scale


def with_derivatives(readings, state, smooth) -> State:
    """The state with the time derivatives of its own motion, if they are not free."""
    if not smooth:
        return state
    if state.turning is not None:
        state = turned(readings, state, bool(state.turning.follows.any()))
    found = derivatives(readings, state.motion, state.positions)
    return state._replace(derivatives=found)


def with_rough_prior(readings: Readings, state: State) -> State:
    """The state with omega double dot and s dot free: neighbours determine them only roughly.

    Their prior has the polynomials' mean, and for sd ten times the size of the differences near by.
    It is that of the first motion and stays: one that followed the fit would shrink with it.
    What the gyroscopes' omega dot may have of its own is as large as twice the step from a sample
    to the next, once it is `freed`.
    """
    dt = np.median(np.diff(readings.time))
    found = derivatives(readings, state.motion, state.positions)
    mean = np.hstack([*found[:2], np.zeros_like(found[0])])
    steps = np.diff(state.motion[:, 3:], axis=0, append=state.motion[-1:, 3:]) / dt
    steps[np.diff(readings.run, append=readings.run[-1]) > 0] = 0.0
    near = uniform_filter1d(np.mean(steps.reshape(-1, 2, 3) ** 2, axis=-1), SETTINGS.near, axis=0)
    size = np.repeat(np.sqrt(near) + 0.1 * np.sqrt(near.mean(axis=0)), 3, axis=1)
    own = SETTINGS.gyroscopes_own * dt * size[:, :3]
    sd = np.hstack([SETTINGS.wide * size, SETTINGS.tied * own])
    nothing = no_derivatives(len(mean), len(state.positions))
    return state._replace(
        motion=np.hstack([state.motion, mean]), derivatives=nothing,
        rough_prior=RoughPrior(mean, sd, own),
    )  # fmt: skip


def with_free_gyroscopes(readings: Readings, state: State) -> State:
    """The state where all that gyroscopes see of rough motion is free: to third order, and omega.

    The sds are where an `estimate` begins, which sizes them.
    """
    prior = state.rough_prior.freed()
    dt, nothing = np.median(np.diff(readings.time)), np.zeros((len(readings.time), 6))
    third = SETTINGS.wide / (SETTINGS.gyroscopes_own * dt) * prior.own
    sd = np.hstack([prior.sd, third, SETTINGS.offset * prior.own])
    return state._replace(
        motion=np.hstack([state.motion, nothing]),
        rough_prior=prior._replace(mean=np.hstack([prior.mean, nothing]), sd=sd),
    )


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
    model = columns.model
    shapes = {e.id: s for e, s in zip(model.chain, model.shapes, strict=True)}
    values = {n: whole[: s[0], columns.of(n)].reshape(s) for n, s in shapes.items()}
    positions = whole[: len(state.positions), columns.of(POSITION)]
    return state._replace(positions=positions, parameters=columns.model.join(values))


def prior_means(readings: Readings, columns: Columns) -> np.ndarray:
    """(N, m): nominal positions, no effect."""
    out = np.zeros(columns.owner.shape)
    nominal = readings.array.relative
    out[: len(nominal), columns.of(POSITION)] = nominal
    return out
