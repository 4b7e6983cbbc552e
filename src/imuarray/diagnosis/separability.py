"""Which effects a recording can distinguish: correlations of their signals, and a cause's class."""

from dataclasses import dataclass

import numpy as np

from imuarray.diagnosis.elimination import freed_places, need
from imuarray.diagnosis.scores import (
    Candidate,
    Information,
    able,
    candidates,
    mask_of,
    score_all,
)
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.special import SPECIAL
from imuarray.diagnosis.state import Cause, Search
from imuarray.engine.fit import Fit
from imuarray.engine.parameters import POSITION
from imuarray.linear import scaled_eigh, scaled_inverse, scaled_square
from imuarray.model.effects import EFFECTS
from imuarray.tails import log_chi_square


@dataclass(frozen=True)
class Separability:
    """Squared canonical correlations between effects, motion and positions projected out.

    Attributes
    ----------
    effects : n effect ids
    largest : (n, n) of the two most alike forms of two effects; 1 is an exact gauge in one form
    mean : (n, n) mean over the forms of the smaller effect; 1 where it is contained in the other
    """

    effects: tuple[str, ...]
    largest: np.ndarray
    mean: np.ndarray


def separability(given: Information, fit: Fit, adopted=()) -> Separability:
    """How alike the effects are on this recording, each on all IMUs that can have it.

    ``given`` is the `Information` at ``fit``, ``adopted`` its causes, as (effect, imus) pairs.
    Effects that only a scan sees (a clock, a step) have a direction once they are adopted, on the
    IMUs that have them; else they are left out.
    """
    place = np.zeros_like(fit.active)
    place[:, fit.columns.of(POSITION)] = True
    left = conditional(given, given.places(place & fit.columns.owner))
    imus = dict(adopted)
    bases = {}
    for effect in fit.columns.model.effects:
        if EFFECTS[effect].scanned and effect not in imus:
            continue
        whose = imus[effect] if EFFECTS[effect].scanned else range(len(fit.columns.owner))
        mask = mask_of(fit.columns, Candidate(effect, tuple(whose)))
        chosen = given.places(mask & able(fit.readings.exists, effect)[:, None])
        basis = orthonormal(left, chosen, given.scale[chosen])
        if basis.shape[1]:
            bases[effect] = chosen, basis
    squares = {(a, b): squared_correlations(left, bases[a], bases[b]) for a in bases for b in bases}
    shape = (len(bases), len(bases))
    return Separability(
        tuple(bases),
        np.array([found.max() for found in squares.values()]).reshape(shape),
        np.array([found.mean() for found in squares.values()]).reshape(shape),
    )


def conditional(given: Information, known) -> np.ndarray:
    """Information (K, K) on all parameters when those at ``known`` are refitted to any change.

    Their own prior alone holds them: no gauge is pinned, whatever the fit did.
    """
    cross = given.information[:, known]
    inner = cross[known] + np.diag(given.ridge[known])
    return given.information - cross @ scaled_inverse(inner) @ cross.T


def orthonormal(information, chosen, scale) -> np.ndarray:
    """(n, d) combinations of the n chosen parameters whose signals are orthonormal.

    Combinations that the projection leaves less than `visible` of are left out: they are gauges of
    motion and positions, and no data determine what else they resemble.
    """
    values, vectors, _ = scaled_eigh(information[np.ix_(chosen, chosen)], scale)
    seen = values > SETTINGS.visible
    return vectors[:, seen] / np.sqrt(values[seen]) / scale[:, None]


def squared_correlations(information, one, other) -> np.ndarray:
    """Squared canonical correlations of two sets, each (places, basis): of the smaller's size."""
    (rows, left), (columns, right) = one, other
    cross = left.T @ information[np.ix_(rows, columns)] @ right
    return np.clip(np.linalg.svd(cross, compute_uv=False) ** 2, 0.0, 1.0)


def rivals(search: Search, cause: Cause) -> list[str]:
    """Ids of the effects that explain nearly as well as an adopted one.

    Put back to zero, it leaves a signal: rivals explain it nearly as well, or more than `alike`
    of it.
    """
    effect, given, fit_ = cause.effect, search.given, search.fit
    freed = freed_places(search, effect)
    whole = len(cause.imus) > len(fit_.readings.exists) / 2
    tried = [
        c for c in candidates(fit_.columns, fit_.readings.exists, search.effects)
        if c.effect != effect and (c.whole if whole else c.imus == cause.imus)
    ]  # fmt: skip
    present = {c.effect for c in search.causes}
    own, _ = need(search, effect)
    own_log = log_chi_square(own, len(freed))
    scores = {s.candidate.effect: s for s in reversed(score_all(given, fit_, tried, freed))}
    active = np.setdiff1d(given.places(search.active), freed)
    left = given.conditional(active, freed).information
    signal = left[:, freed] @ given.values[freed]
    power = given.values[freed] @ left[np.ix_(freed, freed)] @ given.values[freed]
    found = []
    for candidate in tried:
        if candidate.effect in present or candidate.effect in found:
            continue
        score = scores.get(candidate.effect)
        close = score is not None and score.log_p - own_log < SETTINGS.rival
        alike = not nested(effect, candidate.effect) and _shared(
            given, fit_, candidate, left, signal
        ) > (SETTINGS.alike * power)
        if close or alike:
            found.append(candidate.effect)
    return list(dict.fromkeys([*found, *wider(search, cause, own)]))


def nested(effect: str, other: str) -> bool:
    """Whether another effect contains an adopted one, or is contained in it or for it."""
    one = EFFECTS[effect]
    return other in (*one.contains, *one.resembles) or effect in EFFECTS[other].contains


def wider(search: Search, cause: Cause, own: float) -> list[str]:
    """Effects of which the adopted one may be no more than a part."""
    found = []
    for effect, special in SPECIAL.items():
        parts = (*EFFECTS[effect].contains, *EFFECTS[effect].resembles)
        possible = special.maybe is not None and effect in search.effects
        if possible and cause.effect in parts and special.maybe(search, cause, own):
            found.append(effect)
    return found


def _shared(given, fit_, candidate, left, signal) -> float:
    """How much of a signal's power a candidate could explain."""
    chosen = given.places(mask_of(fit_.columns, candidate))
    block = left[np.ix_(chosen, chosen)]
    return scaled_square(block, signal[chosen], SETTINGS.seen, given.scale[chosen])[0]
