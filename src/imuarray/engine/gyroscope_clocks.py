"""Clocks where the motion is rough: rates, drifts and phases from the gyroscopes alone.

What is too fast for the samples passes the gyroscopes' and the accelerometers' filters differently,
so that the accelerometers' omega_dot is not what makes an age visible in a gyroscope's reading.
But all gyroscopes see one omega and one omega_dot, free at each sample:

    y_k = M_k (omega - age_k omega_dot) + b_k,

and three gyroscopes or more that sample at different ages overdetermine both. An oscillator wanders
by tenths of a turn in minutes, and the host reads now before, now after a clock's jump: once the
ages are nearly known, what is left of a reading over omega_dot is how far its own age is off.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from imuarray.engine.linearise import State
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS
from imuarray.model.timing import clock_turns

UNIT = 1e-3  # s, of the ages until their size is known
FEW = 10  # trials at a time, which a cache holds


class Gyroscopes(NamedTuple):
    """Readings of the gyroscopes that have clocks, and omega_dot as accelerometers see it."""

    time: np.ndarray  # (T,)
    span: float
    values: np.ndarray  # (T, K, 3) rad/s
    acceleration: np.ndarray  # (T, 3) rad/s^2


def clocks_from_gyroscopes(readings: Readings, acceleration, clocks: dict) -> dict:
    """{imu: (P, f, phi, c, g)} from as many first guesses of the same form.

    ``acceleration`` (T, 3): omega_dot by the accelerometers. The period that all get is the
    declared one, or makes what the gyroscopes see turn as much as what the accelerometers see,
    where that is smooth.
    """
    imus = sorted(clocks)
    gyroscopes = informative(readings, acceleration, imus)
    guess = np.array([clocks[imu] for imu in imus])
    guess[:, 0], guess[:, 3] = UNIT, 0.0
    maps, weights = np.tile(np.eye(4)[:3], (len(imus), 1, 1)), np.ones(gyroscopes.values.shape[:2])
    for number in range(SETTINGS.rounds):
        ages = ages_of(guess, gyroscopes)
        motion, left = moved(gyroscopes, maps, ages, weights)
        size = 1.4826 * np.median(np.abs(left))
        weights = robust(left, size)
        maps = remapped(gyroscopes, motion, ages, weights)
        if number:
            reach = SETTINGS.reach * SETTINGS.drawn_in**number
            guess = turned(gyroscopes, maps, motion, guess, reach)
    # over all samples: those that were picked turn fast by the accelerometers, and less by others
    gyroscopes = informative(readings, acceleration, imus, None)
    ages = ages_of(guess, gyroscopes)
    motion, left = moved(gyroscopes, maps, ages, np.ones(ages.shape))
    motion = moved(gyroscopes, maps, ages, robust(left, size))[0]
    guess[:, 0] = UNIT * as_much(motion[:, 3:], gyroscopes.acceleration)
    if abs(np.log(np.abs(guess[0, 0]) / readings.period)) < SETTINGS.declared_period:
        guess[:, 0] = np.copysign(readings.period, guess[:, 0])
    return dict(zip(imus, guess, strict=True))


def as_much(turn, acceleration) -> float:
    """The factor by which ``turn`` (T, 3) is as large as omega_dot, in the smoother half: a median.

    What is too fast for the samples passes the two kinds of filter differently.
    """
    both = np.array([turn, acceleration])
    usual = np.sqrt(np.mean(np.sum(both**2, axis=2), axis=1))
    # both alike, or those that are large in one of them would be smaller in the other
    size = np.linalg.norm(both / usual[:, None, None], axis=(0, 2))
    near = np.zeros(len(turn))
    near[1:-1] = np.linalg.norm(np.diff(both / usual[:, None, None], 2, axis=1), axis=(0, 2))
    large = size > 0.5
    smooth = large & (near <= np.median((near / size)[large]) * size)
    ratio = np.divide(*np.linalg.norm(both[:, smooth], axis=2))
    return float(np.sign(np.sum(turn * acceleration)) * np.median(ratio))


def enough_gyroscopes(readings: Readings, imus) -> bool:
    """True where there are gyroscopes and samples enough."""
    together = readings.keep[:, sorted(imus), 3:].all(axis=(1, 2))
    return len(imus) >= SETTINGS.enough and together.sum() >= SETTINGS.least_gyroscope_samples


def robust(left, size) -> np.ndarray:
    """Weights (T, K) of misfits (T, K, 3): near one up to a few times their usual size."""
    return 1 / (1 + (np.sum(left**2, axis=2) / (4 * size) ** 2) ** 2)


def informative(
    readings: Readings, acceleration, imus, most=SETTINGS.most_gyroscope_samples
) -> Gyroscopes:
    """The ``most`` samples of the largest omega_dot at which all the gyroscopes were read."""
    good = np.flatnonzero(readings.keep[:, imus, 3:].all(axis=(1, 2)))
    fast = np.linalg.norm(acceleration[good], axis=1)
    good = np.sort(good[np.argsort(fast)[-(most or len(good)) :]])
    values = readings.values[good][:, imus, 3:]
    return Gyroscopes(readings.time[good], readings.span, values, acceleration[good])


def ages_of(clocks, gyroscopes: Gyroscopes) -> np.ndarray:
    """(T, K) s, by clocks (K, 5)."""
    turns = clock_turns(clocks.T, gyroscopes.time[:, None], gyroscopes.span)
    return clocks[:, 0] * (np.mod(turns, 1) - 0.5)


def moved(gyroscopes: Gyroscopes, maps, ages, weights, stiffness=None):
    """omega and omega_dot (T, 6) by weighted least squares, and what is left (T, K, 3).

    ``stiffness`` (T, 3): omega double dot is free, too, (T, 9); its precision, a reading's being 1.
    """
    samples, number = len(ages), 2 if stiffness is None else 3
    powers = np.stack([np.ones_like(ages), -ages, ages**2 / 2][:number], axis=-1)
    matrix, target = maps[..., :3], gyroscopes.values - maps[..., 3]
    heavy = weights[..., None] * powers
    both = (heavy[..., None] * powers[..., None, :]).reshape(samples, len(maps), -1)
    square = (np.swapaxes(matrix, 1, 2) @ matrix).reshape(len(maps), 9)
    gram = np.tensordot(both, square, axes=(1, 0)).reshape(samples, number, number, 3, 3)
    gram = np.swapaxes(gram, 2, 3).reshape(samples, 3 * number, 3 * number)
    turned_back = np.einsum("kji,tkj->tki", matrix, target)
    right = np.einsum("tka,tki->tai", heavy, turned_back).reshape(samples, -1)
    # ages that agree at a sample do not determine it: it is the accelerometers' then
    ridge = 1e-3 * UNIT**2
    precision = np.full((samples, 3 * number), ridge) * (np.arange(3 * number) // 3 == 1)
    if stiffness is not None:
        precision[:, 6:] = stiffness
    every = np.arange(3 * number)
    gram[:, every, every] += precision
    right[:, 3:6] += ridge * gyroscopes.acceleration
    motion = np.linalg.solve(gram, right[..., None])[..., 0]
    along = np.einsum("tka,tai->tki", powers, motion.reshape(samples, number, 3))
    return motion, target - np.einsum("kij,tkj->tki", matrix, along)


def remapped(gyroscopes: Gyroscopes, motion, ages, weights) -> np.ndarray:
    """(K, 3, 4) each gyroscope's own map and bias, their mean that of perfect ones."""
    maps = []
    for k in range(ages.shape[1]):
        rate = motion[:, :3] - ages[:, k, None] * motion[:, 3:6]
        if motion.shape[1] > 6:
            rate = rate + ages[:, k, None] ** 2 / 2 * motion[:, 6:]
        full = np.hstack([rate, np.ones((len(rate), 1))])
        heavy = weights[:, k, None] * full
        maps.append(np.linalg.solve(heavy.T @ full, heavy.T @ gyroscopes.values[:, k]).T)
    maps = np.array(maps)
    common = maps[..., :3].mean(axis=0)
    maps[..., :3] = maps[..., :3] @ np.linalg.inv(common)
    maps[..., 3] -= maps[..., 3].mean(axis=0)
    return maps


