"""Causes adopted one by one: the most telling test, refitted jointly, kept on held-out evidence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imuarray.diagnosis.elimination import heldout_gain, prune
from imuarray.diagnosis.fit import at, flat_parameters, from_flat
from imuarray.diagnosis.scans import refine_instant, scan_clocks, scan_shifts
from imuarray.diagnosis.scores import Candidate, candidates, score_all
from imuarray.diagnosis.state import Cause, Rung, Search, started

PATIENCE = 8  # refusals in a row: what is left is none of the catalogue
MOST = 12  # causes
KEPT = 0.05  # of the gain that a test promises must be there on held-out time
LEAST_Z = 1.5  # standard errors that a gain on held-out time must have
ROUGH_Z = 2.0  # the same where the motion is rough, and few stretches decide
SURE = 50.0  # nats; smaller promises may break


def tried(search: Search) -> list[Candidate]:
    """What may be adopted: neither refused before, nor there already."""
    exists = search.readings.exists
    there = {(c.effect, k, v) for c in search.causes for k in c.imus for v in c.variants}
    found = candidates(search.columns, exists, search.effects)
    return [
        c for c in found
        if (c.effect, c.imus, c.variant) not in search.refused
        and not all((c.effect, k, c.variant) in there for k in c.imus)
        and not (c.effect == "sensor_delay" and set(c.imus) <= set(search.clocks))
    ]  # fmt: skip


def proposals(search: Search):
    """[(score, start values by IMU or None)] of all tests and scans, most telling first."""
    found = [(score, None) for score in score_all(search.given, search.fit, tried(search))]
    exists = search.readings.exists
    both = [int(k) for k in np.flatnonzero(exists.all(axis=1))]
    taken = {(c.effect, k) for c in search.causes for k in c.imus}
    if "sensor_clock" in search.effects:
        imus = [k for k in both if ("sensor_clock", k) not in taken]
        delays = {
            s.candidate.imus: s.statistic for s, _ in found if s.candidate.effect == "sensor_delay"
        }
        found += scan_clocks(search.fit, imus, delays) if imus else []
    if "position_shift" in search.effects:
        imus = [int(k) for k in np.flatnonzero(exists[:, 0]) if ("position_shift", k) not in taken]
        found += scan_shifts(search.fit, search.given, imus)
    refused = search.refused
    named = [
        (s, v)
        for s, v in found
        if (s.candidate.effect, s.candidate.imus, s.candidate.variant) not in refused
    ]
    return sorted(named, key=lambda pair: pair[0].log_p)


def adopt(search: Search) -> None:
    """Forward: adopt while a test is significant, large enough and gains on held-out time."""
    vain = 0
    while len(search.causes) < MOST and vain < PATIENCE:
        best, values = (proposals(search) or [(None, None)])[0]
        limit = search.thresholds.limit(best.candidate.effect) if best else 0.0
        if best is None or best.log_p > limit:
            break
        if best.statistic < search.least():
            break
        vain = 0 if attempt(search, best, values) else vain + 1


def attempt(search: Search, score, values) -> bool:
    """Adopt a candidate, refit, and take it back where held-out time does not gain."""
    candidate = score.candidate
    causes = [replace(c, variants=set(c.variants)) for c in search.causes]
    before = search.readings, search.jumps, search.fit, search.noise, search.given, causes
    merge(search, candidate, score.log_p)
    gain, error = foreseen(search, candidate, values)
    if keeps(search, score, gain, error):
        search.refit(started(search, candidate, values))
        if candidate.effect == "position_shift":
            move_instant(search, candidate.imus)
        prune(search, candidate.effect)
        gain, error = heldout_gain(search, candidate.effect)
    words = f"{candidate.effect} {candidate.variant} of {label(search, candidate)}"
    if not keeps(search, score, gain, error):
        search.readings, search.jumps, *rest, search.causes = before
        search.fit, search.noise, search.given = rest
        search.refused.add((candidate.effect, candidate.imus, candidate.variant))
        search.say(f"refused {words}: held-out gain {gain:.1f} +- {error:.1f}")
        return False
    search.trace.append(
        Rung(candidate.effect, candidate.imus, score.log_p, gain, error, search.fit.misfit)
    )
    search.say(
        f"adopted {words}: log p {score.log_p:.0f}, held-out gain {gain:.0f} +- {error:.0f} nats"
    )
    return True


def keeps(search: Search, score, gain: float, error: float) -> bool:
    """Whether a gain on held-out time is clear, and a fair part of what the test promised."""
    least = LEAST_Z if search.smooth else ROUGH_Z
    return gain > least * error and gain > KEPT * (score.statistic / 2 - SURE)


def foreseen(search: Search, candidate: Candidate, values) -> tuple[float, float]:
    """The held-out gain as one linearisation foresees it: it spares hopeless fits.

    A clock's first ages are too rough to foresee anything: (inf, 0).
    """
    if candidate.effect == "sensor_clock":
        return np.inf, 0.0
    state = started(search, candidate, values)
    search.fit = at(search.readings, search.columns, search.active, state, False)
    search.weigh()
    return heldout_gain(search, candidate.effect)


def label(search: Search, candidate) -> str:
    """Whose, in words."""
    return (
        "all" if candidate.whole else ", ".join(search.readings.labels[k] for k in candidate.imus)
    )


def merge(search: Search, candidate: Candidate, log_p: float) -> None:
    """Add a candidate to the causes, to one of the same effect where there is one."""
    for cause in search.causes:
        if cause.effect == candidate.effect:
            cause.imus = tuple(sorted({*cause.imus, *candidate.imus}))
            cause.variants.add(candidate.variant)
            cause.log_p = min(cause.log_p, log_p)
            return
    # a drift or a clock has its own constant: the constant alone is no cause of its own
    inside = {
        "bias_drift": ("accelerometer_bias", "gyroscope_bias"),
        "sensor_clock": ("sensor_delay",),
    }
    for lesser in inside.get(candidate.effect, ()):
        drop(search, lesser, candidate)
    search.causes.append(Cause(candidate.effect, candidate.imus, {candidate.variant}, log_p))


def drop(search: Search, effect: str, wider: Candidate) -> None:
    """Take away a lesser effect of the IMUs where a wider one contains it."""
    for cause in list(search.causes):
        same_kind = wider.variant.split(" ")[0] in (*cause.effect.split("_")[:1], "")
        if cause.effect == effect and same_kind:
            cause.imus = tuple(k for k in cause.imus if k not in wider.imus)
            if not cause.imus:
                search.causes.remove(cause)


def move_instant(search: Search, imus, times=3) -> None:
    """Refine an adopted step's instant, alternating with the fit."""
    columns = search.columns
    chosen = columns.of("position_shift")
    for _ in range(times):
        whole = flat_parameters(columns, search.fit.state)
        for imu in imus:
            found = refine_instant(search.fit, imu, whole[imu, chosen[3]])
            moved = abs(found - whole[imu, chosen[3]])
            whole[imu, chosen[3]] = found
        search.refit(from_flat(columns, search.fit.state, whole))
        if moved == 0:
            break


__all__ = ["adopt", "proposals"]
