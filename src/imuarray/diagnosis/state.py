"""The state of a search for causes: what is adopted, the fit it leads to, and what is still needed.

It is frozen: each step of the procedure makes another one of it. Adopted effects are tested against
zero, and on held-out time.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from typing import Self

import numpy as np

from imuarray.diagnosis import noise as noises
from imuarray.diagnosis.fit import Fit, at, likely_sizes, normal_blocks, search_optimum
from imuarray.diagnosis.scores import Candidate, Information, detectable, information_at
from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.clocks import CLOCK, estimated_again, started_by_gyroscopes, without_jumps
from imuarray.engine.estimate import Recorded
from imuarray.engine.heldout import gains_of, summed
from imuarray.engine.linearise import State
from imuarray.engine.parameters import POSITION, Columns
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS as CLOCKS
from imuarray.engine.widths import residual_map_mask, spread_of
from imuarray.model.effects import EFFECTS
from imuarray.tails import log_chi_square


@dataclass(frozen=True)
class Cause:
    """An adopted effect: its IMUs, forms, log p, and what of that was for so many tests (nats)."""

    effect: str
    imus: tuple[int, ...]
    variants: frozenset[str]
    log_p: float
    tries: float = 0.0


def weigh(made: Fit, correlation) -> Information:
    """Score and information of all parameters that a fit has derivatives by.

    ``correlation`` (N, 2) of the noise in time. The score's covariance has what a correction left
    of maps and offsets, much of which all sensors share.
    """
    plain = information_at(made)
    meat = noises.coloured_meat(made, plain.information, correlation)
    # fitted ones, too: put back to zero they are what the others are; refitted, nothing is left
    mask = residual_map_mask([made.readings.left], made.columns, False) & made.described
    if mask.any():
        cross = plain.information[:, plain.places(mask)]
        spread = spread_of(made.readings.left, made.columns, mask)
        meat = (plain.information if meat is None else meat) + cross @ spread @ cross.T
    return plain if meat is None else replace(plain, meat=meat, correlation=correlation)


@dataclass(frozen=True)
class Search:
    """The state of a diagnosis."""

    readings: Readings  # those in use, with the noise sds in use
    columns: Columns  # of all parameters that are described
    effects: tuple[str, ...]  # ids that may be adopted
    notify: Callable[[str], None]  # is told of every step
    smooth: bool = True  # whether the motion's derivatives may be had from neighbouring samples
    causes: tuple[Cause, ...] = ()  # what is adopted, in order
    fit: Fit | None = None  # of what is adopted
    noise: noises.Noise | None = None
    weighed: Callable[[], Information] | None = None  # at the fit, made once: not all are tested
    refused: frozenset[Candidate] = frozenset()  # what did not gain
    excess: float = 0.0  # of the misfit over its degrees of freedom, before any cause
    jumps: np.ndarray | bool = False  # (T, N, 6) bool, readings left out near a clock's jump
    allowed: np.ndarray | None = None  # (T, N, 6) bool, readings that count, outliers included
    trace: tuple[tuple[str, float], ...] = ()  # (effect, nats gained) of each adoption
    detectable: dict[str, dict] = field(default_factory=dict)  # as `scores.detectable` has it

    @cached_property
    def active(self) -> np.ndarray:
        """Positions and what the causes free, (N, m) bool."""
        mask = self.columns.mask([POSITION])
        for cause in self.causes:
            for variant in cause.variants:
                mask |= Candidate(cause.effect, cause.imus, variant).mask(self.columns)
        return mask

    @property
    def given(self) -> Information:
        """Score and information at the present fit."""
        return self.weighed()

    def imus_with(self, effect: str) -> tuple[int, ...]:
        """IMUs for which an effect is adopted."""
        return next((cause.imus for cause in self.causes if cause.effect == effect), ())

    @property
    def offered(self) -> list[str]:
        """Effects that may be adopted now: some only beside another."""
        there = {"", *(cause.effect for cause in self.causes)}
        return [effect for effect in self.effects if EFFECTS[effect].beside in there]

    @property
    def clocks(self) -> tuple[int, ...]:
        """IMUs with an adopted clock."""
        return self.imus_with(CLOCK)

    @property
    def left(self) -> float:
        """Excess of the misfit over its degrees of freedom."""
        return max(self.fit.misfit - self.fit.free, 0.0)

    @property
    def least(self) -> float:
        """The least chi-square of a cause: a share of what is left, and a trace of what there was.

        The second order of a huge effect leaves something that smaller ones would take up, and
        rough motion leaves more.
        """
        share = SETTINGS.share * (1.0 if self.smooth else SETTINGS.rough_share)
        return max(share * self.left, SETTINGS.trace * self.excess)

    @property
    def least_z(self) -> float:
        """Standard errors that a cause's gain on held-out time must have."""
        return SETTINGS.least_z if self.smooth else SETTINGS.rough_z

    def fitted(self) -> Self:
        """With the papers' model fitted."""
        begun = Recorded.of(self.readings, self.columns)
        search = replace(self, allowed=self.readings.keep, smooth=begun.smooth).refit(begun.state)
        return replace(search, excess=search.left)

    def with_sizes(self) -> Self:
        """With the sizes of effects that would have been named."""
        return replace(self, detectable=detectable(self))

    def light(self) -> Self:
        """The search without the derivatives that its next fit makes anew."""
        return replace(self, fit=self.fit.only_active(), weighed=None)

    def refit(
        self, state: State | None = None, turns=2, rough=True, sizings=SETTINGS.sizings
    ) -> Self:
        """Fit what is adopted, with the noise that the residual's fast part shows."""
        state = self.fit.state if state is None else state
        search, turns = self, turns + bool(self.clocks)
        for turn in range(turns + 2):
            width = SETTINGS.jitter if state.gyroscopes_free else CLOCKS.edge / (1 + turn)
            readings, jumps = without_jumps(
                search._with_jumps, search.columns, state, search.clocks, width
            )
            search = replace(search, readings=readings, jumps=jumps)
            state, converged, linearised = search_optimum(
                readings, search.columns, search.active, state, search.smooth, rough
            )
            found = noises.estimated(readings, linearised.residual, linearised.basis)
            del linearised  # large
            change = np.max(np.abs(found.sd / readings.sd - 1)[readings.exists])
            enough = turn > 0 or not search.clocks
            limit = SETTINGS.steady_noise
            # the noise beside a model that is far off would never be steady
            near = change < 5 * limit or not converged
            if (change < limit and enough) or (turn + 1 >= turns and near):
                break
            state = estimated_again(search._with_jumps, search.columns, state, search.clocks)
            search = replace(search, readings=readings.with_sd(found.sd))
        made = at(search.readings, search.columns, search.active, state)
        noise = noises.estimated(made.readings, made.residual, made.basis)
        search = search.ending(made, noise)
        columns = likely_sizes(made)
        steady = np.allclose(columns.prior_sd, search.columns.prior_sd, rtol=SETTINGS.steady_size)
        if steady or not sizings or not converged:
            return search
        return replace(search, columns=columns).refit(made.state, turns, rough, sizings - 1)

    @property
    def _with_jumps(self) -> Readings:
        """The readings, those near a clock's jump too."""
        return replace(self.readings, keep=self.readings.keep | self.jumps)

    def ending(self, made: Fit, noise: noises.Noise) -> Self:
        """With a fit, and the noise there."""
        once = cache(partial(weigh, made, noise.correlation))
        return replace(self, fit=made, noise=noise, weighed=once)

    def started(self, effect: str = "", values: dict | None = None) -> State:
        """The present state, dropped effects at zero, ``effect`` at a scan's {imu: ``values``}."""
        columns, state = self.columns, self.fit.state
        whole = columns.flat(state)
        held = np.zeros_like(whole, bool)
        for item in columns.model.chain:
            if item.scanned:
                own = columns.of(item.id)
                held[:, own] = self.active[:, own].any(axis=1, keepdims=True)
        whole[~self.active & ~held] = 0.0
        whole[: len(state.positions), columns.of(POSITION)] = state.positions
        chosen = columns.of(effect)
        if effect == CLOCK and values is not None and state.rough_prior is not None:
            # clocks that are there already are estimated again, all as one
            values = {imu: whole[imu, chosen] for imu in self.clocks} | values
            state, values = started_by_gyroscopes(self.readings, state, values)
        for imu, value in (values or {}).items():
            whole[imu, chosen] = value
        return columns.unflat(state, whole)


