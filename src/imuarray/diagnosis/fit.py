"""Least squares on one recording, with the derivatives that score tests of causes need."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from imuarray.engine.alike import sized_groups, with_likely_spread
from imuarray.engine.clocks import DELAY, delay_parts
from imuarray.engine.heldout import Scores, blocks_of, log_densities, scores_of
from imuarray.engine.linearise import State, leverage_of, linearise, projection_of, relinearised
from imuarray.engine.normal import score_of, summed_normal
from imuarray.engine.parameters import Columns, stepped
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS
from imuarray.engine.start import with_derivatives
from imuarray.linear import scaled_solve


@dataclass(frozen=True)
class Fit:
    """A model fitted to readings; arrays from ``residual`` on as `Eliminated` has them."""

    readings: Readings
    columns: Columns
    state: State
    active: np.ndarray  # (N, m) bool, the parameters that were fitted
    wanted: np.ndarray  # (w,) the columns that derivatives are by
    residual: np.ndarray  # (T, N, 6) in noise sds
    whitened: np.ndarray  # (T, N, 6, w)
    basis: np.ndarray  # (T, 6 N, D)
    expected: np.ndarray
    innovation: np.ndarray
    prior_slope: np.ndarray
    log_volume: np.ndarray  # (T,)
    misfits: np.ndarray  # (T,)

    @property
    def misfit(self) -> float:
        """Misfit of all samples."""
        return float(np.sum(self.misfits))

    @property
    def leverage(self) -> np.ndarray:
        """Share of each reading's variance that the motion takes up, (T, N, 6)."""
        return leverage_of(self.basis)

    @property
    def precision(self) -> np.ndarray:
        """Prior precision (n, n) of the active parameters, gauges pinned."""
        return self.columns.prior_precision(self.active)

    def less_motion(self, values) -> np.ndarray:
        """Whitened readings (T, N, 6) without what the motion can explain of them."""
        flat = values.reshape(len(values), -1, 1)
        absorbed = np.swapaxes(self.basis, 1, 2) @ flat
        return (flat - self.basis @ absorbed).reshape(values.shape)

    @property
    def described(self) -> np.ndarray:
        """(N, m) bool: the parameters that there are derivatives by."""
        return self.columns.owner & np.isin(np.arange(self.columns.size), self.wanted)

    def only_active(self) -> Self:
        """The fit with derivatives by the active parameters' columns alone."""
        kept = self.active.any(axis=0)[self.wanted]
        return replace(
            self, wanted=self.wanted[kept], whitened=self.whitened[..., kept],
            prior_slope=self.prior_slope[..., kept],
        )  # fmt: skip

    def along(self, step) -> np.ndarray:
        """Change of the whitened readings (T, N, 6) with the wanted parameters' step (N, m)."""
        moved = step[:, self.wanted]
        used = moved.any(axis=0)
        return np.einsum("tkim,km->tki", self.whitened[..., used], moved[:, used], optimize=True)

    def normal(self, chosen, part=slice(None)) -> tuple[np.ndarray, np.ndarray]:
        """Information (n, n) and score (n,) of the ``chosen`` (N, m) bool, of some samples."""
        return summed_normal(self, chosen[:, self.wanted], part)

    def projected(self, columns) -> np.ndarray:
        """(T, N, D, n) some columns' coordinates in the motion's basis."""
        place = np.searchsorted(self.wanted, columns)
        return projection_of(self.basis, self.whitened[..., place])

    @property
    def free(self) -> int:
        """Degrees of freedom left: readings less motion less fitted parameters."""
        used = int(self.readings.keep.sum())
        motion = 9 if self.state.turning is None else 6
        return used - motion * len(self.residual) - int(self.active.sum())


def fit(
    readings: Readings, columns: Columns, active, state: State, smooth=True, rough=False,
    all_columns=True,
) -> Fit:  # fmt: skip
    """Gauss-Newton over motion and the active parameters from a state, priors included.

    ``smooth``: whether the motion's time derivatives may be had from its neighbours; ``rough``: it
    may stop when a step gains little; ``all_columns`` as for `at`.
    """
    state, *_ = search_optimum(readings, columns, active, state, smooth, rough)
    return at(readings, columns, active, state, all_columns)


