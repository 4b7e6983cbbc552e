"""The whole procedure on one recording: readings, means, noise, what is left, who else it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from imuarray.diagnosis import noise as noises
from imuarray.diagnosis import noise_effects as variance
from imuarray.diagnosis.adoption import adopt
from imuarray.diagnosis.clipping import leave_out_clips, lone_checks, together
from imuarray.diagnosis.elimination import clear, freed_places, need
from imuarray.diagnosis.final_checks import (
    drift_checks,
    judged,
    outlier_checks,
    plausibility_checks,
    tail_checks,
)
from imuarray.diagnosis.fit import Fit, fit
from imuarray.diagnosis.parameters import catalogue_effects, columns_of
from imuarray.diagnosis.reading_effects import Structural, find_structural
from imuarray.diagnosis.readings import Readings, arrange, determined, part_of
from imuarray.diagnosis.residual_checks import Check, all_checks
from imuarray.diagnosis.scans import delay_score, sawtooth
from imuarray.diagnosis.scores import Candidate, candidates, log_tail, mask_of, score_all
from imuarray.diagnosis.state import Search, own_turning
from imuarray.diagnosis.thresholds import Thresholds, read_thresholds
from imuarray.recording import Recording

NESTED = {  # an effect, and those that contain it or are contained
    "accelerometer_bias": ("bias_drift",), "gyroscope_bias": ("bias_drift",),
    "sensor_delay": ("sensor_clock",), "bias_drift": ("accelerometer_bias", "gyroscope_bias"),
    "sensor_clock": ("sensor_delay", "gyroscope_delay"),
}  # fmt: skip
LONG = 3500  # samples; longer recordings are looked at in part first
CLEAR = 2.5  # sds of a triad's memory, where all together are beyond doubt
TAILED = 0.25  # log ratio by which a mixture's core may miss the noise
LIKELY = -4.6  # log p of a drift beside an adopted bias
DELAYED = 0.1  # log ratio of noise that an adopted delay may bring with it


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
    structural, readings, mended = find_structural(raw, without)
    used = determined(readings)
    if not used.all():
        raw, readings = raw.select(used), readings.select(used)
    effects = catalogue_effects(without)
    # clocks are scanned for by what a delay would gain, whether or not it is a candidate
    described = effects if "sensor_delay" in effects else (*effects, "sensor_delay")
    columns = columns_of(readings.array, described, readings.position_prior_sd)
    search = Search(readings, columns, effects, thresholds, say)
    search.begin()
    base, excess = search.fit, search.excess
    base_checks = all_checks(base, search.given, search.noise)
    if not mended:
        return Found(search, base, base_checks, structural, [], base_checks, 0.0, True, raw)
    if len(readings.time) > LONG:
        search = looked_ahead(search, part_of(readings, LONG), excess)
    calm(search)
    adopt(search)
    say("fitting to the end")
    search.polish()
    clear(search)
    if "saturation" not in without:
        structural = together(structural, leave_out_clips(search))
    say("judging the noise")
    tailed, in_noise = settle(search, without)
    if "coloured_noise" not in without:
        remember(search)
    say("testing what is left")
    checks = all_checks(search.fit, search.given, search.noise)
    checks += [*outlier_checks(search), *plausibility_checks(search)]
    checks += [*drift_checks(search), *tail_checks(search, tailed)]
    checks += lone_checks(search, tailed)
    calm_ = not any(c.log_p < thresholds.check for c in checks if c.name.startswith("residual"))
    in_noise += named_noise(search, without, tailed, calm_)
    explained, failing = judged(search, checks, in_noise)
    found = Found(search, base, base_checks, structural, in_noise, checks, explained, failing, raw)
    say("looking for what cannot be told apart")
    found.rivals = {c.effect: rivals(search, c.effect) for c in search.causes}
    return found


def looked_ahead(whole: Search, part: Readings, excess: float) -> Search:
    """The whole recording's search, begun with the causes that a part of it shows."""
    ahead = Search(part, whole.columns, whole.effects, whole.thresholds, whole.say)
    ahead.begin()
    calm(ahead)
    adopt(ahead)
    search = Search(whole.readings, whole.columns, whole.effects, whole.thresholds, whole.say)
    search.causes, search.refused, state = ahead.causes, ahead.refused, ahead.fit.state
    search.begin(state.parameters, state.positions, own_turning(state))
    search.excess = excess
    search.trace = ahead.trace
    return search


def calm(search: Search) -> None:
    """Leave out lone outliers while means are looked for, whatever their cause is."""
    limit = search.thresholds.limit("heavy_tails")
    if np.min(noises.tail_log_p(search.noise)) < limit:
        far = np.repeat(search.noise.far, 3, axis=2)
        search.readings = search.readings.without(far)
        search.refit()


