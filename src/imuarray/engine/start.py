"""Where a fit begins: no effects, the motion as read, omega_dot from the rate's change too.

On a small array the gyroscopes know omega_dot far better than the accelerometers do; two
accelerometers leave it open about the line that joins them.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from imuarray.engine.derivatives import (
    derivatives,
    no_derivatives,
    polynomial_derivative,
    polynomial_taps,
)
from imuarray.engine.linearise import RoughPrior, State, TurningPrior
from imuarray.engine.parameters import Columns
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS
from imuarray.errors import InputError
from imuarray.model.structure import design, products
from imuarray.motion.state import lever


def turned(readings: Readings, state: State, follows: bool = False) -> State:
    """A state with the slope of its own rate as prior mean of omega_dot.

    The slope is a local sextic's, a quartic's in runs too short for that, in a window as short as
    the motion is fast: that of the least sd. ``follows``: as `TurningPrior` has it.
    """
    windows = sorted({max(readings.window // n // 2 * 2 + 1, 5) for n in SETTINGS.slope_windows})
    priors = [_slope_prior(readings, state.motion[:, :3], window) for window in windows]
    slope, sd = min(priors, key=lambda prior: np.median(prior[1]))
    return state._replace(turning=TurningPrior(slope, sd, np.full(len(sd), follows)))


def _slope_prior(readings: Readings, rate, quartic: int) -> tuple[np.ndarray, np.ndarray]:
    """(mean, sd) (T, 3) rad/s^2 of omega_dot by the slope of ``rate`` (T, 3) in a window.

    The sd is the gyroscopes' noise in it, and what a quartic leaves out, as the sextic shows it; in
    runs shorter than the window all that is known is omega_dot's size. A polynomial makes fast
    motion too small in all samples alike: the sd is so wide that this is no more than
    `coherent_gain` of what they say together.
    """
    sextic = 3 * quartic // 4 * 2 + 1
    used = readings.keep[..., 3:] / np.square(readings.sd[:, 1])[:, None]
    noise = 1.0 / np.sqrt(np.maximum(used.sum(axis=1), used.max(initial=0.0)))
    short, spread = _slope(readings, rate, quartic, 4)
    slope, other = _slope(readings, rate, sextic, 6)
    long, left = other > 0, 0.0
    if long.any():
        padded = np.pad(_taps(readings, quartic, 4), (sextic - quartic) // 2)
        both = np.sum((_taps(readings, sextic, 6) - padded) ** 2)  # noise of the difference
        left = max(np.mean((slope - short)[long] ** 2 - both * noise[long] ** 2), 0.0)
        short[long], spread[long] = slope[long], other[long]
    sd = np.sqrt((spread[:, None] * noise) ** 2 + left)
    known = spread > 0.0
    together = np.sqrt(np.sum((short[known] / sd[known]) ** 2))
    window, degree = (sextic, 6) if long.any() else (quartic, 4)
    coherent = abs(gain_error(readings, rate, window, degree)) * together
    sd *= max(1.0, coherent / SETTINGS.coherent_gain)
    alone = spread == 0.0  # in runs that are too short: as large as elsewhere
    sd[alone] = np.sqrt(np.mean(short[~alone] ** 2)) if not alone.all() else np.inf
    return short, sd


def gain_error(readings: Readings, rate, window, degree) -> float:
    """By how much of itself a local polynomial's slope of ``rate`` (T, 3) is too large, coherently.

    From the rate's spectrum in the longest runs, where it is above the gyroscopes' noise, and from
    the polynomial's frequency response.
    """
    first, lengths = np.unique(readings.run, return_index=True, return_counts=True)[1:]
    size = lengths.max()
    if size < window:
        return 0.0
    # of stretches of a long recording all: some are calm
    values = rate[first[lengths == size, None] + np.arange(size)]
    taper = np.hanning(size)[:, None]
    values = taper * (values - values.mean(axis=1, keepdims=True))
    power = np.mean(np.sum(np.abs(np.fft.rfft(values, axis=1)) ** 2, axis=2), axis=0)
    precision = np.sum(readings.keep[..., 3] / np.square(readings.sd[:, 1]), axis=1)
    power[power < SETTINGS.clear_motion * 3 * np.sum(taper**2) / np.median(precision)] = 0.0
    turns = 2 * np.pi * np.fft.rfftfreq(size)  # rad a sample
    places = np.arange(window) - window // 2
    response = np.sin(np.outer(turns, places)) @ polynomial_taps(window, window // 2, 1, degree)
    squares = power * turns**2
    return float(np.sum(power * turns * (response - turns)) / max(np.sum(squares), 1e-300))


def _taps(readings: Readings, window, degree, place=None) -> np.ndarray:
    """(window,) weights that give the slope at a place, by default the middle; 1/s."""
    place = window // 2 if place is None else place
    return polynomial_taps(window, place, 1, degree) / np.median(np.diff(readings.time))


def _slope(readings: Readings, rate, window, degree) -> tuple[np.ndarray, np.ndarray]:
    """The rate's slope (T, 3), and how noise of one reading shows in it (T,), 1/s; 0 for none."""
    slope = polynomial_derivative(readings.time, readings.run, rate, window, 1, degree)
    sizes = [np.linalg.norm(_taps(readings, window, degree, place)) for place in range(window)]
    first, count = np.unique(readings.run, return_index=True, return_counts=True)[1:]
    begin, length = np.repeat(first, count), np.repeat(count, count)
    place = np.arange(len(rate)) - begin
    left, half = length - 1 - place, window // 2
    place = np.where(place < half, place, np.where(left < half, window - 1 - left, half))
    return slope, np.where(length < window, 0.0, np.array(sizes)[np.clip(place, 0, window - 1)])


