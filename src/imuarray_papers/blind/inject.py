"""Effects on noise, instants and finished readings; and all effects by name.

``EFFECTS[id].draw(scene, rng, sensors, size)`` gives a `Change`. Ids of the catalogue are those of
the project's list; ``outside_`` ones are not in it, and the right answer is "unexplained"; no
recording can distinguish ``gauge_`` ones from a clean one.
"""

from functools import lru_cache, partial

import numpy as np

from imuarray_papers.blind import errors  # noqa: F401  (it registers)
from imuarray_papers.blind.change import (
    EFFECTS,
    UNIT_FORCE,
    UNIT_RATE,
    Effect,
    Parameter,
    altered,
    effect,
    kind_names,
    of_kinds,
    spread,
    which_kinds,
)
from imuarray_papers.blind.scene import Pair

# Realistic factors of the noise: 0.5 to 5 times the declared one.
LOUDEST, QUIETEST = 5.0, 0.5
CLOCK_PERIOD = 1e-3  # s, P of a free-running IMU
LATENCY = 5e-5  # s, sd of the host's


def _louder(scene, rng, sensors, size, kinds):
    """The noise of the triad is c_k = exp(size x_k) times the declared one, x_k of one sign.

    All are alike or each is its own, in half the draws each. A quarter of the draws are quieter,
    scaled so that ln 5 louder is answered by 0.5.
    """
    quiet = rng.random() < 0.25 and not scene.measured
    own = rng.uniform(0.5, 1.0, len(sensors)) if rng.random() < 0.5 else np.ones(len(sensors))
    # one triad alone is what the amplitude says
    own /= own.max()
    direction = np.log(QUIETEST) / np.log(LOUDEST) if quiet else 1.0
    factors = np.exp(size * direction * own)
    return {
        "parameters": {"factor": Parameter(factors)},
        "gain": of_kinds(kinds, spread(scene, sensors, factors, 1.0)[:1]),
        # a louder triad is held against the declared level
        "divergence": lambda samples: level_divergence(factors[None]) * samples,
    }


for name, kinds in (("accelerometer_noise", (True, False)), ("gyroscope_noise", (False, True))):
    EFFECTS[name] = Effect(
        name, partial(_louder, kinds=kinds), "1", np.log(1.3), np.log(LOUDEST), np.log(50.0)
    )


def level_divergence(gain: np.ndarray) -> float:
    """KL of N(0, gain^2) from N(0, 1), per sample over triads and axes; gain (T or 1, n)."""
    return float(1.5 * (gain**2 - 1 - np.log(gain**2)).mean(axis=0).sum())


@effect("1", 4.0, 19.0)
def heavy_tails(scene, rng, sensors, size):
    """1 to 10 % of a triad's samples have 1 + size times the noise, all axes together.

    The amplitude is not the share: a small effect would then be less than one wild sample, and a
    recording without any would carry the effect's name.
    """
    kinds = which_kinds(rng)
    share = float(0.01 * 10 ** rng.random())
    wild_ones = max(round(share * len(scene.time)), 1)
    gains = []
    for chosen in kinds:
        rank = rng.random((len(scene.time), len(sensors))).argsort(axis=0).argsort(axis=0)
        gain = spread(scene, sensors, np.where(rank < wild_ones, 1 + size, 1.0), 1.0)
        gains.append(gain if chosen else None)
    true_share, triads = wild_ones / len(scene.time), len(sensors) * sum(kinds)
    factor, of = Parameter(1 + size), kind_names(kinds)
    return {
        "parameters": {"share": Parameter(true_share), "factor": factor, "of": of},
        "gain": Pair(*gains),
        # the level is another effect's
        "divergence": lambda samples: _tails_divergence(true_share, 1 + size) * triads * samples,
    }


@lru_cache(maxsize=256)
def _tails_divergence(share: float, factor: float) -> float:
    """KL per triad-sample of a mixture from the Gaussian with its covariance.

    The mixture is (1 - share) N(0, I) + share N(0, factor^2 I) in three dimensions, so the
    integral is over the radius alone.
    """
    radius = np.geomspace(1e-3, 12 * max(factor, 1.0), 4000)
    variance = 1 + share * (factor**2 - 1)

    def log_normal(v):
        return -1.5 * np.log(2 * np.pi * v) - radius**2 / (2 * v)

    with np.errstate(divide="ignore"):
        parts = np.log([1 - share, share])[:, None] + [log_normal(1.0), log_normal(factor**2)]
    mixture = np.logaddexp(*parts)
    density = 4 * np.pi * radius**2 * np.exp(mixture)
    return float(max(np.trapezoid(density * (mixture - log_normal(variance)), radius), 0.0))


