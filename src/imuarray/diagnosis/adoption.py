"""Causes adopted one by one, and which effects a recording can distinguish.

The most significant test is refitted jointly and kept if it predicts; correlations of signals say
what cannot be told apart.
"""

from dataclasses import replace

import numpy as np

from imuarray.diagnosis.fit import Fit, at, likely_sizes, normal_blocks
from imuarray.diagnosis.scores import Candidate, Information, Score, candidates, score_all
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.special import SPECIAL, scans
from imuarray.diagnosis.state import Cause, Search, freed_mask, heldout_gain, need, prune
from imuarray.engine.parameters import POSITION
from imuarray.linear import scaled_eigh, scaled_inverse, scaled_square
from imuarray.model.effects import EFFECTS
from imuarray.tails import log_chi_square
from imuarray.words import sensors_of


def tried(search: Search) -> list[Candidate]:
    """Candidates for adoption: neither refused before, nor there already."""
    there = {(c.effect, k, v) for c in search.causes for k in c.imus for v in c.variants}
    # what a scanned cause contains is its own
    inside = {
        (lesser, k, "") for c in search.causes if EFFECTS[c.effect].scanned
        for lesser in EFFECTS[c.effect].contains for k in c.imus
    }  # fmt: skip
    found = candidates(search.columns, search.readings.exists, search.offered)
    return [
        c for c in found
        if c not in search.refused and not any(
            {(c.effect, k, c.variant) for k in c.imus} <= known for known in (there, inside)
        )
    ]  # fmt: skip


def proposals(search: Search) -> list[Score]:
    """All tests and scans, most significant first."""
    scores = score_all(search.given, search.fit, tried(search))
    every = [*scores, *scans(search, scores)]
    named = [score for score in every if score.candidate not in search.refused]
    return sorted(named, key=lambda score: log_odds(search, score))


def log_odds(search: Search, score) -> float:
    """A test's log p; more where it is of the others of what some IMUs have: chips are alike."""
    own = score.candidate
    others = own.whole and not own.variant and search.imus_with(own.effect)
    return score.log_p + (SETTINGS.limit(own.effect) - SETTINGS.others if others else 0.0)


def adopt(search: Search, proposed=None) -> Search:
    """Forward: adopt while a test is significant, large enough and gains on held-out time.

    ``proposed``: the `proposals` at the search as it is, where they are known.
    """
    vain: list[str] = []  # effects refused since the last was adopted
    while len(search.causes) < SETTINGS.most_causes and len(vain) < SETTINGS.patience:
        proposed = proposals(search) if proposed is None else proposed
        proposed = [p for p in proposed if vain.count(p.candidate.effect) < SETTINGS.of_one]
        best = narrowest(proposed, search) if proposed else None
        if best is None or not likely(search, best) or best.statistic < search.least:
            break
        found = attempt(search, best)
        # refused, it leaves all others' tests as they are
        adopted = len(found.trace) > len(search.trace)
        vain = [] if adopted else [*vain, best.candidate.effect]
        proposed = None if adopted else [p for p in proposed if p is not best]
        search = found
    return search.with_sizes()


def narrowest(proposed, search: Search) -> Score:
    """The first of the `proposals`, or a narrower one that has most of its test.

    One IMU's of an effect of all, if what the others have beyond it is too little for a cause. In
    rough motion, which leaves something for all that has parameters, parts of an effect as well.
    """
    first, own = proposed[0], proposed[0].candidate
    parts = parts_of(own.effect)
    rest = (1 - SETTINGS.most) * first.statistic
    if search.smooth:
        parts, rest = (), min(search.least, rest)

    def narrower(score) -> bool:
        one = score.candidate
        same = (one.effect, one.variant) == (own.effect, own.variant)
        inside = (same or one.effect in parts) and {*one.imus} <= {*own.imus}
        less = score.freedom < first.freedom and first.statistic - score.statistic < rest
        return inside and less

    return min(filter(narrower, proposed[1:]), key=lambda score: score.freedom, default=first)


def likely(search: Search, score) -> bool:
    """True of a significant test: beside causes of other effects more is asked."""
    effect = score.candidate.effect
    beside = search.causes and not search.imus_with(effect)
    return log_odds(search, score) <= SETTINGS.limit(effect, beside)


