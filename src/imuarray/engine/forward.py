"""The standard sensor model: what most boards need, each group kept where held-out time gains."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtrc

from imuarray.engine import widths
from imuarray.engine.clocks import CLOCK, refined, shown_clocks, timed, with_clocks
from imuarray.engine.estimate import Estimate, Recorded, Tested, estimate, pinned, tested
from imuarray.engine.heldout import gains_of, summed
from imuarray.engine.linearise import State
from imuarray.engine.parameters import POSITION, Columns, columns_of
from imuarray.engine.readings import Readings, most_informative
from imuarray.engine.settings import SETTINGS
from imuarray.engine.start import gain_error, turned
from imuarray.errors import InputError
from imuarray.linear import scaled_inverse
from imuarray.model.effects import EFFECTS

CLOCKS, DELAYS, GYROSCOPES = "clocks of the IMUs", "delay of each IMU", "gyroscope maps"
LAG, FILTER = "lag of the gyroscopes", "filter of the gyroscopes"
BAND, OWN = "filter of all sensors", "filter of each accelerometer"
CURVE, SQUARE = "curve of the gyroscopes", "rates in accelerometers"
EFFECT_GROUPS = {
    CLOCKS: (CLOCK,),
    "offsets": widths.OFFSETS,
    DELAYS: ("sensor_delay",),
    LAG: ("gyroscope_delay",),
    FILTER: ("gyroscope_filter",),
    BAND: ("accelerometer_band",),
    OWN: ("accelerometer_filter",),
    CURVE: ("gyroscope_curve",),
    GYROSCOPES: ("gyroscope_scale", "gyroscope_misalignment"),
    SQUARE: ("accelerometer_rate_square",),
    "lever arms of the axes": ("size_effect",),
}
# Where motion is rough, what the gyroscopes see of it is free, and these are in that.
ROUGH_GROUPS = {name: ids for name, ids in EFFECT_GROUPS.items() if not EFFECTS[ids[0]].smooth}


class EffectGroup(NamedTuple):
    """A group and its gain on held-out time: nats, their standard error; whether it is kept."""

    name: str
    gain: float
    error: float
    kept: bool


def with_effects(readings: Sequence[Readings], effects) -> Estimate:
    """Positions and all parameters of some effects; InputError where they are not a triad's own."""
    columns = columns_of(readings[0].array, tuple(effects), readings[0].position_prior_sd)
    if not columns.model.apart:
        raise InputError(
            f"effects: expected such as change their own triad's readings alone, found"
            f" {', '.join(effects)}"
        )
    active = columns.mask([POSITION, *effects])
    recorded = [Recorded.of(one, columns) for one in readings]
    return widths.widened(estimate(recorded, columns, active))


def resumed(readings: Readings, columns: Columns, active, state: State) -> Estimate:
    """The robust estimate of the ``active`` parameters (N, m) bool, from ``state``.

    With columns for what the model has, and for maps that first order may have left.
    """
    maps = widths.corrected(readings.left)
    few, kept = columns.in_use(active, state, maps)
    state = few.unflat(state, columns.flat(state)[:, kept])
    columns, active = few, active[:, kept]
    recorded = Recorded.of(most_informative(readings, lambda text: None), columns, state)
    values = columns.flat(state)
    common = [
        np.sum(mask * values) / np.sum(mask)
        for item, mask in columns.gauges(active) if item.resizes and item.kinds == [1]
    ]  # fmt: skip
    # pinned it would be some 1e-5: slopes have shown it; of a pair they are all there is
    if recorded.smooth and (readings.pair or np.any(np.abs(common) > SETTINGS.stiff / 10)):
        recorded = replace(recorded, state=turned(recorded.readings, recorded.state, follows=True))
    imus = np.flatnonzero(active[:, columns.of(CLOCK)].any(axis=1))
    if imus.size:
        recorded = timed(recorded, recorded.readings.keep, columns, imus)
    return widths.widened(estimate([recorded], columns, active))


def _slow(one: Recorded) -> bool:
    """True of smooth motion: of a pair, whose omega_dot is its rate's slope, by that alone."""
    readings, rate = one.readings, one.state.motion[:, :3]
    if not (one.smooth and readings.pair):
        return one.smooth
    return abs(gain_error(readings, rate, readings.window, 4)) < SETTINGS.slow_enough


def groups_of(readings: Sequence[Readings]) -> list[str]:
    """Rungs that recordings may determine: none of fewer samples than two in a block."""
    if sum(len(one.time) for one in readings) < 2 * SETTINGS.blocks:
        return []
    smooth = all(one.gapless for one in readings)
    return [name for name in EFFECT_GROUPS if smooth or not _needs_neighbours(name)]