def turned(gyroscopes: Gyroscopes, maps, motion, clocks, reach) -> np.ndarray:
    """The clocks with phase, rate and drift where the gyroscopes' own misfit is least.

    All together first, which moves nothing but the jumps (an age common to all is the motion's);
    then each of its own.
    """
    along, exact = polynomials(gyroscopes)
    rate, turn = (
        np.einsum("kij,tj->tki", maps[..., :3], motion[:, part]) for part in (slice(3), slice(3, 6))
    )
    residual = gyroscopes.values - maps[..., 3] - rate
    turns = clock_turns(clocks.T, gyroscopes.time[:, None], gyroscopes.span)
    most = np.abs(clocks[:, 0]) * np.abs(turn).sum(axis=2)
    whole = residual, turn, turns, most
    out, start = clocks.copy(), np.zeros(len(turns))
    together = _searched(*whole, clocks[:, 0], along, start, True, reach)
    taken = along @ together
    turns += taken[:, None]
    for k in range(len(clocks)):
        own = (part[:, [k]] for part in whole)
        place = _searched(*own, clocks[[k], 0], along, taken, False, reach)
        out[k, [2, 1, 4]] += exact @ (place + together)
    return out


def polynomials(gyroscopes: Gyroscopes) -> tuple[np.ndarray, np.ndarray]:
    """(T, 3) of time, orthonormal under the square of omega_dot, and their phase, rate, drift.

    So they change where the board turns: a recording may be still for most of its time.
    """
    since = gyroscopes.time - gyroscopes.span / 2
    powers = np.stack([np.ones_like(since), gyroscopes.time, since**2 / 2], axis=1)
    weight = np.linalg.norm(gyroscopes.acceleration, axis=1, keepdims=True)
    weight = weight / np.sqrt(np.sum(weight**2))
    scale = np.abs(powers).max(axis=0)
    exact = np.linalg.inv(np.linalg.qr(weight * powers / scale)[1]) / scale[:, None]
    exact *= np.sign(exact[0, 0])
    return powers @ exact, exact


