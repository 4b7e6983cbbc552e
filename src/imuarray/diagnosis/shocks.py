"""Samples of motion faster than the sensors' own instants are alike: several IMUs are off at once.

What shakes a board within a millisecond is another motion to each IMU, which reads it at an instant
of its own. One motion for all then fits a sample no better where any one IMU is left out.
"""

from typing import NamedTuple

import numpy as np
from scipy import special
from scipy.ndimage import binary_propagation

from imuarray.diagnosis.fit import Fit
from imuarray.diagnosis.noise_effects import held_out
from imuarray.diagnosis.reading_effects import Finding
from imuarray.diagnosis.settings import SETTINGS
from imuarray.tails import log_poisson

SHOCK = "shock"


class Misfit(NamedTuple):
    """Squares of each sample's residual (T,), in units of their usual size."""

    whole: np.ndarray
    least: np.ndarray  # with the IMU left out that misses most
    worst: np.ndarray  # that IMU
    freedom: np.ndarray  # of the whole
    rest: np.ndarray  # degrees that are left without that IMU


def misfits(fit: Fit) -> Misfit:
    """Misfits of a fit, its motion estimated again without the IMU."""
    samples, count = fit.residual.shape[:2]
    basis = fit.basis.reshape(samples, count, 6, -1)
    left = np.eye(6) - basis @ np.swapaxes(basis, 2, 3)
    solved = np.linalg.solve(left + 1e-9 * np.eye(6), fit.residual[..., None])[..., 0]
    own = np.sum(fit.residual * solved, axis=2)
    whole, worst = np.sum(fit.residual**2, axis=(1, 2)), np.argmax(own, axis=1)
    least = whole - own.max(axis=1)
    kept = fit.readings.keep.sum(axis=2)
    freedom = np.sum(kept, axis=1) - np.sum(fit.basis**2, axis=(1, 2))
    rest = freedom - np.take_along_axis(kept, worst[:, None], axis=1)[:, 0]
    size = max(np.median(least / np.maximum(rest, 1)), 1e-300)
    return Misfit(whole / size, least / size, worst, freedom, rest)


def find_shocks(fit: Fit, limit: float) -> tuple[Finding | None, np.ndarray]:
    """The cause and its samples (T,) bool, none where it is not there.

    Samples where two IMUs or more are far off must be more than those of single IMUs make by
    chance, among samples of like motion, and must not be like their neighbours: slow misfit is.
    """
    none = np.zeros(len(fit.residual), bool)
    if fit.residual.shape[1] < SETTINGS.least_shaken:
        return None, none
    found = misfits(fit)
    if np.median(found.rest) < SETTINGS.least_rest:  # the only gyroscope is not to be spared
        return None, none
    rest = np.maximum(found.rest, 1)
    shaken = found.least > special.chdtri(rest, SETTINGS.shaken)
    alone = ~shaken & (found.whole > special.chdtri(found.freedom, SETTINGS.shaken))
    jerk = np.linalg.norm(fit.state.jerk[1], axis=1)
    rate = np.linalg.norm(fit.state.motion[:, :3], axis=1)
    counts = [_several(shaken, alone, found.worst, size) for size in (jerk, rate)]
    log_p = max(float(log_poisson(seen, max(chance, 0.5))) for seen, chance in counts)
    if shaken.sum() <= SETTINGS.few or log_p > limit or _likeness(fit, shaken) > SETTINGS.lasting:
        return None, none
    # what is left of the ringing beside them
    shaken = binary_propagation(shaken, mask=found.least > special.chdtri(rest, SETTINGS.ringing))
    numbers = _numbers(shaken, jerk)
    nats = np.where(shaken, (found.least - rest) / 2, 0.0)
    imus = tuple(range(fit.residual.shape[1]))
    where = _stretches(fit.readings.time + fit.readings.origin, fit.readings.run, shaken)
    own = Finding(SHOCK, imus, log_p, numbers, *held_out(nats), also={"stretches_s": where})
    return own, shaken


def with_neighbours(shaken, run, number: int) -> np.ndarray:
    """(T,) bool: the shaken samples, and so many of the same run on each side of them."""
    found = shaken.copy()
    for step in range(1, number + 1):
        together = run[step:] == run[:-step]
        found[step:] |= shaken[:-step] & together
        found[:-step] |= shaken[step:] & together
    return found


def _several(shaken, alone, worst, size) -> tuple[int, float]:
    """(samples with several IMUs off, how many would be if each was so by itself).

    By tenths of ``size``, of those in which enough samples are calm to tell chance by.
    """
    seen, chance = 0, 0.0
    for part in np.array_split(np.argsort(size), 10):
        calm = np.sum(~shaken[part] & ~alone[part]) + 0.5
        if calm > SETTINGS.few_calm * len(part):
            odds = np.bincount(worst[part][alone[part]], minlength=worst.max() + 1) / calm
            seen += int(shaken[part].sum())
            chance += float(calm * (np.prod(1 + odds) - 1 - np.sum(odds)))
    return seen, chance


def _likeness(fit: Fit, shaken) -> float:
    """Correlation of a sample's residual with the next one's, where both are shaken."""
    pairs = np.flatnonzero(shaken[1:] & shaken[:-1] & (np.diff(fit.readings.run) == 0))
    before, after = fit.residual[pairs], fit.residual[pairs + 1]
    sizes = np.sqrt(np.sum(before**2, axis=(1, 2)) * np.sum(after**2, axis=(1, 2)))
    return float(np.sum(before * after) / max(np.sum(sizes), 1e-9))


def _numbers(shaken, jerk) -> dict:
    """The share of the samples, and the jerk of the array there and elsewhere."""
    share, count = float(shaken.mean()), len(shaken)
    numbers = {"share": (share, float(np.sqrt(share * (1 - share) / count)), "1")}
    for name, part in (("jerk_there", jerk[shaken]), ("jerk_elsewhere", jerk[~shaken])):
        middle = float(np.median(part)) if len(part) else 0.0
        numbers[name] = (middle, None, "m s-3")
    return numbers


def _stretches(time, run, shaken):
    """[first, last] s of up to `SETTINGS.stated` shaken stretches, the longest first."""
    index = np.flatnonzero(shaken)
    cut = np.flatnonzero((np.diff(index) > SETTINGS.apart) | (np.diff(run[index]) > 0)) + 1
    longest = sorted(np.split(index, cut), key=len)[-SETTINGS.stated :]
    return [[float(time[p[0]]), float(time[p[-1]])] for p in longest[::-1]]