def attempt(search: Search, score: Score) -> Search:
    """Adopt a candidate and refit; where held-out time does not gain, refuse it."""
    candidate = score.candidate
    effect, special = candidate.effect, SPECIAL.get(candidate.effect)
    found = replace(search, causes=merged(search.causes, score))
    if special and not special.linear:
        gain, error = np.inf, 0.0
    else:
        gain, error = predicted_gain(found, score, search.active)
    if keeps(search, score, gain, error):
        found = found.refit(found.started(effect, score.values))
        if special and special.refine:
            found = special.refine(found, candidate.imus)
        found = prune(found, effect)
        new = np.any(found.active & ~search.active)  # or pruned to what was there
        gain, error = heldout_gain(found, effect, there=search.active) if new else (-np.inf, 0.0)
    whose = ", ".join(sensors_of(search.readings.labels, candidate.imus))
    words = f"{effect} {candidate.variant} of {whose}"
    if not keeps(search, score, gain, error):
        search.notify(f"refused {words}: held-out gain {gain:.1f} +- {error:.1f}")
        return replace(search, refused=search.refused | {candidate})
    search.notify(
        f"adopted {words}: log p {score.log_p:.0f}, held-out gain {gain:.0f} +- {error:.0f} nats"
    )
    return replace(found, trace=(*search.trace, (effect, gain)))


def keeps(search: Search, score, gain: float, error: float) -> bool:
    """True of a gain on held-out time that is clear, and a fair part of what the test predicted."""
    predicted = score.statistic / 2 - SETTINGS.uncertain
    return gain > search.least_z * error and gain > SETTINGS.kept * predicted


def predicted_gain(search: Search, score: Score, there) -> tuple[float, float]:
    """The held-out gain, beside what is ``there`` (N, m), that one linearisation predicts."""
    effect = score.candidate.effect
    state, made = search.started(effect, score.values), search.fit
    if not np.array_equal(state.parameters, made.state.parameters):
        made = at(search.readings, search.columns, search.active, state, all_columns=False)
    made = replace(made, active=search.active)
    parts = normal_blocks(made, made.active)
    columns = likely_sizes(made, [sum(part) for part in zip(*parts, strict=True)])
    return heldout_gain(replace(search, fit=made, columns=columns), effect, parts, there=there)


def merged(causes, score: Score) -> tuple[Cause, ...]:
    """The causes with a test's candidate: in one of the same effect, or as one more.

    What a new one contains is no cause of its own in its IMUs: a drift or a clock has its own
    constant.
    """
    candidate, log_p = score.candidate, score.log_p
    for place, old in enumerate(causes):
        if old.effect == candidate.effect:
            imus = tuple(sorted({*old.imus, *candidate.imus}))
            variants = old.variants | {candidate.variant}
            wider = replace(old, imus=imus, variants=variants, log_p=min(old.log_p, log_p))
            return (*causes[:place], wider, *causes[place + 1 :])
    left = [replace(c, imus=_beside(c, candidate)) for c in causes]
    variants = frozenset({candidate.variant})
    new = Cause(candidate.effect, candidate.imus, variants, log_p, score.tries)
    return (*(cause for cause in left if cause.imus), new)


def _beside(cause: Cause, wider: Candidate) -> tuple[int, ...]:
    """The IMUs of a cause where a wider one does not contain it; a form may be of one sensor."""
    same_kind = wider.variant.split(" ")[0] in (EFFECTS[cause.effect].sensors, "")
    if cause.effect not in EFFECTS[wider.effect].contains or not same_kind:
        return cause.imus
    return tuple(k for k in cause.imus if k not in wider.imus)


