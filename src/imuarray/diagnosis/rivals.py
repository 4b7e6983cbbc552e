"""Effects that a recording cannot tell from an adopted one: its class."""

from __future__ import annotations

import numpy as np

from imuarray.diagnosis.elimination import freed_places, need
from imuarray.diagnosis.scores import candidates, log_tail, mask_of, score_all
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.special import SPECIAL
from imuarray.diagnosis.state import Cause, Search
from imuarray.model.effects import EFFECTS


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
    own_log = log_tail(own, len(freed))
    scores = {s.candidate.effect: s for s in reversed(score_all(given, fit_, tried, freed))}
    active = np.setdiff1d(given.places(search.active), freed)
    left, _, _ = given.conditional(active, freed)
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
    scale = given.scale[chosen]
    values, vectors = np.linalg.eigh(left[np.ix_(chosen, chosen)] / np.outer(scale, scale))
    seen = values > 1e-5
    along = vectors[:, seen].T @ (signal[chosen] / scale)
    return float(np.sum(along**2 / values[seen]))
