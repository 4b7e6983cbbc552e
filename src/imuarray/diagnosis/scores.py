"""Score tests from one fit, motion and positions projected out: what each effect would gain.

And the smallest size of each that they would have shown (Baarda 1968).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import special as special

from imuarray.diagnosis.fit import Fit
from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.heldout import blocks_of
from imuarray.engine.normal import score_of
from imuarray.engine.parameters import Columns
from imuarray.linear import scaled_eigh, scaled_inverse
from imuarray.model.array_model import component, unit_of
from imuarray.model.effects import EFFECTS
from imuarray.tails import log_chi_square

POWER = special.ndtri(SETTINGS.power)  # in deviates


@dataclass(frozen=True)
class Candidate:
    """An effect on some IMUs; ``variant`` its form (which bias drifts, how)."""

    effect: str
    imus: tuple[int, ...]
    variant: str = ""
    whole: bool = False  # all IMUs that can have it

    def mask(self, columns: Columns) -> np.ndarray:
        """Its parameters (N, m) bool."""
        found = columns.mask([self.effect], self.imus)
        if self.variant:
            inside = dict(EFFECTS[self.effect].forms)[self.variant]
            found[:, [c for c in columns.of(self.effect) if not inside(columns.places[c])]] = False
        return found


@dataclass(frozen=True)
class Score:
    """A candidate's test: chi-square, its degrees of freedom and log p, many tests allowed for."""

    candidate: Candidate
    statistic: float
    freedom: int
    log_p: float
    values: dict[int, np.ndarray] | None = None  # of a scan: where its parameters begin, by IMU

    @property
    def tries(self) -> float:
        """Nats that many tests took off."""
        return self.log_p - log_chi_square(self.statistic, self.freedom)


class Conditional(NamedTuple):
    """An `Information` at the places ``of`` (k,), in order, others refitted."""

    information: np.ndarray  # (k, k)
    score: np.ndarray  # (k,)
    meat: np.ndarray  # (k, k), the score's covariance
    of: np.ndarray


class ObservedDirections(NamedTuple):
    """The d directions that a recording sees of a candidate's k parameters, scaled."""

    values: np.ndarray  # (d,) the information along them
    vectors: np.ndarray  # (k, d)
    scale: np.ndarray  # (k,) of the parameters
    precision: np.ndarray  # (d, d) inverse of the score's covariance along them


def variants(effect: str) -> tuple[str, ...]:
    """The forms an effect is tested in."""
    return tuple(name for name, _ in EFFECTS[effect].forms) or ("",)


def candidates(columns: Columns, exists, effects) -> list[Candidate]:
    """Every effect that a score can see, on all IMUs and on each."""
    found = []
    for effect in effects:
        if EFFECTS[effect].scanned:
            continue
        able = exists[:, EFFECTS[effect].kinds].any(axis=1)
        imus = tuple(int(k) for k in np.flatnonzero(able))
        for variant in variants(effect):
            found.append(Candidate(effect, imus, variant, True))
            found += [Candidate(effect, (k,), variant) for k in imus if len(imus) > 1]
    return found


@dataclass(frozen=True)
class Information:
    """The quadratic form of the misfit around a fit, in all K parameters at once."""

    information: np.ndarray  # (K, K)
    score: np.ndarray  # (K,)
    index: np.ndarray  # (N, m) place of each parameter, -1 where there is none
    values: np.ndarray  # (K,) of the parameters
    ridge: np.ndarray  # (K,) prior precision
    usual: np.ndarray  # (K,) the same before sizes were estimated, which tests go by
    precision: np.ndarray  # (K, K) prior's of what is fitted, gauges pinned
    meat: np.ndarray | None = None  # (K, K) score's covariance, of coloured noise or corrections
    correlation: np.ndarray | None = None  # (N, 2) of each triad's noise from sample to sample

    @cached_property
    def scale(self) -> np.ndarray:
        """Square roots of the parameters' own information before projection, (K,)."""
        return np.sqrt(np.maximum(np.diag(self.information), 1e-200))

    def places(self, mask) -> np.ndarray:
        """Places of the parameters in a mask (N, m)."""
        found = self.index[mask]
        return found[found >= 0]

    def covariance(self, places) -> np.ndarray:
        """Covariance of the parameters at some places, all others held."""
        square = np.ix_(places, places)
        return scaled_inverse(self.information[square] + self.precision[square])

    def conditional(self, active, freed=None, of=None) -> Conditional:
        """At the places ``of``, or all, the active refitted; ``freed`` ones set to zero before."""
        of = np.arange(len(self.score)) if of is None else of
        score, square = self.score, np.ix_(active, active)
        if freed is not None and len(freed):
            score = score + self.information[:, freed] @ self.values[freed]
        cross = self.information[np.ix_(of, active)]
        gain = cross @ self.covariance(active)
        left = self.information[np.ix_(of, of)] - gain @ cross.T
        score = score[of] - gain @ score[active]
        if self.meat is None:
            return Conditional(left, score, left, of)
        side = gain @ self.meat[np.ix_(active, of)]
        meat = self.meat[np.ix_(of, of)] - side - side.T + gain @ self.meat[square] @ gain.T
        return Conditional(left, score, meat, of)

    def test(self, conditional: Conditional, chosen):
        """(chi-square, degrees of freedom) of the parameters at ``chosen`` places."""
        observed = self.observed(conditional, chosen)
        mine = np.searchsorted(conditional.of, chosen)
        along = observed.vectors.T @ (conditional.score[mine] / observed.scale)
        return float(along @ observed.precision @ along), len(observed.values)

    def observed(self, conditional: Conditional, chosen) -> ObservedDirections:
        """The directions that are seen of the parameters at ``chosen`` places."""
        information, _, meat, of = conditional
        mine = np.searchsorted(of, chosen)
        block = information[np.ix_(mine, mine)]
        values, vectors, scale = scaled_eigh(block, self.scale[chosen])
        # a parameter stays within its prior: near a gauge, data alone would take it anywhere
        ridge = vectors.T @ ((self.usual[chosen] / scale**2)[:, None] * vectors)
        kept = values > np.maximum(SETTINGS.observed, np.diag(ridge))
        values, vectors, ridge = values[kept], vectors[:, kept], ridge[np.ix_(kept, kept)]
        if meat is information:
            spread = np.diag(values)
        else:
            spread = meat[np.ix_(mine, mine)] / np.outer(scale, scale)
            spread = vectors.T @ spread @ vectors
        return ObservedDirections(values, vectors, scale, scaled_inverse(spread + ridge))