def separability(given: Information, fit: Fit, adopted=()) -> dict:
    """{(effect, other): (largest, mean)} likeness on this recording, on all IMUs that can have it.

    Squared canonical correlations, motion and positions projected out: of the two most alike forms,
    1 for an exact gauge in one form; over the forms of the smaller effect, 1 where the other
    contains it. ``adopted``: (effect, imus) pairs. Effects that only a scan sees (a clock, a step)
    have a direction once they are adopted, on the IMUs that have them; else they are left out.
    """
    left = conditional(given, given.places(fit.columns.mask([POSITION])))
    imus = dict(adopted)
    bases = {}
    for effect in fit.columns.model.effects:
        if EFFECTS[effect].scanned and effect not in imus:
            continue
        able = fit.readings.exists[:, EFFECTS[effect].kinds].any(axis=1)
        mask = fit.columns.mask([effect], imus[effect] if EFFECTS[effect].scanned else None)
        chosen = given.places(mask & able[:, None])
        basis = orthonormal(left, chosen, given.scale[chosen])
        if basis.shape[1]:
            bases[effect] = chosen, basis
    squares = {(a, b): squared_correlations(left, bases[a], bases[b]) for a in bases for b in bases}
    return {pair: (found.max(), found.mean()) for pair, found in squares.items()}


def conditional(given: Information, known) -> np.ndarray:
    """Information (K, K) on all parameters, those at ``known`` held by their own prior alone."""
    cross = given.information[:, known]
    inner = cross[known] + np.diag(given.ridge[known])
    return given.information - cross @ scaled_inverse(inner) @ cross.T


def orthonormal(information, chosen, scale) -> np.ndarray:
    """(n, d) combinations of the n chosen parameters whose signals are orthonormal."""
    values, vectors, _ = scaled_eigh(information[np.ix_(chosen, chosen)], scale)
    # the rest are gauges of motion and positions: no data determine what else they resemble
    informed = values > SETTINGS.visible
    return vectors[:, informed] / np.sqrt(values[informed]) / scale[:, None]


def squared_correlations(information, one, other) -> np.ndarray:
    """Squared canonical correlations of two sets, each (places, basis): of the smaller's size."""
    (rows, left), (columns, right) = one, other
    cross = left.T @ information[np.ix_(rows, columns)] @ right
    return np.clip(np.linalg.svd(cross, compute_uv=False) ** 2, 0.0, 1.0)


def rivals(search: Search, cause: Cause) -> list[str]:
    """Ids of effects that explain nearly as well as an adopted one, or most of its signal."""
    effect, given, fit_ = cause.effect, search.given, search.fit
    freed = given.places(freed_mask(search, effect))
    whole = len(cause.imus) > len(fit_.readings.exists) / 2
    present = {c.effect for c in search.causes}
    others = [e for e in search.offered if e not in present and EFFECTS[e].beside != effect]
    tried = [
        c
        for c in candidates(fit_.columns, fit_.readings.exists, others)
        if (c.whole if whole else c.imus == cause.imus)
    ]
    own, freedom = need(search, effect)
    own_log = log_chi_square(own, freedom) if freedom else 0.0
    scores = {s.candidate.effect: s for s in reversed(score_all(given, fit_, tried, freed))}
    active = np.setdiff1d(given.places(search.active), freed)
    left = given.conditional(active, freed).information
    signal = left[:, freed] @ given.values[freed]
    power = given.values[freed] @ left[np.ix_(freed, freed)] @ given.values[freed]
    found = []
    for candidate in tried:
        other, score = candidate.effect, scores.get(candidate.effect)
        close = score is not None and score.log_p - own_log < SETTINGS.rival
        nested = other in parts_of(effect) or effect in EFFECTS[other].contains
        shared = 0.0 if nested else _shared(given, fit_, candidate, left, signal)
        if close or shared > SETTINGS.alike * power:
            found.append(other)
    return list(dict.fromkeys([*found, *wider(search, cause, own)]))


def parts_of(effect: str) -> tuple[str, ...]:
    """Effects that an effect contains or resembles."""
    return EFFECTS[effect].contains + EFFECTS[effect].resembles


def wider(search: Search, cause: Cause, own: float) -> list[str]:
    """Effects of which the adopted one may be no more than a part."""
    return [
        effect for effect, special in SPECIAL.items()
        if special.maybe is not None and effect in search.effects
        and cause.effect in parts_of(effect) and special.maybe(search, cause, own)
    ]  # fmt: skip


def _shared(given, fit_, candidate, left, signal) -> float:
    """Share of a signal's power that a candidate could explain."""
    chosen = given.places(candidate.mask(fit_.columns))
    block = left[np.ix_(chosen, chosen)]
    return scaled_square(block, signal[chosen], SETTINGS.observed, given.scale[chosen])[0]
