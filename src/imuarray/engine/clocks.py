"""Recordings whose IMUs sample on clocks of their own: found, and each reading in its own turn.

Each sample's score and information of an IMU's delay show its age; a clock's ages are a sawtooth,
whose frequency and phase a scan finds. Fits cannot move them past the sawtooth's jumps.
"""

from dataclasses import replace

import numpy as np

from imuarray.engine.estimate import Recorded
from imuarray.engine.gyroscope_clocks import clocks_from_gyroscopes, enough_gyroscopes, with_phases
from imuarray.engine.linearise import State, linearise
from imuarray.engine.parameters import Columns
from imuarray.engine.readings import Readings, few_at_once
from imuarray.engine.settings import SETTINGS
from imuarray.engine.start import with_free_gyroscopes
from imuarray.model.timing import clock_turns
from imuarray.tails import log_chi_square

CLOCK, DELAY = "sensor_clock", "sensor_delay"
PHASES = np.arange(32) / 32  # of a turn, tried at first


def delay_of(readings: Readings, columns: Columns, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Each sample's score and information of each IMU's delay at a state, (T, N) each."""
    made = linearise(readings, columns, state, columns.of(DELAY)[:1])
    return delay_parts(made.residual, made.whitened[..., 0], made.projected[..., 0])


def delay_parts(residual, along, projected) -> tuple[np.ndarray, np.ndarray]:
    """Parts from the residual and the derivative by the delay, whitened and projected."""
    score = np.einsum("tki,tki->tk", along, residual)
    information = np.sum(along**2, axis=2) - np.sum(projected**2, axis=2)
    return score, np.maximum(information, 1e-300)


def sawtooths(time, score, information, imus, delays: dict, wider=lambda imu, clock: 1.0) -> dict:
    """{imu: (gain in chi-square, (P, f, phi, c, g))} of those that show one beyond a constant.

    ``wider`` (imu, clock): how much larger than white noise's the variance of its score is.

    ``delays`` (imu tuple -> chi-square of a constant delay): a sawtooth must gain a fair share of
    it (a delay that is large leaves a little that one can use, until it is adopted).
    """
    each = {}
    for imu in imus:
        gain, values = sawtooth(time, score[:, imu], information[:, imu])
        gain /= wider(imu, values)
        log_p = log_chi_square(max(gain, 1e-9), 3) + SETTINGS.many + np.log(len(time) * len(imus))
        if log_p < SETTINGS.sawtooth and gain > SETTINGS.fair * delays.get((imu,), 0.0):
            each[imu] = (gain, values)
    for imu, (gain, clock) in list(each.items()):
        # a far stronger one of the same frequency leaves an echo elsewhere
        if any(abs(abs(clock[1]) - abs(other[1])) < 0.1 and gain < 0.2 * more
               for more, other in each.values()):  # fmt: skip
            del each[imu]
    return each


def sawtooth(time, score, information):
    """(gain over a constant in chi-square, (P, f, phi, c, g)) of one IMU's best sawtooth age."""
    step = np.median(np.diff(time))
    place = np.round((time - time[0]) / step).astype(int)
    size = 2 ** int(np.ceil(np.log2(4 * (place[-1] + 1))))
    grid = np.zeros(size)
    np.add.at(grid, place, score - information * score.sum() / information.sum())
    power = np.abs(np.fft.rfft(grid)) ** 2
    frequency = np.fft.rfftfreq(size, step)
    power[frequency * (time[-1] - time[0]) < SETTINGS.least_turns] = 0.0
    best = (0.0, np.zeros(5))
    width = frequency[1]
    for guess in frequency[np.argsort(power)[-3:]]:
        for fine in (1.0, 0.25, 0.06):
            around = best[1][1] if fine < 1 and best[0] > 0 else guess
            for trial in around + fine * width * np.linspace(-1, 1, 9):
                gain, (period, phase, offset) = _of_phases(trial * time, score, information)
                if gain > best[0]:
                    turn = np.sign(period)  # the same sawtooth with time reversed
                    best = (gain, np.array([turn * period, turn * trial, turn * phase, offset, 0]))
    return best


def _shape(turns, score, information, start):
    """(gain, (P, phi, c)): best phase of a sawtooth of given turns (T,), by least squares.

    A negative period is the same sawtooth with time reversed.
    """
    shape = np.mod(turns[:, None] + start, 1.0) - 0.5
    weighted = information[:, None] * shape
    squares, sums = np.sum(weighted * shape, 0), weighted.sum(0)
    return _best(squares, sums, score @ shape, score.sum(), information.sum(), start)


def _of_phases(turns, score, information):
    """Scores and information at all of `PHASES`, by sums of so many parts of a turn."""
    number, part = len(PHASES), turns - np.floor(turns)
    place = np.minimum((number * part).astype(int), number - 1)
    weights = (information, information * part, information * part**2, score, score * part)
    none, one, two, zeroth, first = (np.bincount(place, w, number) for w in weights)
    # what a phase adds to the parts of a turn, those that it takes past the turn's end one less
    added = PHASES[:, None] - 0.5 - (np.arange(number) >= number - np.arange(number)[:, None])
    return _best(
        two.sum() + 2 * added @ one + added**2 @ none, one.sum() + added @ none,
        first.sum() + added @ zeroth, score.sum(), information.sum(), PHASES,
    )  # fmt: skip


def _best(a, b, along, total, c, start):
    """The best of several phases from sums over their sawtooths: squares, weights, scores."""
    # the reading is taken age earlier: the delay is minus the age
    right, total = -along, -total
    determinant = np.maximum(a * c - b**2, 1e-300)
    period, offset = (c * right - b * total) / determinant, (a * total - b * right) / determinant
    gain = period * right + offset * total - total**2 / np.maximum(c, 1e-300)
    k = int(np.argmax(gain))
    return float(gain[k]), np.array([period[k], start[k], offset[k]])


def refine_clock(readings: Readings, clock, score, information) -> np.ndarray:
    """(P, f, phi, c, g) of an adopted clock, from each sample's own age; P and c are for the fit.

    The residual, by its ``score`` and ``information`` of the delay (T,), says how far each age
    is off; phase, frequency and drift are searched around where they are, along polynomials of
    time that the data distinguish, the grid drawing in.
    """
    time, span = readings.time, readings.span
    turns = clock_turns(clock, time, span)
    age = age_of(clock, turns)
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


def estimated_again(readings: Readings, columns: Columns, state: State, imus) -> State:
    """The state with its clocks' frequency, phase and drift where the ages say.

    ``readings`` with those near the sawtooth's jumps: they are the ones that determine the phase.
    """
    if not imus or state.gyroscopes_free:
        return state
    parts = delay_of(readings, columns, state)
    whole, chosen = columns.flat(state), columns.of(CLOCK)
    for imu in imus:
        own = (part[:, imu] for part in parts)
        whole[imu, chosen] = refine_clock(readings, whole[imu, chosen], *own)
    return columns.unflat(state, whole)


def without_jumps(readings: Readings, columns: Columns, state: State, imus, width):
    """(readings, (T, N, 6) bool of those left out): the side of a jump that one is on is uncertain.

    ``width``: share of a turn within which samples of the clocked ``imus`` are left out.
    """
    near = np.zeros((*readings.keep.shape[:2], 2), bool)
    values = columns.model.split(np.asarray(state.parameters))
    for imu in imus:
        turns = clock_turns(values[CLOCK][imu], readings.time, readings.span)
        near[:, imu] = (np.abs(turns - np.round(turns)) < width)[:, None]
    # what is left must determine the motion
    near = np.repeat(few_at_once(near), 3, axis=2)
    return replace(readings, keep=readings.keep & ~near), near & readings.keep


def age_of(clock, turns):
    """Age (s) by clocks (5, ...) after so many turns."""
    return clock[3] + clock[0] * (turns - np.floor(turns) - 0.5)


def shown_clocks(one: Recorded, columns: Columns) -> dict[int, np.ndarray]:
    """{imu: (P, f, phi, c, g)} of the IMUs whose delays are a sawtooth in time."""
    score, information = delay_of(one.readings, columns, one.state)
    imus = np.flatnonzero(one.readings.exists.any(axis=1))
    each = sawtooths(one.readings.time, score, information, imus, {})
    # in rough motion a first look sees a small part of an age, and so of the period
    least = SETTINGS.least_period if one.smooth else 0.0
    return {int(imu): values for imu, (_, values) in each.items() if values[0] > least}


def with_clocks(one: Recorded, columns: Columns, clocks: dict) -> Recorded:
    """The recording with clocks {imu: (P, f, phi, c, g)} in its parameters."""
    whole, chosen = columns.flat(one.state), columns.of(CLOCK)
    for imu, values in clocks.items():
        whole[imu, chosen] = values
    return replace(one, state=columns.unflat(one.state, whole))


def clocks_in(one: Recorded, columns: Columns, imus) -> dict[int, np.ndarray]:
    """The inverse, of those of ``imus`` that turn."""
    values = columns.flat(one.state)[:, columns.of(CLOCK)]
    return {imu: values[imu] for imu in map(int, imus) if values[imu, 1] != 0.0}


def refined(one: Recorded, keep, columns: Columns, imus) -> Recorded:
    """Phases, rates and drifts again: by the ages, or once by the gyroscopes of rough motion.

    ``keep`` (T, N, 6) bool: the readings to use, those near jumps among them.
    """
    clocks, readings = clocks_in(one, columns, imus), replace(one.readings, keep=keep)
    if one.smooth or not enough_gyroscopes(readings, clocks):
        return replace(one, state=estimated_again(readings, columns, one.state, clocks))
    if one.state.gyroscopes_free:
        return one
    clocks = clocks_from_gyroscopes(readings, one.state.motion[:, 3:6], clocks)
    return with_clocks(one, columns, clocks)


def timed(one: Recorded, keep, columns: Columns, imus) -> Recorded:
    """Each reading in its own clock's turn, or without those near the jumps of clocks ``imus``.

    ``keep`` (T, N, 6) bool: the readings to use, those near jumps among them.
    """
    clocks, state = clocks_in(one, columns, imus), one.state
    readings = replace(one.readings, keep=keep)
    if one.smooth or not enough_gyroscopes(readings, clocks):
        readings, _ = without_jumps(readings, columns, state, clocks, SETTINGS.edge)
        return replace(one, readings=readings)
    if state.rough_prior.sd.shape[1] < 15:
        state = with_free_gyroscopes(readings, state)
    return replace(one, readings=with_phases(readings, state, clocks), state=state)


def started_by_gyroscopes(readings: Readings, state: State, clocks: dict) -> tuple[State, dict]:
    """Rough motion: (state, {imu: (P, f, phi, c, g)}), all clocks from the gyroscopes alone.

    As they are where too few gyroscopes have one.
    """
    if not enough_gyroscopes(readings, clocks):
        return state, clocks
    clocks = clocks_from_gyroscopes(readings, state.motion[:, 3:6], clocks)
    return state._replace(rough_prior=state.rough_prior.freed()), clocks
