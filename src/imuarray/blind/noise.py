"""Effects of the catalogue on the noise and on finished readings: noise, rails, repetition."""

from __future__ import annotations

import numpy as np

from imuarray.blind.change import (
    UNIT_FORCE,
    UNIT_RATE,
    Parameter,
    effect,
    kind_names,
    spread,
    which_kinds,
)
from imuarray.blind.scene import Pair

# Realistic factors of the noise: 0.5 to 5 times the declared one.
LOUDEST, QUIETEST = 5.0, 0.5


@effect("1", np.log(1.3), np.log(LOUDEST), limit=np.log(50.0))
def accelerometer_noise(scene, rng, sensors, size):
    """The noise of the triad is c times the declared one; size is ln c (see `_factors`)."""
    factors, said = _factors(scene, rng, sensors, size)
    return {"parameters": said, "gain": Pair(factors, None)}


@effect("1", np.log(1.3), np.log(LOUDEST), limit=np.log(50.0))
def gyroscope_noise(scene, rng, sensors, size):
    """The noise of the triad is c times the declared one; size is ln c (see `_factors`)."""
    factors, said = _factors(scene, rng, sensors, size)
    return {"parameters": said, "gain": Pair(None, factors)}


def _factors(scene, rng, sensors, size):
    """c_k = exp(size x_k), x_k of one sign: all alike or each its own, in half the draws each.

    A quarter of the draws are quieter, scaled so that ln 5 louder is answered by 0.5.
    """
    quiet = rng.random() < 0.25 and not scene.measured
    own = rng.uniform(0.5, 1.0, len(sensors)) if rng.random() < 0.5 else np.ones(len(sensors))
    # one triad alone is what the amplitude says
    own /= own.max()
    direction = np.log(QUIETEST) / np.log(LOUDEST) if quiet else 1.0
    factors = np.exp(size * direction * own)
    return spread(scene, sensors, factors, 1.0)[:1], {"factor": Parameter(factors, "1")}


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
    said = {
        "share": Parameter(wild_ones / len(scene.time), "1"),
        "factor": Parameter(1 + size, "1"),
        "of": kind_names(kinds),
    }
    return {"parameters": said, "gain": Pair(*gains)}


@effect("1", 0.6, 0.9, limit=0.999)
def coloured_noise(scene, rng, sensors, size):
    """AR(1) noise of the declared sd; size is the coefficient rho."""
    kinds = which_kinds(rng)
    rho = np.zeros(scene.accelerometers)
    rho[list(sensors)] = size
    said = {"coefficient": Parameter(size, "1"), "of": kind_names(kinds)}
    if 0 < size < 1:
        lasting = -1 / (scene.sampling_rate * np.log(size))
        said["correlation_time"] = Parameter(float(lasting), "s")
    return {"parameters": said, "correlation": Pair(*(rho if c else None for c in kinds))}


@effect("1", 0.05, 0.4, limit=0.95)
def saturation(scene, rng, sensors, size):
    """Clipped at (1 - size) times the largest reading, below the declared range."""
    kinds = which_kinds(rng)
    rails, said = [], {}
    names = (("accelerometer_rail", UNIT_FORCE), ("gyroscope_rail", UNIT_RATE))
    known = zip(scene.ideal(), scene.limits, kinds, names, strict=True)
    for values, limit, chosen, (name, unit) in known:
        peak = min(float(np.abs(values[:, list(sensors)]).max()), limit)
        rails.append((1 - size) * peak if chosen else np.inf)
        if chosen:
            said[name] = Parameter(rails[-1], unit)

    def clip(readings):
        clipped = [values.copy() for values in readings]
        for values, rail in zip(clipped, rails, strict=True):
            values[:, list(sensors)] = np.clip(values[:, list(sensors)], -rail, rail)
        return Pair(*clipped)

    return {"parameters": said, "after": clip}


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

    def repeat(readings):
        repeated = [values.copy() for values in readings]
        for values in repeated:
            values[:, list(sensors)] = values[source, list(sensors)]
        return Pair(*repeated)

    said = {"share": Parameter(stale.mean(axis=0), "1")}
    return {"parameters": said, "after": repeat}
