"""Smallest size of each effect that a recording would have shown (Baarda 1968)."""

import numpy as np
from scipy import special

from imuarray.diagnosis.scores import Information, candidates, mask_of
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.state import Search
from imuarray.engine.heldout import blocks_of
from imuarray.linear import scaled_inverse
from imuarray.model.array_model import component, unit_of
from imuarray.model.effects import EFFECTS

DEVIATES = special.ndtri(SETTINGS.power)


def detectable(search: Search) -> dict[str, dict]:
    """Sizes that would be named with `SETTINGS.power`, one parameter at a time, all else refitted.

    ``{effect: {"units": {parameter: unit}, "sizes": {sensor: {parameter: size}}}}``; parameters
    that motion or positions take up are left out, as are effects that a scan looks for.
    From the score test's noncentral chi-square: with the score's slope M, the inverse covariance
    W along the directions seen and the least noncentrality that passes the level and the share of
    the misfit that a cause must explain, size_i^2 = lambda / (M W M)_ii. With the same chance its
    gain on held-out time is clear of its error, which blocks of time show by their `scatter`.
    """
    given, columns = search.given, search.columns
    active = given.places(search.active)
    inside = {part for c in search.causes for part in EFFECTS[c.effect].contains}
    effects = [effect for effect in search.effects if effect not in inside]
    every = candidates(columns, search.readings.exists, effects)
    described, blocks = search.fit.described, blocks_of(len(search.fit.residual))
    scores = np.array([search.fit.normal(described, block)[1] for block in blocks])
    found: dict[str, dict] = {}
    for candidate in every:
        mask = mask_of(columns, candidate)
        chosen = np.sort(given.places(mask))
        if len(candidate.imus) > 1 or not len(chosen):
            continue
        beside = np.setdiff1d(active, chosen)
        seen = given.seen(given.conditional(beside, of=chosen), chosen)
        tests = sum(each.effect == candidate.effect and not each.whole for each in every)
        least = max(noncentrality(search, candidate.effect, tests, len(seen.values)), search.least)
        slope = (seen.vectors * seen.values) @ np.linalg.cholesky(seen.precision)
        shown = np.sum(slope**2, axis=1)
        clear = 2 * (search.least_z + DEVIATES) * scatter(given, scores, beside, chosen)
        sizes = np.sqrt(np.maximum(least, clear**2) / np.maximum(shown, 1e-30)) / seen.scale
        label = search.readings.labels[candidate.imus[0]]
        entry = found.setdefault(candidate.effect, {"units": {}, "sizes": {}})
        own = entry["sizes"].setdefault(label, {})
        column_at = {int(given.index[k, column]): column for k, column in np.argwhere(mask)}
        for number, size, share in zip(chosen, sizes, shown, strict=True):
            place = columns.places[column_at[int(number)]]
            name = component(candidate.effect, place)
            if share > SETTINGS.seen:  # of the parameter's own information
                own[name] = min(float(size), own.get(name, np.inf))
                entry["units"][name] = unit_of(candidate.effect, place)
    return {effect: entry for effect, entry in found.items() if entry["units"]}


def scatter(given: Information, scores, active, chosen) -> np.ndarray:
    """Sds (at least 1) of blocks' scores (B, K) at ``chosen`` places, in those of white noise."""
    square, cross = np.ix_(active, active), given.information[np.ix_(chosen, active)]
    gain = cross @ scaled_inverse(given.information[square] + given.precision[square])
    left = scores[:, chosen] - scores[:, active] @ gain.T
    own = np.diag(given.information)[chosen] - np.sum(gain * cross, axis=1)
    squares = len(scores) * np.var(left, axis=0, ddof=1)
    return np.sqrt(np.maximum(squares / np.maximum(own, 1e-300), 1.0))


def noncentrality(search: Search, effect: str, tests: int, freedom: int) -> float:
    """Noncentrality of a chi-square that passes one of an effect's ``tests`` with the power."""
    log_p = SETTINGS.limit(effect, search.causes) - np.log(2 * max(tests, 1))
    critical = special.chdtri(max(freedom, 1), np.exp(log_p))
    return float(special.chndtrinc(critical, max(freedom, 1), 1 - SETTINGS.power))