@effect("1", 0.6, 0.9, limit=0.999, from_readings=False)
def coloured_noise(scene, rng, sensors, size):
    """AR(1) noise of the declared sd; size is the coefficient rho."""
    kinds = which_kinds(rng)
    rho = np.zeros(scene.accelerometers)
    rho[list(sensors)] = size
    said = {"coefficient": Parameter(size), "of": kind_names(kinds)}
    if 0 < size < 1:
        lasting = -1 / (scene.sampling_rate * np.log(size))
        said["correlation_time"] = Parameter(float(lasting), "s")
    triads = len(sensors) * sum(kinds)
    return {
        "parameters": said,
        "correlation": of_kinds(kinds, rho),
        # against white noise
        "divergence": lambda samples: -1.5 * np.log1p(-(size**2)) * triads * samples,
    }


@effect("1", 0.05, 0.4, limit=0.95)
def saturation(scene, rng, sensors, size):
    """Clipped at (1 - size) times the largest reading, below the declared range.

    The others of the sensors, which never come to that rail, are not affected.
    """
    kinds = which_kinds(rng)
    rules, said, beyond = [], {}, set()
    names = (("accelerometer_rail", UNIT_FORCE), ("gyroscope_rail", UNIT_RATE))
    known = zip(scene.ideal(), scene.limits, kinds, names, strict=True)
    for values, limit, chosen, (name, unit) in known:
        peak = min(float(np.abs(values[:, list(sensors)]).max()), limit)
        rail = (1 - size) * peak
        rules.append((lambda x, rail=rail: np.clip(x, -rail, rail)) if chosen else None)
        if chosen:
            said[name] = Parameter(rail, unit)
            beyond |= {k for k in sensors if np.abs(values[:, k]).max() > rail}
    clipped = tuple(k for k in sensors if k in beyond) or sensors
    after = altered(clipped, Pair(*rules))
    return {"sensors": clipped, "parameters": said, "after": after}


@effect("1", 1e-3, 0.1, limit=1.0, scalable=False)
def stale_samples(scene, rng, sensors, size):
    """In a share ``size`` of the samples an IMU repeats its former reading exactly.

    At least one sample of each IMU is repeated unless the share is zero. One repeat alone is
    hundreds of sigma in lively motion, so no share gives a small effect: not scalable.
    """
    chance = rng.random((len(scene.time), len(sensors)))
    # nothing is before the first sample
    chance[0] = np.inf
    stale = chance < np.maximum(size, np.nextafter(chance.min(axis=0), 1)) if size else chance < 0
    rows = np.arange(len(scene.time))[:, None]
    source = np.maximum.accumulate(np.where(stale, 0, rows), axis=0)

    columns = np.arange(len(sensors))
    rules = of_kinds((True, True), lambda values: values[source, columns])
    said = {"share": Parameter(stale.mean(axis=0))}
    return {"parameters": said, "after": altered(sensors, rules), "stale": True}


@effect("s", 1e-5, 5e-3)
def sensor_delay(scene, rng, sensors, size):
    """Both sensors of IMU k sampled at t + tau_k; size in seconds."""
    delay = size * rng.standard_normal(len(sensors))
    ages = spread(scene, sensors, delay)
    return {"parameters": {"delay": Parameter(delay, "s")}, "ages": Pair(ages, ages)}


@effect("s", 1e-4, 5e-3)
def gyroscope_delay(scene, rng, sensors, size):
    """Gyroscopes at t + tau_k, accelerometers at t; if all are chosen, half the time one tau."""
    common = len(sensors) == scene.accelerometers and rng.random() < 0.5
    own = rng.standard_normal(len(sensors))
    # a common delay has no companions to make up for a small draw
    delay = size * (np.sign(own[0]) * np.ones(len(sensors)) if common else own)
    said = {"delay": Parameter(delay, "s"), "common": Parameter(bool(common))}
    return {"parameters": said, "ages": Pair(None, spread(scene, sensors, delay))}


@effect("s", CLOCK_PERIOD, CLOCK_PERIOD)
def sensor_clock(scene, rng, sensors, size):
    """IMU k samples at phi + n P (1 + eps); the host gets the newest sample not after t.

    At size = P = 1 ms, the realistic one, this is exact. Other sizes keep the clocks and make the
    sawtooth of the age higher or lower: a shorter period would have another pattern of ages, and
    its size would not grow smoothly with it. A realistic host asks, half the time, now earlier, now
    later by `LATENCY`, which matters near a clock's jump alone: readings there are a period off.
    """
    offset = rng.uniform(0.01, 0.05, len(sensors)) * rng.choice([-1.0, 1.0], len(sensors))
    period = CLOCK_PERIOD * (1 + offset)
    phase = rng.random(len(sensors)) * period
    uneven = LATENCY * (size == CLOCK_PERIOD and rng.random() > 0.5)
    late = uneven * rng.standard_normal((len(scene.time), 1))
    waiting = np.mod(scene.time[:, None] + late - phase, period) - late
    ages = spread(scene, sensors, -waiting * (size / CLOCK_PERIOD))
    said = {
        "period": Parameter(period, "s"),
        "clock_offset": Parameter(offset),
        "phase": Parameter(phase, "s"),
        "host_latency": Parameter(uneven, "s"),
        "largest_age": Parameter(size * (1 + offset), "s"),
    }
    return {"parameters": said, "ages": Pair(ages, ages)}


