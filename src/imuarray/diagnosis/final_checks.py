"""Checks after the last cause: is what is left within tolerance, are causes what they seem?

Where a rail clips several readings they pile up at one value, which needs no model
(`imuarray.diagnosis.reading_effects`); one alone is seen only beside its prediction.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from imuarray.diagnosis import noise_effects
from imuarray.diagnosis.fit import Fit, at
from imuarray.diagnosis.noise import Noise
from imuarray.diagnosis.reading_effects import RAILS, Finding, rails_cause, triads
from imuarray.diagnosis.residual_checks import Check, all_checks, normal_checks
from imuarray.diagnosis.scores import Information
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.special import SPECIAL
from imuarray.diagnosis.state import Search, need
from imuarray.engine.linearise import linearise
from imuarray.engine.readings import Readings
from imuarray.engine.widths import residual_map_mask, spread_of
from imuarray.linear import scaled_solve
from imuarray.model.effects import DATA_EFFECTS, KINDS
from imuarray.tails import log_normal

STRICT = ("outliers", "size of", "change of")  # checks that a small residual does not excuse


class Peak(NamedTuple):
    """A triad's largest reading."""

    imu: int
    kind: int
    at: np.ndarray  # (T, 3) bool: the reading, with any that are as large
    size: float  # SI
    inward: float  # sds by which it falls short of its prediction
    others: float  # sds by which any other reading of the triad is off at most
    apart: float  # ``inward`` less what the next largest readings fall short by, in their own sds


def peaks(search: Search) -> list[Peak]:
    """Peaks of every triad."""
    parts, found = (search.readings.keep, search.readings.values, search.fit.residual), []
    for imu, kind in np.argwhere(search.readings.exists):
        kept, values, residual = (triads(part)[:, imu, kind] for part in parts)
        size = np.where(kept, np.abs(values), 0.0)
        at = size >= size.max() * (1 - 1e-9)
        short = -np.sign(values) * residual
        rest = kept & ~at
        # what bends all large readings alike is no rail
        near = short[rest][np.argsort(size[rest])[-SETTINGS.next_largest :]]
        spread = max(float(np.std(near)), 1.0) * np.sqrt(1 + 1 / SETTINGS.next_largest)
        inward = float(np.max(short[at]))
        others = float(np.max(np.abs(residual)[rest]))
        apart = (inward - float(np.mean(near))) / spread
        found.append(Peak(int(imu), int(kind), at, float(size.max()), inward, others, apart))
    return found


def clipped(found: list[Peak], limit: float) -> tuple[list[Peak], float]:
    """Peaks that fall short far more than anything else does, or all of a kind together."""
    # two at one value are more than an outlier
    off = [p for p in found if p.inward > p.others * (SETTINGS.alone if p.at.sum() == 1 else 1.0)]
    logs = [float(log_normal(p.inward) + np.log(len(found))) for p in off]
    hit = [p for p, log_p in zip(off, logs, strict=True) if log_p < limit]
    least = min((log_p for log_p in logs if log_p < limit), default=0.0)
    for kind in range(len(KINDS)):
        own = [p for p in found if p.kind == kind]
        pooled = sum(p.apart for p in own) / np.sqrt(max(len(own), 1))
        log_p = float(log_normal(pooled) + np.log(len(KINDS)))
        if log_p < min(limit, least) and np.median([p.apart for p in own]) > 1.0:
            hit, least = [p for p in hit if p.kind != kind] + own, log_p
    return hit, least


