"""Effects that a score at zero cannot see: an instant or a frequency is to be found first."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from imuarray.diagnosis.fit import Fit, normal
from imuarray.diagnosis.parameters import POSITION
from imuarray.diagnosis.readings import Readings
from imuarray.diagnosis.scores import Candidate, Evidence, Score, log_tail, robust_inverse
from imuarray.model.timing import clock_turns

PHASES = np.arange(32) / 32  # of a turn, tried at first
CUTS = 24  # instants tried at first
BELIEVED = -10.0  # log p of a sawtooth beyond a constant delay
MANY = 2.6  # log of the independent sawtooths per sample, from simulated white scores
FAIR = 0.05  # of the constant delay's chi-square
LEAST_TURNS = 3  # of a clock against the host's; fewer are a drift of the delay


class Found(NamedTuple):
    """A scanned candidate's test and where its nonlinear parameters begin, by IMU."""

    score: Score
    values: dict[int, np.ndarray]


def delay_score(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Each sample's score and information of each IMU's delay, (T, N) each, motion projected."""
    column = int(fit.columns.of("sensor_delay")[0])
    return delay_parts(fit.residual, fit.whitened[..., column], fit.through[..., column])


def delay_parts(residual, along, through) -> tuple[np.ndarray, np.ndarray]:
    """The same from the residual and the derivative by the delay, whitened and projected."""
    score = np.einsum("tki,tki->tk", along, residual)
    information = np.sum(along**2, axis=2) - np.sum(through**2, axis=2)
    return score, np.maximum(information, 1e-300)


def scan_clocks(fit: Fit, imus, delays: dict) -> list[Found]:
    """A sawtooth age for each IMU, and for those together that show one beyond a constant delay.

    ``delays`` (imu tuple -> chi-square of a constant delay) is what a clock must go beyond: its
    sawtooth counts on top, and must be worth a fair share of it (a delay that is large leaves a
    little that a sawtooth can use, until it is adopted).
    """
    score, information = delay_score(fit)
    time, each = fit.readings.time, {}
    for imu in imus:
        gain, values = sawtooth(time, score[:, imu], information[:, imu])
        log_p = log_tail(max(gain, 1e-9), 3) + MANY + np.log(len(time) * len(imus))
        if log_p < BELIEVED and gain > FAIR * delays.get((imu,), 0.0):
            each[imu] = (gain, values)
    for imu in list(each):
        if any(_echo(each[imu], other) for other in each.values()):
            del each[imu]
    found = [
        Found(_clock_score((imu,), gain, delays, len(time), len(imus)), {imu: values})
        for imu, (gain, values) in each.items()
    ]
    if len(each) > 1:
        gain = sum(gain for gain, _ in each.values())
        several = _clock_score(tuple(each), gain, delays, len(time), 1)
        found.append(Found(several, {imu: values for imu, (_, values) in each.items()}))
    return found


def _echo(one, other) -> bool:
    """Whether a sawtooth is what a far stronger one of the same frequency leaves elsewhere."""
    same = abs(abs(one[1][1]) - abs(other[1][1])) < 0.1
    return same and one[0] < 0.2 * other[0]


def _clock_score(imus, gain, delays, samples, count) -> Score:
    freedom = 4 * len(imus)
    statistic = gain + delays.get(imus, sum(delays.get((imu,), 0.0) for imu in imus))
    log_p = log_tail(statistic, freedom) + len(imus) * (MANY + np.log(samples)) + np.log(count)
    return Score(Candidate("sensor_clock", imus), float(statistic), freedom, min(log_p, 0.0))


def sawtooth(time, score, information):
    """(gain over a constant in chi-square, (P, f, phi, c, g)) of one IMU's best sawtooth age."""
    step = np.median(np.diff(time))
    place = np.round((time - time[0]) / step).astype(int)
    size = 2 ** int(np.ceil(np.log2(4 * (place[-1] + 1))))
    grid = np.zeros(size)
    np.add.at(grid, place, score - information * score.sum() / information.sum())
    power = np.abs(np.fft.rfft(grid)) ** 2
    frequency = np.fft.rfftfreq(size, step)
    power[frequency * (time[-1] - time[0]) < LEAST_TURNS] = 0.0
    best = (0.0, np.zeros(5))
    width = frequency[1]
    for guess in frequency[np.argsort(power)[-3:]]:
        for fine in (1.0, 0.25, 0.06):
            around = best[1][1] if fine < 1 and best[0] > 0 else guess
            for trial in around + fine * width * np.linspace(-1, 1, 9):
                gain, (period, phase, offset) = _shape(trial * time, score, information)
                if gain > best[0]:
                    turn = np.sign(period)  # the same sawtooth with time reversed
                    best = (gain, np.array([turn * period, turn * trial, turn * phase, offset, 0]))
    return best


def _shape(turns, score, information, start=PHASES):
    """(gain, (P, phi, c)): best phase of a sawtooth of given turns (T,), by least squares.

    A negative period is the same sawtooth with time reversed.
    """
    shape = np.mod(turns[:, None] + start, 1.0) - 0.5
    weighted = information[:, None] * shape
    a, b, c = np.sum(weighted * shape, 0), weighted.sum(0), information.sum()
    # the reading is taken age earlier: the delay is minus the age
    right, total = -(score @ shape), -score.sum()
    determinant = np.maximum(a * c - b**2, 1e-300)
    period, offset = (c * right - b * total) / determinant, (a * total - b * right) / determinant
    gain = period * right + offset * total - total**2 / np.maximum(c, 1e-300)
    k = int(np.argmax(gain))
    return float(gain[k]), np.array([period[k], start[k], offset[k]])


def refine_clock(readings: Readings, clock, score, information) -> np.ndarray:
    """(P, f, phi, c, g) of an adopted clock, from each sample's own age; P and c are for the fit.

    The residual, by its ``score`` and ``information`` of the delay (T,), says how far each age
    is off; phase, frequency and drift are searched around where they are, along polynomials of
    time that the data tell apart, the grid drawing in.
    """
    time, span = readings.time, readings.span
    turns = clock_turns(clock, time, span)
    age = clock[3] + clock[0] * (turns - np.floor(turns) - 0.5)
    age_score = score - information * age  # of a delay counted from nothing
    powers = np.stack([np.ones_like(time), time, (time - span / 2) ** 2 / 2], axis=1)
    root = np.sqrt(information)[:, None]
    mixed = np.linalg.inv(np.linalg.qr(root * powers)[1])
    # each reaches one turn at most; the first is one turn throughout, whatever LAPACK's sign
    mixed = mixed / np.abs(powers @ mixed).max(axis=0) * np.sign(mixed[0, 0])
    along, reach, best = powers @ mixed, 0.06, (-np.inf, np.zeros(3), clock[[0, 2, 3]])
    for _ in range(5):
        for order, wide in ((1, 2.5), (2, 1.0)):
            centre = best[1].copy()
            for part in wide * reach * np.linspace(-1, 1, 9):
                moved = centre.copy()
                moved[order] += part
                starts = moved[0] + reach * np.linspace(-1, 1, 17)
                path = turns + along[:, 1:] @ moved[1:]
                gain, values = _shape(path, age_score, information, starts)
                if gain > best[0]:
                    moved[0] = values[1]
                    best = (gain, moved, values)
        reach /= 3
    _, moved, (period, _, offset) = best
    shift = mixed @ moved
    return np.array([period, clock[1] + shift[1], clock[2] + shift[0], offset, clock[4] + shift[2]])


def scan_shifts(fit: Fit, given: Evidence, imus) -> list[Found]:
    """A step of each triad's position, at the instant where it gains most."""
    active = given.places(fit.active)
    chosen = fit.columns.of(POSITION)
    outside = robust_inverse(
        given.information[np.ix_(active, active)] + given.precision[np.ix_(active, active)]
    )
    edges = np.linspace(0, len(fit.residual), CUTS + 1).astype(int)
    found = []
    for imu in imus:
        mask = fit.active.copy()
        mask[imu, chosen] = True
        parts = [normal(fit.residual, fit.whitened, fit.through, mask, slice(a, b))
                 for a, b in zip(edges[:-1], edges[1:], strict=True)]  # fmt: skip
        own, rest = _places(mask, fit.active, imu, chosen)
        ridge = np.diag(1.0 / fit.columns.prior_sd[fit.columns.of("position_shift")[:3]] ** 2)
        best = (0.0, 0, np.zeros(3))
        for cut in range(1, CUTS):
            gain, shift = _step_gain(parts[cut:], own, rest, outside, ridge)
            best = max(best, (gain, edges[cut], shift), key=lambda b: b[0])
        gain, place, shift = best
        log_p = log_tail(gain, 3) + np.log(2 * len(imus) * CUTS)
        score = Score(Candidate("position_shift", (imu,)), gain, 3, min(log_p, 0.0))
        found.append(Found(score, {imu: np.append(shift, fit.readings.time[place])}))
    return found


def _places(mask, active, imu, chosen):
    """Places in the mask's parameters of the IMU's position, and of the active ones."""
    number = np.full(mask.shape, -1)
    number[mask] = np.arange(mask.sum())
    return number[imu, chosen], number[active]


def _step_gain(parts, own, rest, outside, ridge):
    """(chi-square, shift (3,) m) of a position step over the given stretches of time."""
    information = sum(part[0] for part in parts)
    score = sum(part[1] for part in parts)[own]
    cross = information[np.ix_(own, rest)]
    block = information[np.ix_(own, own)] - cross @ outside @ cross.T + ridge
    inverse = robust_inverse(block)
    shift = inverse @ score
    return float(score @ shift), shift


def refine_instant(fit: Fit, imu: int, around: float) -> float:
    """The instant of an adopted step, to a sample: where moving it gains most.

    The step's derivative, taken from the residual sample by sample, is added before or removed
    after; the shift itself stays.
    """
    columns, state = fit.columns, fit.state
    place = np.flatnonzero(columns.of(POSITION) >= 0)
    chosen = columns.of(POSITION)[place]
    shift = columns.model.split(state.parameters)["position_shift"][imu, :3]
    along = fit.whitened[:, imu][..., chosen] @ shift
    through = fit.through[:, imu][..., chosen] @ shift
    linear = np.einsum("ti,ti->t", along, fit.residual[:, imu])
    square = np.sum(along**2, axis=1) - np.sum(through**2, axis=1)
    after = fit.readings.time >= around
    # switching the step off where it is on costs s + i / 2, on where it is off -s + i / 2
    change = np.where(after, linear + square / 2, -(linear - square / 2))
    # cost of starting at sample n instead: samples between change their state
    first = int(np.argmax(after)) if after.any() else len(after) - 1
    forward = np.concatenate([[0.0], np.cumsum(change[first:])])
    backward = np.concatenate([[0.0], np.cumsum(-(linear - square / 2)[:first][::-1])])[::-1]
    cost = np.concatenate([backward[:-1], forward[:-1]])
    return float(fit.readings.time[int(np.argmin(cost))])