def freed_mask(search: Search, effect: str, imus=None, among=None) -> np.ndarray:
    """An adopted effect's free parameters (N, m) bool, of some IMUs or ``among`` its columns."""
    mask = search.active & search.columns.mask([effect], imus)
    return mask if among is None else mask & np.isin(np.arange(search.columns.size), among)


def need(search: Search, effect: str, imus=None, among=None, without=()) -> tuple[float, int]:
    """(chi-square, degrees of freedom) of an adopted effect against zero, all else refitted.

    Of some ``imus``, or ``among`` its columns, where other IMUs are ``without`` it.
    """
    mask, given = freed_mask(search, effect, imus, among), search.given
    gone = mask | freed_mask(search, effect, list(without))
    left = search.active & ~gone
    freed, active = given.places(mask), given.places(left)
    # where that is not all that a mean was pinned of, none is
    precision = given.precision.copy()
    precision[np.ix_(active, active)] = search.columns.prior_precision(left)
    given = replace(given, precision=precision)
    return given.test(given.conditional(active, given.places(gone), freed), freed)


def heldout_gain(
    search: Search, effect: str, parts=None, imus=None, there=False
) -> tuple[float, float]:
    """Nats gained on held-out blocks of time by an adopted effect, with standard error.

    ``parts``: the blocks' equations, if known; of some ``imus``, beside what is ``there`` (N, m).
    """
    columns, mask = search.columns, search.active
    freed = freed_mask(search, effect, imus) & ~np.asarray(there)
    values = columns.flat(search.fit.state)[mask]
    parts = normal_blocks(search.fit, mask) if parts is None else parts
    rest, alone = ~freed[mask], np.zeros((len(values), len(values)))
    alone[np.ix_(rest, rest)] = columns.prior_precision(mask & ~freed)
    prior = columns.prior_precision(mask), columns.prior_means()[mask]
    return summed(gains_of(parts, prior, values, ~rest, rival=alone))