def settle(search: Search, without) -> tuple[list, list]:
    """Heavy tails: judged on all readings once the means are known, then left out of the fit.

    Returns the triads [(imu, kind, Mixture)] that have them, or may have, and the cause.
    """
    whole = replace(search.readings, keep=search.allowed)
    search.readings = whole
    search.refit()
    if "heavy_tails" in without:
        return [], []
    limit = search.thresholds.limit("heavy_tails")
    named, hits, others = variance.heavy_tails(search.fit, search.noise, limit)
    if named is None:
        return [], []
    far = np.zeros((*whole.keep.shape[:2], 2), bool)
    for imu, kind, mix in hits:
        far[:, imu, kind] = mix.outlier > 0.5
    search.readings = whole.without(np.repeat(noises.few_at_once(far), 3, axis=2))
    before = len(search.causes)
    search.refit()
    adopt(search)
    if len(search.causes) > before:
        clear(search)
    return hits + others, [named]


def remember(search: Search) -> None:
    """Where the spectrum says that noise is coloured, take its size and memory from all of it.

    Many triads with a little memory each count together.
    """
    triads = np.argwhere(search.readings.exists)
    memories = np.array([variance.autocorrelation(search.fit, *pair) for pair in triads])
    limit = search.thresholds.limit("coloured_noise")
    coloured = search.noise.correlation[search.readings.exists] != 0
    if variance.pooled_memory(search.fit, search.noise, memories) < limit:
        coloured |= np.abs(memories[:, 0]) * np.sqrt(memories[:, 1]) > CLEAR
    if not coloured.any():
        return
    correlation, sd = search.noise.correlation.copy(), search.readings.sd.copy()
    for (imu, kind), (rho, _) in zip(triads[coloured], memories[coloured], strict=True):
        correlation[imu, kind] = rho
        sd[imu, kind] *= np.sqrt(np.nanmean(variance.triad(search.fit, imu, kind) ** 2))
    search.readings = search.readings.with_sd(sd)
    search.fit = fit(
        search.readings, search.columns, search.active, search.fit.state, search.smooth
    )
    search.noise = search.noise._replace(correlation=correlation, sd=sd)
    search.weigh()


def named_noise(search: Search, without, tails, calm) -> list:
    """Scale and colour of the noise, where they depart from what is declared."""
    found, made = [], search.fit
    for kind, name in enumerate(("accelerometer_noise", "gyroscope_noise")):
        if name not in without:
            # the mixture's core is the noise of a triad with heavy tails
            skip = [
                imu for imu, k, mix in tails
                if k == kind and abs(np.log(mix.core * search.readings.sd[imu, k]
                                            / search.readings.declared[imu, k])) < TAILED
            ]  # fmt: skip
            limit = search.thresholds.limit(name)
            named = variance.noise_scale(made, search.noise, kind, limit, timed(search), skip, calm)
            found += [named] if named and named.gain > 0 else []
    if "coloured_noise" not in without:
        limit = search.thresholds.limit("coloured_noise")
        named = variance.coloured(made, search.noise, limit, calm)
        found += [named] if named and named.gain > 0 else []
    return sorted(found, key=lambda item: item.log_p)


def timed(search: Search) -> np.ndarray:
    """Log ratios of noise not to be believed (N,): delays carry the derivatives' own noise."""
    least = np.zeros(len(search.readings.labels))
    for cause in search.causes:
        if cause.effect in ("sensor_delay", "gyroscope_delay", "sensor_clock"):
            least[list(cause.imus)] = DELAYED
    return least


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
        close = score is not None and score.log_p - own_log < search.thresholds.rival
        nested = candidate.effect in NESTED.get(effect, ())
        alike = not nested and _shared(given, fit_, candidate, left, signal) > (
            search.thresholds.alike * power
        )
        if close or alike:
            found.append(candidate.effect)
    if effect in ("sensor_delay", "gyroscope_delay") and "sensor_clock" in search.effects:
        found += ["sensor_clock"] if maybe_clock(search, cause, own) else []
    if effect.endswith("_bias") and "bias_drift" in search.effects:
        found += ["bias_drift"] if maybe_drift(search, cause) else []
    return found


def maybe_clock(search: Search, cause, own) -> bool:
    """Whether a clock, whose sawtooth has a third of its constant's power, is not ruled out."""
    score, information = delay_score(search.fit)
    gains = [
        sawtooth(search.readings.time, score[:, imu], information[:, imu])[0] for imu in cause.imus
    ]
    return bool(np.sum(gains) > own / 6)


def maybe_drift(search: Search, cause) -> bool:
    """Whether a bias may change through the recording: not enough to be adopted, but likely."""
    kind = cause.effect.removesuffix("_bias")
    tried = [Candidate("bias_drift", cause.imus, f"{kind} {form}") for form in ("linear", "cubic")]
    scores = score_all(search.given, search.fit, tried)
    return any(log_tail(max(s.statistic, 1e-9), s.freedom) < LIKELY for s in scores)


def _shared(given, fit_, candidate, left, signal) -> float:
    """How much of a signal's power a candidate could explain."""
    chosen = given.places(mask_of(fit_.columns, candidate))
    scale = given.scale[chosen]
    values, vectors = np.linalg.eigh(left[np.ix_(chosen, chosen)] / np.outer(scale, scale))
    seen = values > 1e-5
    along = vectors[:, seen].T @ (signal[chosen] / scale)
    return float(np.sum(along**2 / values[seen]))


__all__ = ["Found", "investigate"]