def _searched(residual, turn, turns, most, period, along, taken, together, reach):
    """Coefficients (3,) of ``along`` with the least cost of their sum, within a reach of zero."""
    given = residual, turn, turns, most, period, along
    place = np.zeros(3)
    for order in (1, 2, 1):
        trials = [place]
        for i, j in np.ndindex(9, 11):
            trials.append(place.copy())
            trials[-1][order] += reach * (i / 4 - 1)
            trials[-1][0] += reach * (j / 5 - 1)
        place = trials[np.argmin(_costs(*given, np.array(trials), taken, together))]
    return place


def _costs(residual, turn, turns, most, period, along, trials, taken, together) -> np.ndarray:
    """(n,) sums of what is left, none beyond what a wrong turn costs: outliers count little.

    By clocks (K,) shifted along (T, 3) as each of the ``trials`` (n, 3): ``together``, an age
    common to all is the motion's then, else ``taken`` (T,) is.
    """
    found = np.zeros(len(trials))
    for start in range(0, len(trials), FEW):  # that stay in the cache
        some = slice(start, start + FEW)
        shift = trials[some] @ along.T
        gone = shift if together else taken
        for k in range(turns.shape[1]):
            age = turns[:, k] + shift
            age -= np.floor(age)
            age -= 0.5
            age -= gone
            age *= period[k]
            off, one = np.zeros_like(age), np.empty_like(age)
            for i in range(3):
                np.multiply(age, turn[:, k, i], out=one)
                one += residual[:, k, i]
                off += np.abs(one, out=one)
            found[some] += np.minimum(off, most[:, k], out=off).sum(axis=1)
    return found


