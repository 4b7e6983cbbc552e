"""Noise of each triad by restricted likelihood, and how far it is from normal: Student's t.

A triad's three readings of a sample share one weight, (nu + 3) / (nu + d^2) at a squared distance
d^2: normal noise keeps weights near one, a reading far out loses its say.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from imuarray.engine import linearise
from imuarray.engine.heldout import blocks_of, log_t
from imuarray.engine.normal import normal, uncorrelated
from imuarray.engine.parameters import Columns
from imuarray.engine.readings import Readings, by_triad
from imuarray.engine.settings import SETTINGS
from imuarray.threads import one_thread

FREEDOMS = np.array([3.0, 4.0, 6.0, 10.0, 20.0, 50.0, np.inf])


class Pass(NamedTuple):
    """Normal equations of n parameters (N, m) bool, in blocks of time; whitened units."""

    information: np.ndarray  # (B, n, n)
    score: np.ndarray  # (B, n)
    motion: np.ndarray  # (T, D), improved
    squares: np.ndarray  # (T, N, 2) squared residuals of each triad
    freedom: np.ndarray  # (T, N, 2) their expectation where noise is as assumed
    unit: np.ndarray  # (T, N, 2) squares of what is uncorrelated and of unit variance in it,
    number: np.ndarray  # (T, N, 2) and how many these are: three, less what the motion takes up
    rough: np.ndarray  # (2, G) of what rough motion adds: squares in prior sds, and how many it saw


@one_thread()  # the chunks have one each
def normal_pass(
    readings: Readings, columns: Columns, state: linearise.State, active, improved: int = 1
) -> Pass:
    """The normal equations at a state, after ``improved`` Gauss-Newton steps of the motion.

    Where that is none, the motion takes the step that they are linearised for: half the work, and
    as good where it is small.

    LinAlgError where the readings do not determine the motion.
    """
    samples, count = readings.values.shape[:2]
    wanted = np.flatnonzero(active.any(axis=0))
    few = active[:, wanted]
    blocks = blocks_of(samples)
    motion = state.motion.copy()
    squares, freedom, unit, number = (np.empty((samples, count, 2)) for _ in range(4))
    triads = -1, count, 2, 3

    def one(start):
        part = slice(start, min(start + linearise.CHUNK, samples))
        here = state._replace(motion=motion)
        for _ in range(improved):
            motion[part] += linearise.motion_step(readings, columns, here, start)
        chunk = linearise.chunk_at(readings, columns, here, wanted, start)
        residual, leverage = chunk.residual, linearise.leverage_of(chunk.basis)
        left = np.where(readings.keep[part], 1.0 - leverage, 0.0)
        squares[part], freedom[part] = by_triad(residual**2), by_triad(left)
        own = uncorrelated(
            residual.reshape(triads), chunk.basis.reshape(*triads, chunk.basis.shape[2]),
            readings.keep[part].reshape(triads),
        )  # fmt: skip
        unit[part], number[part] = np.nansum(own**2, axis=-1), np.isfinite(own).sum(axis=-1)
        if not improved:
            step = np.swapaxes(chunk.inverse, 1, 2) @ chunk.absorbed[..., None]
            motion[part] += step[..., 0]
        rough = _seen_of_prior(here, motion[part], chunk.inverse, part)
        known = [(block, *normal(chunk, few, rows)) for block, rows in _inside(blocks, part)]
        return known, rough

    with ThreadPoolExecutor(linearise.THREADS) as pool:
        found = list(pool.map(one, range(0, samples, linearise.CHUNK)))
    size = int(active.sum())
    information, score = np.zeros((len(blocks), size, size)), np.zeros((len(blocks), size))
    for block, inner, slope in (item for known, _ in found for item in known):
        # in order, whichever thread was first
        information[block] += inner
        score[block] += slope
    rough = sum(one for _, one in found)
    return Pass(information, score, motion, squares, freedom, unit, number, rough)


def _seen_of_prior(state: linearise.State, motion, inverse, part) -> np.ndarray:
    """(2, G) sums over a part's samples and each three components that rough motion adds.

    Squares of their distance from the prior's mean in its sds; and of how many of them the readings
    tell more than the prior does (1 less the posterior's share of its variance).
    """
    if state.rough_prior is None:
        return np.zeros((2, 0))
    sd = state.rough_prior.sd[part]
    off = (motion[:, linearise.KNOWN :] - state.rough_prior.mean[part]) / sd
    left = np.sum(inverse[..., linearise.KNOWN :] ** 2, axis=1) / sd**2
    return np.array([np.sum(off**2, axis=0), np.sum(1.0 - left, axis=0)]).reshape(2, -1, 3).sum(-1)


def _inside(blocks, part: slice) -> list[tuple[int, slice]]:
    """(number, its rows of a chunk) of each block that meets the chunk."""
    found = []
    for number, block in enumerate(blocks):
        first, last = max(block.start, part.start), min(block.stop, part.stop)
        if first < last:
            found.append((number, slice(first - part.start, last - part.start)))
    return found


def reweighted(readings: Readings, one_pass: Pass, owned, former: np.ndarray) -> Readings:
    """The readings with each triad's scale and weights as the residual of a pass shows them.

    ``owned`` (N, 2): parameters that a triad's readings have paid for. ``former`` (2,): degrees of
    freedom of t; infinite for normal noise.
    """
    free = one_pass.freedom.sum(axis=0)
    free = np.maximum(free - owned, 0.1 * free)
    trust = 1.0 if readings.trust is None else readings.trust
    squares, distance = one_pass.squares / trust**2, distances(readings, one_pass)
    ratio, weight, least = np.ones_like(free), np.ones_like(distance), least_ratio(readings)
    for kind, nu in enumerate(former):
        own = readings.exists[:, kind] & (free[:, kind] > 0)
        if readings.exists[:, kind].sum() == 1:  # nothing to hold it against: as declared
            continue
        d, n, s = (part[:, own, kind] for part in (distance, one_pass.number, squares))
        if not np.isfinite(nu):
            ratio[own, kind] = np.maximum(s.sum(axis=0) / free[own, kind], least[own, kind])
            continue
        scale = np.maximum(np.median(d / median_of(n), axis=0), least[own, kind])
        for _ in range(SETTINGS.scale_rounds):
            scale = np.sum((nu + n) / (nu + d / scale) * s, axis=0) / free[own, kind]
            scale = np.maximum(scale, least[own, kind])
        ratio[own, kind], weight[:, own, kind] = scale, (nu + n) / (nu + d / scale)
    sd = readings.sd * np.sqrt(ratio)
    return readings.with_noise(sd, np.sqrt(weight) if np.isfinite(former).any() else None)


def least_ratio(readings: Readings) -> np.ndarray:
    """The least ratio (N, 2) of a triad's noise variance to that in use.

    Sensors that read in coarse steps may agree to the last digit, which is not without error.
    """
    steps = 0.0 if readings.resolution is None else readings.resolution / np.sqrt(12.0)
    return (np.maximum(steps, SETTINGS.least_scale * readings.declared) / readings.sd) ** 2


def distances(readings: Readings, one_pass: Pass) -> np.ndarray:
    """Squared residuals of each triad in its own sds, its weight taken off, (T, N, 2)."""
    return one_pass.unit if readings.trust is None else one_pass.unit / readings.trust**2


def freedoms(readings: Readings, one_pass: Pass) -> np.ndarray:
    """Degrees of freedom (2,) that make the triads' distances likeliest, of each kind of sensor."""
    found, far = np.full(2, np.inf), distances(readings, one_pass)
    determined = np.median(far / median_of(one_pass.number), axis=0) > least_ratio(readings)
    for kind in range(2):
        used = (one_pass.number[..., kind] > 0) & determined[:, kind]
        if used.any() and readings.exists[:, kind].sum() > 1:  # one alone is normal, as declared
            own = far[..., kind][used], one_pass.number[..., kind][used]
            found[kind] = FREEDOMS[np.argmax([_log_likelihood(*own, nu) for nu in FREEDOMS])]
    return found


def _log_likelihood(d, n, nu) -> float:
    """Log likelihood of squared distances (T,) of as many as ``n`` (T,), at the best scale."""
    whole = np.sum(n)
    scale = np.sum(d) / whole
    for _ in range(SETTINGS.scale_rounds if np.isfinite(nu) else 0):
        scale = np.sum((nu + n) / (nu + d / scale) * d) / whole
    return float(np.sum(log_t(d / scale, n, nu)) - whole / 2 * np.log(scale))


def median_of(number) -> np.ndarray:
    """Median of chi-square (Wilson and Hilferty's, within 3 %), of none as of one."""
    number = np.maximum(number, 1)
    return number * (1 - 2 / (9 * number)) ** 3