def information_at(fit: Fit) -> Information:
    """The quadratic form at a fit, in the parameters whose derivatives it has."""
    flat = fit.columns.flat(fit.state)
    owner = fit.described
    information, score = fit.normal(owner)
    index = np.full(owner.shape, -1)
    index[owner] = np.arange(owner.sum())
    ridge, usual = (
        1.0 / np.broadcast_to(sd, owner.shape)[owner] ** 2
        for sd in (fit.columns.prior_sd, fit.columns.usual_sd)
    )
    precision, places = np.diag(ridge), index[fit.active]
    precision[np.ix_(places, places)] = fit.columns.prior_precision(fit.active)
    return Information(information, score, index, flat[owner], ridge, usual, precision)


def score_all(given: Information, fit: Fit, tried: list[Candidate], freed=()) -> list[Score]:
    """Each candidate's score test, best first; the active ones but ``freed`` refitted."""
    freed = np.asarray(freed, int)
    active = np.setdiff1d(given.places(fit.active), freed)
    conditional = given.conditional(active, freed)
    found = []
    for candidate in tried:
        chosen = np.setdiff1d(given.places(candidate.mask(fit.columns)), active)
        if not len(chosen):
            continue
        statistic, freedom = given.test(conditional, chosen)
        if freedom:
            count = 1 if candidate.whole else sum(
                c.effect == candidate.effect and c.variant == candidate.variant for c in tried
            ) - 1  # fmt: skip
            forms = len(variants(candidate.effect))
            log_p = log_chi_square(statistic, freedom) + np.log(2 * max(count, 1) * forms)
            found.append(Score(candidate, statistic, freedom, min(log_p, 0.0)))
    return sorted(found, key=lambda item: item.log_p)


def detectable(search) -> dict[str, dict]:
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
    effects = [effect for effect in search.offered if effect not in inside]
    every = candidates(columns, search.readings.exists, effects)
    fit, blocks = search.fit, blocks_of(len(search.fit.residual))
    scores = np.array([score_of(fit, fit.described[:, fit.wanted], block) for block in blocks])
    found: dict[str, dict] = {}
    for candidate in every:
        mask = candidate.mask(columns)
        chosen = np.sort(given.places(mask))
        if len(candidate.imus) > 1 or not len(chosen):
            continue
        beside = np.setdiff1d(active, chosen)
        observed = given.observed(given.conditional(beside, of=chosen), chosen)
        tests = sum(each.effect == candidate.effect and not each.whole for each in every)
        count = len(observed.values)
        least = max(noncentrality(search, candidate.effect, tests, count), search.least)
        slope = (observed.vectors * observed.values) @ np.linalg.cholesky(observed.precision)
        shown = np.sum(slope**2, axis=1)
        clear = 2 * (search.least_z + POWER) * scatter(given, scores, beside, chosen)
        sizes = np.sqrt(np.maximum(least, clear**2) / np.maximum(shown, 1e-30)) / observed.scale
        label = search.readings.labels[candidate.imus[0]]
        entry = found.setdefault(candidate.effect, {"units": {}, "sizes": {}})
        own = entry["sizes"].setdefault(label, {})
        column_at = {int(given.index[k, column]): column for k, column in np.argwhere(mask)}
        for number, size, share in zip(chosen, sizes, shown, strict=True):
            place = columns.places[column_at[int(number)]]
            name = component(candidate.effect, place)
            if share > SETTINGS.observed:  # of the parameter's own information
                own[name] = min(float(size), own.get(name, np.inf))
                entry["units"][name] = unit_of(candidate.effect, place)
    return {effect: entry for effect, entry in found.items() if entry["units"]}


def scatter(given: Information, scores, active, chosen) -> np.ndarray:
    """Sds (at least 1) of blocks' scores (B, K) at ``chosen`` places, in those of white noise."""
    cross = given.information[np.ix_(chosen, active)]
    gain = cross @ given.covariance(active)
    left = scores[:, chosen] - scores[:, active] @ gain.T
    own = np.diag(given.information)[chosen] - np.sum(gain * cross, axis=1)
    squares = len(scores) * np.var(left, axis=0, ddof=1)
    return np.sqrt(np.maximum(squares / np.maximum(own, 1e-300), 1.0))


def noncentrality(search, effect: str, tests: int, freedom: int) -> float:
    """Noncentrality of a chi-square that passes one of an effect's ``tests`` with the power."""
    log_p = SETTINGS.limit(effect, search.causes) - np.log(2 * max(tests, 1))
    critical = special.chdtri(max(freedom, 1), np.exp(log_p))
    return float(special.chndtrinc(critical, max(freedom, 1), 1 - SETTINGS.power))