@effect(UNIT_FORCE, 0.5, 5.0, everywhere=True, scalable=False, from_readings=False)
def shock(scene, rng, sensors, size):
    """The board is struck and rings for some 20 ms at 400 Hz, a rigid body.

    Each IMU reads that at an instant of its own in the millisecond before the host's, and the
    motion of the hand, which is slow, as ever. Size is the acceleration of the ringing, m/s^2.
    """
    number = max(2, round(scene.duration * rng.uniform(0.3, 1.0)))
    begin = np.sort(scene.time[0] + rng.random(number) * scene.duration)
    ringing = 2 * np.pi * rng.uniform(350.0, 450.0, number)
    fading = rng.uniform(0.01, 0.03, number)
    push = size * rng.standard_normal((number, 3))
    turn = size / 0.02 * rng.standard_normal((number, 3))  # rad/s^2: as much at 2 cm
    instants = scene.time[:, None] - CLOCK_PERIOD * rng.random((len(scene.time), len(sensors)))
    past = instants[..., None] - begin
    gone = np.maximum(past, 0.0)
    wave = np.where(past > 0, np.exp(-gone / fading) * np.exp(1j * ringing * gone), 0.0)
    force, twist = wave.imag @ push, wave.imag @ turn
    rate = -(wave.real / ringing) @ turn
    arms = scene.positions[list(sensors)]
    said = {"begin": Parameter(begin, "s"), "frequency": Parameter(ringing / (2 * np.pi), "Hz")}
    return {
        "parameters": said,
        "force_error": lambda field: force + np.cross(twist, arms),
        "rate_error": lambda field: rate,
    }


@effect("s", 5e-5, 3e-4)
def outside_timing_jitter(scene, rng, sensors, size):
    """Each sample of an IMU at t + a white random age; size is its sd in seconds."""
    jitter = size * rng.standard_normal((len(scene.time), len(sensors)))
    ages = spread(scene, sensors, jitter)
    return {"parameters": {"jitter_sd": Parameter(size, "s")}, "ages": Pair(ages, ages)}


@effect("1", 0.2, 1.0, limit=20.0)
def outside_rate_noise(scene, rng, sensors, size):
    """Noise exp(size |w| / rms |w|) times the declared one.

    Not 1 + size |w|: its shape in time, level apart, can not grow past a bound.
    """
    kinds = which_kinds(rng)
    turning = np.linalg.norm(scene.ideal().rate[:, list(sensors)], axis=-1)
    relative = turning / np.sqrt(np.mean(turning**2))
    gain = spread(scene, sensors, np.exp(size * relative), 1.0)
    own = gain[:, list(sensors)]
    # against the constant level of the same mean square: the level is another effect's
    shape = own / np.sqrt((own**2).mean(axis=0))
    return {
        "parameters": {"growth": Parameter(size), "of": kind_names(kinds)},
        "gain": of_kinds(kinds, gain),
        "divergence": lambda samples: level_divergence(shape) * sum(kinds) * samples,
    }


@effect("1", 3.0, 10.0, scalable=False)
def outside_quantisation(scene, rng, sensors, size):
    """Readings rounded to multiples of an LSB of ``size`` times the declared noise."""
    kinds = which_kinds(rng)

    def coarse(values, step, limit):
        rounded = np.clip(step * np.round(values / step), -limit, limit)
        # the rail itself is a code
        return np.where(np.abs(values) >= limit, values, rounded)

    rules = [
        partial(coarse, step=size * sd, limit=limit) if chosen else None
        for sd, limit, chosen in zip(scene.noise, scene.limits, kinds, strict=True)
    ]
    said = {"lsb_in_noise_sd": Parameter(size), "of": kind_names(kinds)}
    return {"parameters": said, "after": altered(sensors, Pair(*rules))}


GAUGE = tuple(name for name in EFFECTS if name.startswith("gauge_"))
OUTSIDE = tuple(name for name in EFFECTS if name.startswith("outside_"))
CATALOGUE = tuple(name for name in EFFECTS if name not in GAUGE + OUTSIDE)
