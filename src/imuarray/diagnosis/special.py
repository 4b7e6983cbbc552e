"""Special cases of the search for some effects: the one place that has them, by id.

IMUs on clocks of their own (`sensor_clock`) are found by a scan (`imuarray.engine.clocks`).
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from imuarray.diagnosis import scans as along_time
from imuarray.diagnosis.fit import Fit, delay_score
from imuarray.diagnosis.residual_checks import Check
from imuarray.diagnosis.scores import Candidate, Information, Score, score_all
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.state import need
from imuarray.engine.clocks import CLOCK, DELAY, age_of, sawtooth, sawtooths
from imuarray.engine.settings import SETTINGS as ENGINE
from imuarray.model.effects import EFFECTS
from imuarray.model.timing import clock_turns
from imuarray.tails import log_chi_square

DRIFT = "bias_drift"


def sawtooth_scan(fit: Fit, given: Information, imus, scores) -> list[Score]:
    """A sawtooth age for each IMU, and for those together that show one beyond a constant delay.

    The constant delays among the ``scores`` are what a clock must go beyond: its sawtooth counts
    on top, and must gain a fair share of them (a delay that is large leaves a little that a
    sawtooth can use, until it is adopted).
    """
    delays = {s.candidate.imus: s.statistic for s in scores if s.candidate.effect == DELAY}
    score, information = delay_score(fit)
    time = fit.readings.time
    each = sawtooths(time, score, information, imus, delays, partial(wider, fit, given))
    found = [
        _clock_score({imu: values}, gain, delays, len(time), len(imus))
        for imu, (gain, values) in each.items()
    ]
    if len(each) > 1:
        gain = sum(gain for gain, _ in each.values())
        clocks = {imu: values for imu, (_, values) in each.items()}
        found.append(_clock_score(clocks, gain, delays, len(time), 1))
    return found


def wider(fit: Fit, given: Information, imu: int, clock) -> float:
    """Factor by which AR(1) noise widens the variance of a sawtooth's score against white noise.

    Its density at the sawtooth's frequency: the derivative by the delay is smooth in time. Of the
    IMU's two triads the larger, and at least 1.
    """
    if given.correlation is None:
        return 1.0
    rho, step = given.correlation[imu], np.median(np.diff(fit.readings.time))
    turn = 2 * np.pi * clock[1] * step
    return float(max(1.0, np.max((1 - rho**2) / (1 + rho**2 - 2 * rho * np.cos(turn)))))


def _clock_score(clocks: dict, gain, delays, samples, count) -> Score:
    imus, freedom = tuple(clocks), 4 * len(clocks)
    statistic = gain + delays.get(imus, sum(delays.get((imu,), 0.0) for imu in imus))
    tried = len(imus) * (ENGINE.many + np.log(samples)) + np.log(count)
    log_p = log_chi_square(statistic, freedom) + tried
    return Score(Candidate(CLOCK, imus), float(statistic), freedom, min(log_p, 0.0), clocks)


def maybe_clock(search, cause, own: float) -> bool:
    """True where a clock, its sawtooth a third of the delay's chi-square ``own``, is possible."""
    score, information = delay_score(search.fit)
    total = 0.0
    for imu in cause.imus:
        gain, clock = sawtooth(search.readings.time, score[:, imu], information[:, imu])
        total += gain / wider(search.fit, search.given, imu, clock)
    return bool(total > own / 6)


def placebo_of_ages(search) -> tuple[float, float]:
    """(nats that all IMUs' ages gain at once, nats with each one's given to the next).

    What they have in common the motion takes up; 0 for a single clock, which has no other to go to.
    """
    fit, column = search.fit, search.columns.of(DELAY)[0]
    along, projected = fit.whitened[..., column], fit.projected([column])[..., 0]
    score, _ = delay_score(fit)
    clocks = search.columns.model.split(np.asarray(fit.state.parameters))[CLOCK]
    readings = search.readings
    delay = -age_of(clocks.T, clock_turns(clocks.T, readings.time[:, None], readings.span))

    def informed(values):
        common = np.einsum("tkd,tk->td", projected, values)
        own = np.sum(along**2, axis=2) * values
        return own - np.einsum("tkd,td->tk", projected, common)

    imus = list(search.clocks)
    own, moved = np.zeros((2, *delay.shape))
    own[:, imus], moved[:, imus] = delay[:, imus], np.roll(delay[:, imus], 1, axis=1)
    bare = score + informed(own)

    def nats(values):
        return float(np.sum(values * (bare - informed(values) / 2)))

    return nats(own), nats(moved) if len(imus) > 1 else 0.0