def leave_out_clips(search: Search, faults, without=()) -> tuple[Search, list[Finding]]:
    """Without readings that fall short of their prediction far more than any other does.

    And the ``faults`` of readings with theirs.
    """
    hit, log_p = ([], 0.0) if RAILS in without else clipped(peaks(search), SETTINGS.check)
    if not hit:
        return search, faults
    lost = np.zeros(search.readings.keep.shape, bool)
    for peak in hit:
        triads(lost)[:, peak.imu, peak.kind] = peak.at
    search = replace(search, readings=search.readings.without(lost)).refit()
    says = "the largest reading alone stays below what it should be, as at a rail"
    found = rails_cause([(peak.imu, peak.kind, peak.size) for peak in hit], log_p, says)
    return replace(search, allowed=search.allowed & ~lost), together(faults, found)


def with_gains(search: Search, raw: Readings, faults: list[Finding]) -> list[Finding]:
    """Faults of whole readings with what they gain; without the doubtful ones that gain nothing.

    Nats by which the readings, as recorded (``raw``), miss the extended model's prediction: nothing
    was fitted to those that were left out, so this is held out as it stands. What the other effects
    of whole readings did stays mended: theirs is not counted here.
    """
    found = []
    for item in faults:
        touched, values = raw.keep & ~search.allowed, search.readings.values
        if not DATA_EFFECTS[item.effect].left_out:  # it is mended
            touched, values = raw.keep & (raw.values != values), raw.values
        mine = np.zeros_like(touched)
        mine[:, list(item.imus)] = touched[:, list(item.imus)]
        readings = replace(search.readings, values=values, keep=search.readings.keep | mine)
        made = at(readings, search.columns, search.active, search.fit.state, all_columns=False)
        nats = (made.misfits - search.fit.misfits - mine.sum(axis=(1, 2))) / 2
        gain, error, blocks = noise_effects.held_out(nats)
        if not item.doubtful or gain > 0:
            found.append(item._replace(gain=gain, gain_se=error, blocks=blocks))
    return found


def together(faults: list[Finding], new: Finding) -> list[Finding]:
    """The faults and one more, with one of the same effect as one cause in that one's words."""
    old = next((item for item in faults if item.effect == new.effect), new)
    imus = tuple(sorted({*old.imus, *new.imus}))
    both = old._replace(imus=imus, log_p=min(old.log_p, new.log_p))
    return [both if item is old else item for item in faults] + [both] * (old is new)


def lone_checks(made: Fit, tailed) -> list[Check]:
    """The reading farthest from its prediction, but for triads whose tails are known."""
    size = np.abs(made.residual)
    for imu, kind, _ in tailed:
        triads(size)[:, imu, kind] = 0.0
    place = np.unravel_index(int(np.argmax(size)), size.shape)
    log_p = log_normal(size[place]) + np.log(2 * size.size)
    return [Check.of("farthest reading", size[place], log_p, place[1])]


def beside_left(search: Search) -> tuple[Fit, Information]:
    """The fit and its information, one step on in maps as uncertain as their correction says."""
    made, given, columns = search.fit, search.given, search.columns
    left = search.readings.left
    maps = residual_map_mask([left], columns, made.active)
    if not maps.any():
        return made, given
    place, every = given.places(maps), made.active | maps
    precision = given.precision.copy()
    precision[np.ix_(place, place)] = np.linalg.inv(spread_of(left, columns, maps))
    offset = columns.flat(made.state) - columns.prior_means()
    both = given.places(every)
    precise = precision[np.ix_(both, both)]
    slope = given.score[both] - precise @ offset[every]
    moved = np.zeros(every.shape)
    moved[every] = scaled_solve(given.information[np.ix_(both, both)] + precise, slope)[0]
    residual = made.residual - made.less_motion(made.along(moved))
    return replace(made, active=every, residual=residual), replace(given, precision=precision)


def final_checks(search: Search, tailed) -> list[Check]:
    """All tests of an extended model; ``tailed``: known mixtures."""
    made, given = beside_left(search)
    checks = all_checks(made, given, search.noise)
    checks += [*outlier_checks(search), *plausibility_checks(search)]
    for cause in search.causes:
        special = SPECIAL.get(cause.effect)
        checks += special.check(search, cause) if special and special.check else []
    return [*checks, *tail_checks(made, search.noise, tailed), *lone_checks(made, tailed)]