def _needs_neighbours(group: str) -> bool:
    return any(EFFECTS[effect].derivatives for effect in EFFECT_GROUPS[group])


def select_forward(
    readings: Sequence[Readings], plain: bool = True
) -> tuple[Estimate, list[EffectGroup]]:
    """The sensor model of a board from its recordings, group by group.

    Each sweep tests the groups in order, beside those that it has kept before; what is kept is
    fitted, then the others are tested again. At last each must still gain beside all others, but
    for clocks, whose jumps a fit does not move, and for what the estimate of another calls for
    (`Selected.needed`). Where motion is smooth and no sensor late, the rate's own change is then a
    prior of omega_dot. ``plain``: whether the last fit is wanted where no group is kept; else it is
    to be sampled from, by a density that has no such change. InputError or LinAlgError where the
    readings do not determine positions or motion.
    """
    names = [name for name in groups_of(readings) if plain or name != OWN]
    columns, begun = _begun(readings, names)
    rough = [name for name in names if name in ROUGH_GROUPS]
    if rough != names and not all(map(_slow, begun)):
        names, (columns, begun) = rough, _begun(readings, rough)
    found = estimate(begun, columns, columns.mask([POSITION]), steps=SETTINGS.group_steps)
    now = Selected(found, tuple(one.readings.keep for one in begun), {})
    clocks, groups = [], []
    for _ in names:
        before = set(now.kept)
        if CLOCKS in names and CLOCKS not in now.kept:
            now, clocks = now.clocked()
        groups = now.tried(names)
        now = now.with_kept([group.name for group in groups if group.kept])
        if set(now.kept) == before:
            needed = now.needed(names, {group.name for group in groups if group.kept})
            groups = [group._replace(kept=group.kept or group.name in needed) for group in groups]
            now = now.with_kept(needed)
            break
        now = now.fitted(SETTINGS.rung_again)
    now = now.without([group.name for group in groups if not group.kept])
    if not (now.kept or plain):
        return now.found, clocks + groups
    found = now.fitted().found
    late = any(map(_needs_neighbours, now.kept)) or (GYROSCOPES in now.kept and not plain)
    if all(one.smooth for one in found.recorded) and (readings[0].pair or not late):
        found, curved = _with_slope(found, now.kept, CURVE in names)
        groups = [*groups, *curved.values()]
    return widths.widened(found), clocks + groups


def _with_slope(found: Estimate, kept: dict, curve: bool) -> tuple[Estimate, dict]:
    """With the rate's own change as a prior of omega_dot, where that is of one truth with readings.

    Angular acceleration is largest where rates are small, so that it tells a gyroscope whose scale
    changes with the rate from a larger array: whether a ``curve`` is tested; {group: its gain}.
    """
    begun = [
        replace(one, state=turned(one.readings, one.state, follows=True)) for one in found.recorded
    ]
    better, pair = estimate(begun, found.columns, found.active), found.recorded[0].readings.pair
    shown: dict[str, EffectGroup] = {}
    if pair:
        return better, shown
    if better.residual_ratio() >= SETTINGS.slope_agrees * found.residual_ratio():
        return found, shown
    slopes = [one.state.turning for one in begun]
    told = all(np.median(x.sd) < SETTINGS.known_slope * np.sqrt(np.mean(x.mean**2)) for x in slopes)
    if curve and told:
        mask = found.columns.mask(EFFECT_GROUPS[CURVE])
        (group,) = gains(better, {CURVE: mask}, kept)
        group = group._replace(kept=group.kept and group.gain > SETTINGS.curved_nats)
        if group.kept:
            return estimate(better.recorded, found.columns, found.active | mask), {CURVE: group}
        shown = {CURVE: group}
    return better if _of_one_truth(found, better) else found, shown


def _begun(readings: Sequence[Readings], names) -> tuple[Columns, list[Recorded]]:
    """Columns for some groups and for what corrections left, and where a search begins."""
    effects = [effect for name in names for effect in EFFECT_GROUPS[name]]
    effects += [
        name for name in widths.corrected(*(one.left for one in readings)) if name not in effects
    ]
    columns = columns_of(readings[0].array, effects, readings[0].position_prior_sd)
    return columns, [Recorded.of(one, columns) for one in readings]