class Special(NamedTuple):
    """An effect's own steps; None where it has none."""

    scan: Callable | None = None  # (fit, given, imus, scores) -> [Score] of those IMUs
    linear: bool = True  # whether one linearisation at what was found predicts anything
    refine: Callable | None = None  # (search, imus) -> search, after its adoption
    maybe: Callable | None = None  # (search, cause, chi-square) -> may it be what is named so?
    placebo: Callable | None = None  # (search) -> (nats, nats)
    check: Callable | None = None  # (search, cause) -> [Check]


def scans(search, scores) -> list[Score]:
    """All scans, of IMUs that can have the effect and have not."""
    exists, found = search.readings.exists, []
    for effect, special in SPECIAL.items():
        if special.scan is None or effect not in search.effects:
            continue
        able = exists[:, EFFECTS[effect].kinds].all(axis=1)
        imus = [int(k) for k in np.flatnonzero(able) if k not in search.imus_with(effect)]
        found += special.scan(search.fit, search.given, imus, scores) if imus else []
    return found


def maybe_drift(search, cause, own) -> bool:
    """True where a bias likely changes through the recording, or as likely grows from nothing."""
    if along_time.maybe_grown(search, cause):
        return True
    kind = EFFECTS[cause.effect].sensors
    tried = [Candidate(DRIFT, cause.imus, f"{kind} {form}") for form in ("linear", "cubic")]
    scores = score_all(search.given, search.fit, tried)
    return any(
        log_chi_square(max(s.statistic, 1e-9), s.freedom) < SETTINGS.likely_drift for s in scores
    )


def drift_check(search, cause) -> list[Check]:
    """A drift that needs its constants only: a misattributed offset."""
    columns = search.columns
    changing = [c for c in columns.of(DRIFT) if columns.places[c][2] > 0]
    statistic, freedom = need(search, DRIFT, among=changing)
    steady = log_chi_square(statistic, max(freedom, 1)) > SETTINGS.limit(DRIFT)
    steady |= statistic < SETTINGS.changing * need(search, DRIFT)[0]
    log_p = SETTINGS.steady_drift if steady else 0.0
    return [Check.of(f"change of {DRIFT}", statistic, log_p, *cause.imus)]


SPECIAL = {
    CLOCK: Special(scan=sawtooth_scan, linear=False, maybe=maybe_clock, placebo=placebo_of_ages),
    along_time.SHIFT: Special(scan=along_time.scan_shifts, refine=along_time.refine_instants),
    along_time.WARM_UP: Special(scan=along_time.scan_warming, maybe=along_time.maybe_warming),
    DRIFT: Special(maybe=maybe_drift, check=drift_check),
}


def placebo_gain(search, cause) -> tuple[float, float]:
    """(nats the cause gains, nats it gains with each IMU's numbers given to the next).

    Against the same model with the cause's parameters at zero, all others refitted (quadratic).
    """
    special = SPECIAL.get(cause.effect)
    if special and special.placebo:
        return special.placebo(search)
    given, columns = search.given, search.columns
    every = columns.mask([cause.effect]) & search.active.any(axis=0)
    flat = columns.flat(search.fit.state)
    rows = np.flatnonzero(every.any(axis=1))
    moved = flat.copy()
    moved[rows] = flat[np.roll(rows, 1)]
    places = given.places(every)
    active = np.setdiff1d(given.places(search.active), places)
    block, slope, *_ = given.conditional(active, of=places)

    def nats(values):
        step = values - flat[every]
        return slope @ step - step @ block @ step / 2

    nothing = nats(np.zeros(len(places)))
    return float(-nothing), float(nats(moved[every]) - nothing)
