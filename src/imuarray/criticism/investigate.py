"""The whole procedure on one recording: readings, means, noise, what is left, who else it may be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from imuarray.criticism import noise as noises
from imuarray.criticism import variance
from imuarray.criticism.adopt import Search, adopt, clear, freed_places, need
from imuarray.criticism.columns import catalogue_effects, columns_of
from imuarray.criticism.fit import Fit
from imuarray.criticism.gate import Check, all_checks
from imuarray.criticism.readings import Readings, arrange
from imuarray.criticism.scores import candidates, log_tail, mask_of, score_all
from imuarray.criticism.structure import Structural, find_structural
from imuarray.criticism.thresholds import Thresholds, read_thresholds
from imuarray.recording import Recording

NESTED = {  # an effect, and those that contain it
    "accelerometer_bias": ("bias_drift",), "gyroscope_bias": ("bias_drift",),
    "sensor_delay": ("sensor_clock",),
}  # fmt: skip


@dataclass
class Found:
    """What an investigation came to."""

    search: Search
    base: Fit
    base_checks: list[Check]
    structural: list[Structural]
    in_noise: list[variance.Named]
    checks: list[Check]
    explained: float
    unexplained: bool
    raw: Readings
    rivals: dict = field(default_factory=dict)


def investigate(
    recording: Recording, without=(), say: Callable[[str], None] = lambda text: None,
    thresholds: Thresholds | None = None,
) -> Found:  # fmt: skip
    """Find what the papers' model gets wrong; effects in ``without`` are struck from the catalogue.

    InputError where a recording has too few moving samples.
    """
    thresholds = thresholds or read_thresholds()
    raw = arrange(recording)
    structural, readings = find_structural(raw, without)
    effects = catalogue_effects(without)
    columns = columns_of(readings.array, effects, readings.position_prior_sd)
    search = Search(readings, columns, effects, thresholds, say)
    search.begin()
    base = search.fit
    base_checks = all_checks(base, search.given, search.noise)
    calm(search)
    adopt(search)
    clear(search)
    tails, in_noise = settle(search, without)
    in_noise += named_noise(search, without, tails)
    checks = all_checks(search.fit, search.given, search.noise)
    explained, failing = judged(search, base, checks, in_noise)
    found = Found(search, base, base_checks, structural, in_noise, checks, explained, failing, raw)
    found.rivals = {c.effect: rivals(search, c.effect) for c in search.causes}
    return found


def calm(search: Search) -> None:
    """Leave out lone outliers while means are looked for, whatever their cause is."""
    limit = search.thresholds.limit("heavy_tails")
    if np.min(noises.tail_log_p(search.noise)) < limit:
        far = np.repeat(search.noise.far, 3, axis=2)
        search.readings = search.readings.without(far)
        search.refit()


def settle(search: Search, without) -> tuple[np.ndarray, list]:
    """Heavy tails: judged on all readings once the means are known, then left out of the fit."""
    whole = replace(search.readings, keep=search.allowed)
    search.readings = whole
    search.refit()
    if "heavy_tails" in without:
        return np.zeros((0, 2), int), []
    named, hit = variance.heavy_tails(
        search.fit, search.noise, search.thresholds.limit("heavy_tails")
    )
    if named is None:
        return hit, []
    lost, sd = np.zeros(whole.keep.shape, bool), search.readings.sd.copy()
    for imu, kind in hit:
        mix = variance.mixture(search.fit, imu, kind)
        lost[:, imu, 3 * kind : 3 * kind + 3] = mix.outlier[:, None] > 0.5
        sd[imu, kind] *= mix.core
    search.readings = whole.without(lost).with_sd(sd)
    before = len(search.causes)
    search.refit()
    adopt(search)
    if len(search.causes) > before:
        clear(search)
    return hit, [named]


def named_noise(search: Search, without, tails) -> list:
    """Scale and colour of the noise, where they depart from what is declared."""
    found = []
    for kind, name in enumerate(("accelerometer_noise", "gyroscope_noise")):
        if name not in without:
            skip = [int(imu) for imu, k in tails if k == kind]
            named = variance.noise_scale(
                search.fit, search.noise, kind, search.thresholds.limit(name), skip
            )
            found += [named] if named else []
    if "coloured_noise" not in without:
        named = variance.coloured(
            search.fit, search.noise, search.thresholds.limit("coloured_noise")
        )
        found += [named] if named else []
    return sorted(found, key=lambda item: item.log_p)


def judged(search: Search, base: Fit, checks, in_noise) -> tuple[float, bool]:
    """(share of the base's excess that is explained, whether checks fail beyond forgiveness)."""
    left = max(search.fit.misfit - search.fit.free, 0.0)
    explained = 1.0 - left / search.excess if search.excess > 0 else 1.0
    named = {item.effect for item in in_noise}
    failing = [c for c in checks if c.log_p < search.thresholds.check]
    if "coloured_noise" in named:
        failing = [c for c in failing if c.name != "whiteness"]
    large = search.excess > 30 * np.sqrt(2 * search.fit.free)
    forgiven = large and explained > search.thresholds.explained and not {"outliers"} & {
        c.name for c in failing
    }  # fmt: skip
    return explained, bool(failing) and not forgiven


def rivals(search: Search, effect: str) -> list[str]:
    """Effects that this recording cannot tell from an adopted one.

    Put back to zero, the adopted effect leaves a signal: rivals explain it nearly as well, or
    more than `alike` of it.
    """
    cause = next(c for c in search.causes if c.effect == effect)
    given, fit_ = search.given, search.fit
    freed = freed_places(search, effect)
    whole = len(cause.imus) > len(fit_.readings.exists) / 2
    tried = [
        c for c in candidates(fit_.columns, fit_.readings.exists, search.effects, search.smooth)
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
        close = score is not None and score.log_p - own_log < search.thresholds.rival
        nested = candidate.effect in NESTED.get(effect, ())
        alike = not nested and _shared(given, fit_, candidate, left, signal) > (
            search.thresholds.alike * power
        )
        if close or alike:
            found.append(candidate.effect)
    return found


def _shared(given, fit_, candidate, left, signal) -> float:
    """How much of a signal's power a candidate could explain."""
    chosen = given.places(mask_of(fit_.columns, candidate))
    scale = given.scale[chosen]
    values, vectors = np.linalg.eigh(left[np.ix_(chosen, chosen)] / np.outer(scale, scale))
    seen = values > 1e-5
    along = vectors[:, seen].T @ (signal[chosen] / scale)
    return float(np.sum(along**2 / values[seen]))


__all__ = ["Found", "investigate"]
