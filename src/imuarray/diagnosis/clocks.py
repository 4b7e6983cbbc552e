"""IMUs on clocks of their own: the test for `sensor_clock`, by a scan (`engine.clock_scan`)."""

from functools import partial

import numpy as np

from imuarray.diagnosis.scores import Candidate, Information, Scanned, Score
from imuarray.engine.clocks import CLOCK, DELAY, age_of, delay_parts, sawtooth, sawtooths
from imuarray.engine.fit import Fit
from imuarray.engine.gyroscope_clocks import clocks_from_gyroscopes, enough_gyroscopes
from imuarray.engine.linearise import State
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS
from imuarray.model.timing import clock_turns
from imuarray.tails import log_chi_square


def delay_score(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Each sample's score and information of each IMU's delay, (T, N) each, motion projected."""
    column = int(fit.columns.of(DELAY)[0])
    return delay_parts(fit.residual, fit.whitened[..., column], fit.through([column])[..., 0])


def sawtooth_scan(fit: Fit, given: Information, imus, delays: dict) -> list[Scanned]:
    """A sawtooth age for each IMU, and for those together that show one beyond a constant delay.

    ``delays`` (imu tuple -> chi-square of a constant delay) is what a clock must go beyond: its
    sawtooth counts on top, and must gain a fair share of it (a delay that is large leaves a
    little that a sawtooth can use, until it is adopted).
    """
    score, information = delay_score(fit)
    time = fit.readings.time
    each = sawtooths(time, score, information, imus, delays, partial(wider, fit, given))
    found = [
        Scanned(_clock_score((imu,), gain, delays, len(time), len(imus)), {imu: values})
        for imu, (gain, values) in each.items()
    ]
    if len(each) > 1:
        gain = sum(gain for gain, _ in each.values())
        several = _clock_score(tuple(each), gain, delays, len(time), 1)
        found.append(Scanned(several, {imu: values for imu, (_, values) in each.items()}))
    return found


def wider(fit: Fit, given: Information, imu: int, clock) -> float:
    """How much larger AR(1) noise makes the variance of a sawtooth's score than white noise does.

    Its density at the sawtooth's frequency: the derivative by the delay is smooth in time. Of the
    IMU's two triads the larger, and at least 1.
    """
    if given.correlation is None:
        return 1.0
    rho, step = given.correlation[imu], np.median(np.diff(fit.readings.time))
    turn = 2 * np.pi * clock[1] * step
    return float(max(1.0, np.max((1 - rho**2) / (1 + rho**2 - 2 * rho * np.cos(turn)))))


def _clock_score(imus, gain, delays, samples, count) -> Score:
    freedom = 4 * len(imus)
    statistic = gain + delays.get(imus, sum(delays.get((imu,), 0.0) for imu in imus))
    tried = len(imus) * (SETTINGS.many + np.log(samples)) + np.log(count)
    log_p = log_chi_square(statistic, freedom) + tried
    return Score(Candidate(CLOCK, imus), float(statistic), freedom, min(log_p, 0.0))


def started_by_gyroscopes(readings: Readings, state: State, clocks: dict) -> tuple[State, dict]:
    """Rough motion: (state, {imu: (P, f, phi, c, g)}), all clocks from the gyroscopes alone.

    As they are where too few gyroscopes have one.
    """
    if not enough_gyroscopes(readings, clocks):
        return state, clocks
    clocks = clocks_from_gyroscopes(readings, state.motion[:, 3:6], clocks)
    return state._replace(rough_prior=state.rough_prior.freed()), clocks


def maybe_clock(search, cause, own: float) -> bool:
    """Whether a clock, whose sawtooth has a third of its constant's power, is not ruled out.

    ``own``: chi-square of the delay that was adopted as ``cause``.
    """
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
    along, through = fit.whitened[..., column], fit.through([column])[..., 0]
    score, _ = delay_score(fit)
    clocks = search.columns.model.split(np.asarray(fit.state.parameters))[CLOCK]
    readings = search.readings
    delay = -age_of(clocks.T, clock_turns(clocks.T, readings.time[:, None], readings.span))

    def informed(values):
        common = np.einsum("tkd,tk->td", through, values)
        own = np.sum(along**2, axis=2) * values
        return own - np.einsum("tkd,td->tk", through, common)

    imus = list(search.clocks)
    own, moved = np.zeros_like(delay), np.zeros_like(delay)
    own[:, imus] = delay[:, imus]
    moved[:, imus] = np.roll(delay[:, imus], 1, axis=1)
    bare = score + informed(own)

    def nats(values):
        return float(np.sum(values * (bare - informed(values) / 2)))

    return nats(own), nats(moved) if len(imus) > 1 else 0.0