def start(readings: Readings, columns: Columns) -> State:
    """The state of no effects: omega the gyroscopes' median, omega_dot and s by least squares.

    Of two IMUs the rate's change is a prior of omega_dot; InputError where samples are too few.
    """
    positions = readings.array.relative
    used = readings.keep[..., 3:]
    rate = np.nanmedian(np.where(used, readings.values[..., 3:], np.nan), axis=1)
    linear = linear_motion(readings, positions, rate)
    motion = np.concatenate([rate, linear], axis=1)
    parameters = np.zeros(columns.model.effect_size)
    found = State(motion, positions, parameters, no_derivatives(len(motion), len(positions)))
    if not readings.pair:
        return found
    if not readings.gapless:
        raise InputError(
            "recording: expected samples that follow each other, of two IMUs, found too few: the"
            " rate's change from sample to sample is their angular acceleration"
        )
    found = turned(readings, found)
    return found._replace(motion=np.hstack([rate, found.turning.mean, linear[:, 3:]]))


def linear_motion(readings, positions, rate) -> np.ndarray:
    """omega_dot and s (T, 6) of the accelerometers off their rails, given omega."""
    count = len(positions)
    both = design(positions)
    force = readings.values[:, :count, :3].reshape(len(rate), -1)
    weight = readings.weights[:, :count, :3].reshape(len(rate), -1)
    target = weight * (force - products(rate) @ both[:, :6].T)
    matrix = weight[..., None] * both[None, :, 6:]
    left = np.swapaxes(matrix, 1, 2) @ matrix
    if readings.pair:
        left += 1e-9 * np.trace(left, axis1=1, axis2=2)[:, None, None] * np.eye(6)
    right = np.einsum("tri,tr->ti", matrix, target)
    return np.linalg.solve(left, right[..., None])[..., 0]


def is_smooth(readings: Readings, motion) -> bool:
    """True where neighbouring samples determine derivatives: omega's slope is omega_dot.

    That of four accelerometers or more may be without one, which is late or filtered.
    """
    rate, count, places = motion[:, :3], len(readings.array.positions), readings.array.relative
    slope = polynomial_derivative(readings.time, readings.run, rate, readings.window, 1)

    def follows(turn, of=slope) -> bool:
        return bool(np.corrcoef(of.ravel(), turn.ravel())[0, 1] > SETTINGS.smooth)

    if follows(motion[:, 3:6]) or count < 4:
        return follows(motion[:, 3:6])
    whole = readings.keep[:, :count, :3].all(axis=(1, 2))
    seen = lever(rate[whole, None], motion[whole, None, 3:6], places) + motion[whole, None, 6:9]
    off = np.sum((readings.values[whole, :count, :3] - seen) ** 2, axis=(0, 2))
    others = np.delete(places, np.argmax(off), axis=0)
    sizes = np.linalg.svd(others - others.mean(axis=0), compute_uv=False)
    if whole.sum() < SETTINGS.least_samples or sizes[1] < SETTINGS.known_line * sizes[0]:
        return False
    worst = np.arange(len(readings.labels)) == np.argmax(off)
    few = readings.without(np.repeat([True, False], 3) & worst[:, None]).select(whole)
    return follows(linear_motion(few, places, rate[whole])[:, :3], slope[whole])


def with_derivatives(readings, state, smooth) -> State:
    """The state with the time derivatives of its own motion, if they are not free."""
    if not smooth:
        return state
    if state.turning is not None:
        state = turned(readings, state, bool(state.turning.follows.any()))
    found = derivatives(readings, state.motion, state.positions)
    return state._replace(derivatives=found)


def with_rough_prior(readings: Readings, state: State) -> State:
    """The state with omega double dot and s dot free: neighbours determine them only roughly.

    Their prior has the polynomials' mean, and for sd ten times the size of the differences near by.
    It is that of the first motion and stays: one that followed the fit would shrink with it.
    What the gyroscopes' omega dot may have of its own is as large as twice the step from a sample
    to the next, once it is `freed`.
    """
    dt = np.median(np.diff(readings.time))
    found = derivatives(readings, state.motion, state.positions)
    mean = np.hstack([*found[:2], np.zeros_like(found[0])])
    steps = np.diff(state.motion[:, 3:], axis=0, append=state.motion[-1:, 3:]) / dt
    steps[np.diff(readings.run, append=readings.run[-1]) > 0] = 0.0
    near = uniform_filter1d(np.mean(steps.reshape(-1, 2, 3) ** 2, axis=-1), SETTINGS.near, axis=0)
    size = np.repeat(np.sqrt(near) + 0.1 * np.sqrt(near.mean(axis=0)), 3, axis=1)
    own = SETTINGS.gyroscopes_own * dt * size[:, :3]
    sd = np.hstack([SETTINGS.wide * size, SETTINGS.tied * own])
    nothing = no_derivatives(len(mean), len(state.positions))
    return state._replace(
        motion=np.hstack([state.motion, mean]), derivatives=nothing,
        rough_prior=RoughPrior(mean, sd, own),
    )  # fmt: skip


def with_free_gyroscopes(readings: Readings, state: State) -> State:
    """The state where all that gyroscopes see of rough motion is free: to third order, and omega.

    The sds are where an `estimate` begins, which sizes them.
    """
    prior = state.rough_prior.freed()
    dt, nothing = np.median(np.diff(readings.time)), np.zeros((len(readings.time), 6))
    third = SETTINGS.wide / (SETTINGS.gyroscopes_own * dt) * prior.own
    sd = np.hstack([prior.sd, third, SETTINGS.offset * prior.own])
    return state._replace(
        motion=np.hstack([state.motion, nothing]),
        rough_prior=prior._replace(mean=np.hstack([prior.mean, nothing]), sd=sd),
    )