def with_phases(readings: Readings, state: State, clocks: dict) -> Readings:
    """The readings with the `clock_deviation` of clocks {imu: (P, f, phi, c, g)}.

    ``state``: one of rough motion, `with_free_gyroscopes`.
    """
    imus = sorted(clocks)
    values = np.array([clocks[imu] for imu in imus])
    kept = readings.keep[:, imus, 3:].all(axis=2)
    used = kept.sum(axis=1) >= SETTINGS.enough
    steady = clock_turns(values.T, readings.time[:, None], readings.span)
    gyroscopes = Gyroscopes(
        readings.time[used], readings.span, readings.values[used][:, imus, 3:],
        state.motion[used, 3:6],
    )  # fmt: skip
    noise = np.sqrt(np.mean(readings.declared[imus, 1] ** 2))
    stiffness = (noise / state.rough_prior.sd[used, 9:12]) ** 2
    every = splines(readings.time, gyroscopes.time)
    shift, place, jumps = _phases(
        gyroscopes, values[:, 0], steady[used], kept[used], stiffness, every[used]
    )
    turns = steady + every @ shift
    whole = np.floor(turns - place)
    whole[used] = jumps
    clock_deviation = np.zeros(readings.values.shape[:2])
    clock_deviation[:, imus] = turns - whole - (steady - np.floor(steady))
    return replace(readings, clock_deviation=clock_deviation)


def splines(time, instants) -> np.ndarray:
    """(T, B) cubic B-splines of ``time``, whose knots share ``instants`` evenly."""
    length = len(instants) * np.median(np.diff(instants))
    spans = int(np.clip(length / SETTINGS.knot, 1, SETTINGS.most_knots))
    inner = np.quantile(instants, np.linspace(0, 1, spans + 1))
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])
    return BSpline.design_matrix(np.clip(time, inner[0], inner[-1]), knots, 3).toarray()


def _phases(gyroscopes: Gyroscopes, period, steady, kept, stiffness, basis):
    """(coefficients (B, K) of turns to add, places of the jumps (K,), jumps so far (T, K))."""
    shift, place = np.zeros((basis.shape[1], len(period))), np.zeros(len(period))
    maps = np.tile(np.eye(4)[:3], (len(period), 1, 1))
    weights, turns, jumps = kept.astype(float), steady, np.floor(steady)
    for number in range(SETTINGS.phase_rounds):
        ages = period * (turns - jumps - 0.5)
        motion, left = moved(gyroscopes, maps, ages, weights, stiffness)
        size = 1.4826 * np.median(np.abs(left[kept]))
        weights = kept * robust(left, size)
        maps = remapped(gyroscopes, motion, ages, weights)
        slope = motion[:, None, 3:6] - ages[..., None] * motion[:, None, 6:]
        slope = -period[:, None] * np.einsum("kij,tkj->tki", maps[..., :3], slope)
        information = kept * np.sum(slope**2, axis=2) / size**2
        off = np.sum(slope * left, axis=2) / np.maximum(information * size**2, 1e-9)
        clear = information * SETTINGS.around_jump**2 > 9.0
        shift = shift + _smoothed(basis, off, weights * information)
        if number < SETTINGS.phase_rounds // 4 or not clear.any(axis=0).all():
            turns = steady + basis @ shift
            continue
        # a whole turn off: the jump has not happened yet, or already
        asked = jumps - np.sign(off) * (np.abs(off) > 0.5)
        turns = steady + basis @ shift
        place = np.nanmedian(np.where(clear, turns - jumps, np.nan), axis=0) - 0.5
        past = turns - place - asked
        near = np.abs(past - 0.5) < 0.5 + SETTINGS.around_jump
        jumps = np.where(clear & near, asked, np.floor(turns - place))
    return shift, place, jumps


def _smoothed(basis, off, weights) -> np.ndarray:
    """Coefficients (B, K) of what turns are ``off`` (T, K), readings of another turn left aside."""
    out = np.zeros((basis.shape[1], off.shape[1]))
    for k in range(off.shape[1]):
        heavy = (weights[:, k] / (1 + (off[:, k] / SETTINGS.jump_jitter) ** 2))[:, None] * basis
        gram = heavy.T @ basis
        gram[np.diag_indices_from(gram)] += 1e-6 * np.trace(gram) / len(gram) + 1e-300
        out[:, k] = np.linalg.solve(gram, heavy.T @ off[:, k])
    return out