class Selected(NamedTuple):
    """Forward selection so far: ``kept`` {group: (N, m) bool}, ``keep`` of each recording."""

    found: Estimate
    keep: tuple[np.ndarray, ...]
    kept: dict[str, np.ndarray]

    @property
    def active(self) -> np.ndarray:
        """Parameters (N, m) of the positions and of what is kept.

        A clock has an offset, which with one of its gyroscope its accelerometer's lag would be.
        """
        columns = self.found.columns
        found = np.any([columns.mask([POSITION]), *self.kept.values()], axis=0)
        if not {OWN, LAG} <= self.kept.keys():
            return found
        clocked = (found & columns.mask([CLOCK])).any(axis=1, keepdims=True)
        return found & ~(self._first(OWN) & clocked)

    def _first(self, group: str) -> np.ndarray:
        """(N, m) bool of a group's shift of time: its first parameter of each IMU."""
        columns = self.found.columns
        return columns.mask(EFFECT_GROUPS[group]) & [p == (0,) or not p for p in columns.places]

    @property
    def freed(self) -> dict[str, np.ndarray]:
        """The parameters (N, m) of each group that is kept which are `active`."""
        return {name: mask & self.active for name, mask in self.kept.items()}

    def with_kept(self, names) -> Self:
        """With more groups kept; lags of each accelerometer and gyroscope say what delays do."""
        new = {name: self.found.columns.mask(EFFECT_GROUPS[name]) for name in names}
        kept = new | self.kept
        if {OWN, LAG} <= kept.keys():
            kept.pop(DELAYS, None)
        return self._replace(kept=kept)

    def without(self, names) -> Self:
        """Without some of those kept, their parameters back at zero."""
        now = self._replace(kept={n: mask for n, mask in self.kept.items() if n not in names})
        return now._replace(found=replace(self.found, recorded=now._emptied()))

    def _emptied(self) -> tuple[Recorded, ...]:
        """The recordings, with what was fitted and is no more at zero, delays in lags instead."""
        found, recorded = self.found, []
        gone = found.active & ~self.active
        for one in found.recorded:
            whole = found.columns.flat(one.state)
            if {OWN, LAG} <= self.kept.keys():
                late = np.sum(whole * (gone & self._first(DELAYS)), axis=1, keepdims=True)
                late *= (self.active & self._first(OWN)).any(axis=1, keepdims=True)
                whole += late * (self.active & (self._first(OWN) | self._first(LAG)))
            whole[gone] = 0.0
            recorded.append(replace(one, state=found.columns.unflat(one.state, whole)))
        return tuple(recorded)

    def tried(self, names) -> list[EffectGroup]:
        """Gains of the groups, but of those that others say, and `_with_slope`'s."""
        part = {CLOCK, *EFFECTS[CLOCK].contains} if CLOCKS in self.kept else {CLOCK}
        part |= {*EFFECT_GROUPS[DELAYS]} if {OWN, LAG} <= self.kept.keys() else set()
        asked = [n for n in names if n != CURVE and not set(EFFECT_GROUPS[n]) <= part]
        masks = {name: self.with_kept([name]).freed[name] for name in asked}
        # a pair's filter takes up what a delay leaves: it is for `needed` to say
        pair = self.found.recorded[0].readings.pair
        return gains(self.found, masks, self.freed, FILTER if pair else "")

    def needed(self, names, kept) -> list[str]:
        """Groups that the estimate of one of those ``kept`` calls for.

        Gyroscope maps at odds with those of first order; beside a lag the shape of filters, however
        uncertain that is: what lags droops.
        """
        chance, _ = widths.widened(self.found).maps_hold.get("gyroscope", (1.0, []))
        found = [GYROSCOPES] * (chance < SETTINGS.chance) + [FILTER, BAND] * (LAG in kept)
        return [name for name in found if name in names]

    def clocked(self) -> tuple[Self, list[EffectGroup]]:
        """With clocks, if IMUs' ages show some and these gain; and that group, if there is one."""
        columns, recorded = self.found.columns, self.found.recorded
        each = [shown_clocks(one, columns) for one in recorded]
        imus = sorted(set().union(*each))
        if not imus or not self.clocks_beside_delays():
            return self, [EffectGroup(CLOCKS, 0.0, 0.0, False)]
        hinted = tuple(
            with_clocks(one, columns, own) for one, own in zip(recorded, each, strict=True)
        )
        now = self._replace(found=replace(self.found, recorded=hinted))
        mask = columns.mask([CLOCK], imus)
        group = gains(now.found, {CLOCKS: mask}, self.freed)[0]
        return (now._replace(kept={CLOCKS: mask} | self.kept) if group.kept else self), [group]

    def clocks_beside_delays(self) -> bool:
        """True where ages show clocks once delays and filters are fitted: their misfit may, too."""
        if not all(one.smooth for one in self.found.recorded):
            return True
        found = self.with_kept([DELAYS, FILTER]).fitted(SETTINGS.rung_again).found
        return any(shown_clocks(one, found.columns) for one in found.recorded)

    def fitted(self, steps: int = SETTINGS.iterations) -> Self:
        """With all that is kept estimated, each reading in its clock's turn.

        In smooth motion from equal weights: those of a model that missed something keep the tails
        that it had.
        """
        columns, recorded = self.found.columns, self._emptied()
        if all(one.smooth for one in recorded):
            recorded = tuple(replace(one, readings=one.readings.unweighted()) for one in recorded)
        if CLOCKS in self.kept:
            imus = np.flatnonzero(self.kept[CLOCKS].any(axis=1))
            recorded = [
                timed(refined(one, keep, columns, imus), keep, columns, imus)
                for one, keep in zip(recorded, self.keep, strict=True)
            ]
        return self._replace(found=estimate(recorded, columns, self.active, steps=steps))