def search_optimum(readings, columns, active, state, smooth, rough):
    """(state, whether it converged, the recording as seen there or a step before).

    A step from the derivatives of one before it is enough where what is left is noise; where a
    model lacks something, what is left moves the optimum as these change.
    """
    whole, active = columns, columns.movable(active, [state])
    columns, kept = whole.in_use(active, state)
    parameters, active = whole.flat(state), active[:, kept]
    state = columns.unflat(state, parameters[:, kept])
    prior_mean = columns.prior_means()[active]
    precision = columns.prior_precision(active)
    wanted = np.flatnonzero(active.any(axis=0))
    few = active[:, wanted]
    converged, last, length, linearised, near, predicted = False, np.inf, 1.0, None, False, np.inf
    enough = SETTINGS.rough_gain if rough else SETTINGS.fine_gain
    noisy = SETTINGS.noisy * (readings.keep.sum() - state.motion.size)
    for number in range(SETTINGS.steps):
        state = with_derivatives(readings, state, smooth)
        if near:
            linearised = relinearised(readings, columns, state, linearised)
            score = score_of(linearised, few)
        else:
            linearised = linearise(readings, columns, state, wanted, linearised)
            information, score = summed_normal(linearised, few)
        misfit, former = float(np.sum(linearised.misfit)), predicted
        offset = columns.flat(state)[active] - prior_mean
        score = score - precision @ offset
        step, sds = scaled_solve(information + precision, score)
        moved = np.max(np.abs(step) / sds, initial=0.0)
        in_motion = float(np.sum(linearised.absorbed**2))
        predicted = score @ step + in_motion
        still = moved < SETTINGS.converged and in_motion < 0.01 * len(linearised.absorbed)
        if still or predicted < max(SETTINGS.least_step, enough * misfit):
            # what the last step leaves is of second order in what it predicted
            state = advance(columns, state, active, step, few, linearised, 1.0)
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
        state = advance(columns, state, active, step, few, linearised, length)
    parameters[:, kept] = columns.flat(state)
    return whole.unflat(state, parameters), converged, linearised


def advance(columns, state, active, step, few, linearised, length) -> State:
    """The state after ``length`` of a step of the active parameters, and the motion's own step."""
    step = length * step
    blocks = np.zeros(few.shape)
    blocks[few] = step
    along = np.einsum("tkim,km->tki", linearised.whitened, blocks, optimize=True)
    moved = (along.reshape(len(along), 1, -1) @ linearised.basis)[:, 0]
    expected, slope = linearised.expected, linearised.prior_slope
    moved += np.einsum("tdi,tikm,km->td", expected, slope, blocks, optimize=True)
    move = np.einsum("tji,tj->ti", linearised.inverse, linearised.absorbed - moved)
    return stepped(state._replace(motion=state.motion + move), columns, active, step)


def at(readings: Readings, columns: Columns, active, state: State, all_columns=True) -> Fit:
    """The fit's quantities at a state, with the derivative by every parameter or the active."""
    wanted = np.arange(columns.size) if all_columns else np.flatnonzero(active.any(axis=0))
    made = linearise(readings, columns, state, wanted)
    return Fit(
        readings, columns, state, active, wanted, made.residual, made.whitened, made.basis,
        made.expected, made.innovation, made.prior_slope, made.log_volume, made.misfit,
    )  # fmt: skip


def likely_sizes(fit: Fit, equations=None) -> Columns:
    """The columns of a fit, its sized effects as large as is likeliest by its ``equations``."""
    columns, active = fit.columns, fit.active
    if not np.any(sized_groups(columns)[active.any(axis=0)] != ""):
        return columns
    every = np.arange(active.sum())
    values, means = columns.flat(fit.state)[active], columns.prior_means()
    inner, score = equations or fit.normal(active)
    right = score + inner @ values
    for _ in range(SETTINGS.iterations):
        precision, last = columns.prior_precision(active), columns.prior_sd
        values, _ = scaled_solve(inner + precision, right + precision @ means[active])
        columns = with_likely_spread(columns, active, values, inner + precision, every)
        if np.allclose(columns.prior_sd, last, rtol=SETTINGS.same_noise):
            break
    return columns


def normal_blocks(fit: Fit, active) -> list[tuple[np.ndarray, np.ndarray]]:
    """(information (n, n), score (n,)) of the n ``active`` (N, m) parameters from each block."""
    return [fit.normal(active, block) for block in blocks_of(len(fit.residual))]


def log_scores(fit: Fit) -> Scores:
    """Scores of a fit under normal noise."""
    nats = log_densities(
        fit.readings, fit.state, fit.residual, fit.misfits, fit.log_volume, (np.inf, np.inf)
    )
    return scores_of(nats, normal_blocks(fit, fit.active), fit.precision)


def delay_score(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Each sample's score and information of each IMU's delay, (T, N) each, motion projected."""
    column = int(fit.columns.of(DELAY)[0])
    return delay_parts(fit.residual, fit.whitened[..., column], fit.projected([column])[..., 0])