def prune(search: Search, effect: str) -> Search:
    """The search with an effect kept for those IMUs that need it, where they are the fewer."""
    imus = search.imus_with(effect)
    keep = _fewest(search, effect, imus) if len(imus) > 2 else ()
    if not keep:
        return search
    rest = [imu for imu in imus if imu not in keep]
    causes = tuple(
        replace(cause, imus=keep) if cause.effect == effect else cause for cause in search.causes
    )
    pruned = replace(search, causes=causes)
    state = pruned.started(effect)
    whole = search.columns.flat(state)
    whole[np.ix_(rest, search.columns.of(effect))] = 0.0
    pruned = pruned.refit(search.columns.unflat(state, whole))
    if search.smooth:
        return pruned
    gains = [heldout_gain(one, effect)[0] for one in (pruned, search)]
    return pruned if gains[0] > SETTINGS.pruned * gains[1] else search


def _fewest(search: Search, effect: str, imus) -> tuple[int, ...]:
    """The fewest IMUs beside which the rest do not need an effect; none if they are the more.

    Rough motion leaves what is significant in all, and predicts nothing: the rest must not gain
    clearly on held-out time.
    """
    parts = None if search.smooth else normal_blocks(search.fit, search.active)
    common = any(item.id == effect for item, _ in search.columns.gauges(search.active))
    order, limit = _most_first(search, effect, imus, common, parts), SETTINGS.limit(effect)
    for number in range(1, (len(imus) - common) // 2 + 1):
        keep, rest = order[:number], order[number:]
        if search.smooth:  # one IMU alone is the usual fault: the others must clearly have it
            alike = SETTINGS.others if number > 1 or common else limit
            needs = needed(search, effect, alike, rest)
        else:
            gain, error = heldout_gain(search, effect, parts, rest)
            needs = gain >= search.least_z * error
        if not needs:
            # of what all have, half may seem to have none: those who have it alone all need it
            sure = limit - np.log(len(imus))
            free = common or not search.smooth
            alone = free or all(needed(search, effect, sure, [imu], rest) for imu in keep)
            return tuple(sorted(keep)) if alone else ()
    return ()


def _most_first(search: Search, effect: str, imus, common: bool, parts) -> list[int]:
    """The IMUs with an effect, those that need it most first."""
    if common:  # a common part is nobody's, so none has it by itself: those far from most go first
        columns = search.columns
        size = (columns.flat(search.fit.state) / columns.prior_sd)[list(imus)]
        size = size[:, columns.of(effect)]
        own = np.sum((size - np.median(size, axis=0)) ** 2, axis=1)
    elif search.smooth:
        own = [need(search, effect, [imu])[0] for imu in imus]
    else:
        own = [heldout_gain(search, effect, parts, [imu])[0] for imu in imus]
    return [imus[place] for place in np.argsort(own)[::-1]]


def needed(search: Search, effect: str, limit: float, imus=None, without=()) -> bool:
    """True where an adopted effect is significant beside all else, as `need` has it."""
    statistic, freedom = need(search, effect, imus, without=without)
    return bool(freedom) and log_chi_square(statistic, freedom) < limit


def eliminate(search: Search, others=()) -> Search:
    """Causes that are not needed beside each other and the ``others`` go, one after the other."""
    for cause in search.causes:
        small = need(search, cause.effect)[0] < search.least
        beside = len(search.causes) + len(others) > 1
        limit = SETTINGS.limit(cause.effect, beside) - beside * cause.tries
        if small or not needed(search, cause.effect, limit):
            search.notify(f"dropped {cause.effect}: not needed beside the others")
            rest = tuple(other for other in search.causes if other.effect != cause.effect)
            search = replace(search, causes=rest)
            search = search.refit(search.started())
    return search