def _left(found: Estimate) -> list[tuple[np.ndarray, np.ndarray]]:
    """[(mask (N, m), covariance)] of both kinds' maps, and of the offsets, that were corrected.

    Of maps the first recording's stands for all; offsets are each recording's own, one after the
    other. Nothing where not all recordings are corrected.
    """
    every, out = [one.readings.left for one in found.recorded], []
    if any(left is None for left in every):
        return out
    known = widths.residual_map_mask(every, found.columns, False)
    for names in (*zip(widths.SCALES, widths.SKEWS, strict=True), widths.OFFSETS, (widths.DRIFT,)):
        mask = known & found.columns.mask(names)
        if mask.any():
            own = every if EFFECTS[names[0]].own else every[:1]
            spreads = (widths.spread_of(left, found.columns, mask) for left in own)
            out.append((mask, block_diag(*spreads)))
    return out


def _of_one_truth(found: Estimate, more: Estimate) -> bool:
    """True where positions by a prior are where the readings alone may have them."""
    spreads = []
    for one in (found, more):
        placed = one.places[0][np.argwhere(one.active)[:, 1] < 3]
        prior = pinned(one.columns, one.active, one.places, one.values, shown=True)
        known = one.information / widths.lost(one.freedoms) + prior
        spreads.append(scaled_inverse(known)[np.ix_(placed, placed)])
    statistic, freedom = widths.hausman((more.positions - found.positions)[1:].ravel(), *spreads)
    return bool(chdtrc(max(freedom, 1), statistic) > SETTINGS.chance)


def _contradicted(parts, prior, values, freed, spread) -> bool:
    """True where parameters known to be zero within ``spread`` (f, f) come out as others."""
    ridge, mean = prior
    information = sum(part[0] for part in parts) + ridge
    spread = spread + scaled_inverse(information)[np.ix_(freed, freed)]
    slope = sum(part[1] for part in parts) - ridge @ (values - mean)
    off = (np.linalg.solve(information, slope) + values)[freed]
    return bool(chdtrc(len(off), off @ np.linalg.solve(spread, off)) < SETTINGS.chance)


def gains(found: Estimate, masks: dict, kept: dict, never: str = "") -> list[EffectGroup]:
    """Gain of each group on held-out time beside those kept, and those before it that gain.

    ``masks``, ``kept`` {group: (N, m) bool}. By one linearisation with all of them. Maps that first
    order has left are beside them all, as uncertain as it left them: what they explain is no
    group's gain.
    """
    left, smooth = _left(found), all(one.smooth for one in found.recorded)
    every = [*masks.values(), *kept.values(), *(mask for mask, _ in left)]
    active = np.any([found.active, *every], axis=0)
    given, out = tested(found, active), []
    beside = np.any([found.active, *kept.values()], axis=0)
    for name, mask in masks.items():
        one = _tried(name, given, mask, beside, left, smooth)
        out.append(one._replace(kept=one.kept and name != never))
        beside = beside | (mask & out[-1].kept)
    return out


def _tried(name: str, given: Tested, own, beside, left, smooth: bool) -> EffectGroup:
    """A group's gain, and whether it is kept; ``own`` and ``beside`` (N, m) bool."""
    freed, used, ridge = given.chosen(own), given.chosen(beside | own), given.precision.copy()
    nuisance, known = np.zeros(len(used), bool), None
    for mask, spread in left:
        mine = given.chosen(mask)
        if not (mine & used).any():
            nuisance |= mine
            ridge[np.ix_(mine, mine)] = np.linalg.inv(spread)
        elif (mine == freed).all():
            known = spread
    used |= nuisance
    square = np.ix_(used, used)
    parts = [(inner[square], slope[used]) for inner, slope in given.blocks]
    system = parts, (ridge[square], given.means[used]), given.values[used], freed[used]
    nats, error = summed(each := gains_of(*system, nuisance[used]))
    # what moves much in one block gains most there: the error is large, and less a doubt
    steady = smooth and nats - np.max(each) > SETTINGS.steady_nats
    least = SETTINGS.steady_z if steady else SETTINGS.group_z
    good = nats > max(least * error, SETTINGS.group_nats)
    return EffectGroup(
        name, nats, error, bool(good and (known is None or _contradicted(*system, known)))
    )