def outlier_checks(search: Search) -> list[Check]:
    """Outliers left out: is what they miss tied to the reading's own change, as of a late one?"""
    away = search.allowed & ~search.readings.keep & ~search.jumps
    whole = replace(search.readings, keep=search.allowed)
    # by the motion that was fitted without them: an outlier would be part of its own prediction
    state = search.fit.state
    columns, kept = search.columns.in_use(search.active, state)
    state = columns.unflat(state, search.columns.flat(state)[:, kept])
    # derivatives as the fit had them: compiled already
    made = linearise(whole, columns, state, np.flatnonzero(search.active[:, kept].any(axis=0)))
    motion = np.einsum("tri,ti->tr", made.basis, made.absorbed)
    missed = made.residual + motion.reshape(away.shape)
    predicted = np.nan_to_num(whole.values) / np.repeat(whole.sd, 3, axis=1) - missed
    change = np.diff(predicted, axis=0, prepend=predicted[:1])
    change[np.diff(whole.run, prepend=whole.run[0]) > 0] = 0.0
    products = np.where(away, missed * change, 0.0).reshape(len(away), -1, 2, 3)
    found = []
    for imu, kind in np.argwhere(whole.exists):
        own = products[:, imu, kind].sum(axis=1)
        if np.count_nonzero(own) > SETTINGS.few:
            found.append((imu, own.sum() / np.sqrt(np.sum(own**2))))
    return [normal_checks("outliers against the reading's change", found)] if found else []


def plausibility_checks(search: Search) -> list[Check]:
    """Causes whose parameters are larger than such sensors have: misattributed."""
    columns, found = search.columns, []
    # what triads of a kind have in common is no less usual than how they differ
    whole = columns.flat(search.fit.state) / np.hypot(columns.usual_sd, columns.common_sd)
    for cause in search.causes:
        free = search.active[:, columns.of(cause.effect)]
        sizes = np.where(free, np.abs(whole[:, columns.of(cause.effect)]), 0.0)
        if sizes.max() > SETTINGS.implausible:
            imu, name = np.argmax(sizes.max(axis=1)), f"size of {cause.effect}"
            found.append(Check.of(name, sizes.max(), log_normal(sizes.max()), imu))
    return found


def tail_checks(made: Fit, noise: Noise, tailed) -> list[Check]:
    """Triads whose residual a mixture describes better, where ``tailed`` does not say so."""
    there = {(imu, kind) for imu, kind, _ in tailed}
    named, hits, _ = noise_effects.heavy_tails(made, noise, SETTINGS.check)
    left = sorted({imu for imu, kind, _ in hits if (imu, kind) not in there})
    return [Check.of("outliers' mixture", len(left), named.log_p, *left)] if left else []


def within_tolerance(search: Search, checks, in_noise) -> tuple[float, bool]:
    """(share of the base's excess that is explained, whether checks fail beyond tolerance)."""
    explained = 1.0 - search.left / search.excess if search.excess > 0 else 1.0
    coloured = any(item.effect == noise_effects.COLOURED for item in in_noise)
    failing = [c for c in checks if c.log_p < SETTINGS.check]
    failing = [c for c in failing if not (coloured and c.name == "whiteness")]
    large = search.excess > 30 * np.sqrt(2 * search.fit.free)
    small = search.left < SETTINGS.little * search.fit.free
    tolerated = large and small and explained > SETTINGS.explained
    # what a large cause leaves over does not excuse a small one that takes up as little
    weakest = min((need(search, c.effect)[0] for c in search.causes), default=np.inf)
    tolerated = tolerated and search.left - 2 * np.sqrt(2 * search.fit.free) < weakest
    tolerated = tolerated and not any(c.name.startswith(STRICT) for c in failing)
    return explained, bool(failing) and not tolerated
