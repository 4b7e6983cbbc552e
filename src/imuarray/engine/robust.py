"""Noise of each triad by restricted likelihood, and how far it is from normal: Student's t.

A triad's three readings of a sample share one weight, (nu + 3) / (nu + d^2) at a squared distance
d^2: normal noise keeps weights near one, a reading far out loses its say.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, Self

import numpy as np

from imuarray.engine import linearise
from imuarray.engine.heldout import blocks_of, log_t
from imuarray.engine.normal import normal, uncorrelated
from imuarray.engine.parameters import Columns
from imuarray.engine.readings import Readings, by_triad
from imuarray.engine.settings import SETTINGS
from imuarray.threads import one_thread

FREEDOMS = np.array([3.0, 4.0, 6.0, 10.0, 20.0, 50.0, np.inf])


class Residuals(NamedTuple):
    """Residuals of each triad's readings in sds of its noise, a robust loss' weights taken off."""

    squares: np.ndarray  # (T, N, 2) squared residuals
    freedom: np.ndarray  # (T, N, 2) their expectation where noise is as assumed
    distance: np.ndarray  # (T, N, 2) squares of what is uncorrelated and of unit variance in it,
    number: np.ndarray  # (T, N, 2) and how many these are: three, less what the motion takes up
    rough: np.ndarray  # (2, G) of what rough motion adds: squares in prior sds, and how many it saw

    def in_sds_of(self, readings: Readings, former: Readings) -> Self:
        """In other readings' sds instead of the ``former`` ones'."""
        ratio = (former.sd / readings.sd) ** 2
        return self._replace(squares=self.squares * ratio, distance=self.distance * ratio)


class Linearised(NamedTuple):
    """A recording linearised at a state by its active parameters."""

    readings: Readings
    columns: Columns
    state: linearise.State
    wanted: np.ndarray  # of the columns, those that derivatives are by
    chunks: list[linearise.Whitened | None]  # none that are not held: made again

    @classmethod
    @one_thread()  # the chunks have one each
    def of(
        cls, readings: Readings, columns: Columns, state: linearise.State, active,
        improved: int = 0, held: bool = True,
    ) -> tuple[Self, Residuals]:  # fmt: skip
        """After ``improved`` Gauss-Newton steps of the motion, and what it leaves of the readings.

        ``held``: whether the derivatives stay in memory until the equations are made.
        LinAlgError where the readings do not determine the motion.
        """
        samples, count = readings.values.shape[:2]
        wanted = np.flatnonzero(active.any(axis=0))
        here = state._replace(motion=state.motion.copy())
        squares, freedom, distance, number = (np.empty((samples, count, 2)) for _ in range(4))
        triads = -1, count, 2, 3

        def one(start):
            part = slice(start, min(start + linearise.CHUNK, samples))
            for more in reversed(range(improved + 1)):
                chunk = linearise.whitened_at(readings, columns, here, wanted, start)
                made = linearise.eliminated(readings, here, chunk)
                here.motion[part] += _motion_step(made) if more else 0.0
            left = np.where(readings.keep[part], 1.0 - linearise.leverage_of(made.basis), 0.0)
            squares[part], freedom[part] = by_triad(made.residual**2), by_triad(left)
            own = uncorrelated(
                made.residual.reshape(triads), made.basis.reshape(*triads, made.basis.shape[2]),
                readings.keep[part].reshape(triads),
            )  # fmt: skip
            distance[part], number[part] = np.nansum(own**2, axis=-1), np.isfinite(own).sum(axis=-1)
            motion = here.motion[part] + _motion_step(made)
            return chunk if held else None, _seen_of_prior(here, motion, made.inverse, part)

        with ThreadPoolExecutor(linearise.THREADS) as pool:
            found = list(pool.map(one, range(0, samples, linearise.CHUNK)))
        trust = 1.0 if readings.trust is None else readings.trust**2
        chunks, rough = zip(*found, strict=True)
        seen = Residuals(squares / trust, freedom, distance / trust, number, sum(rough))
        return cls(readings, columns, here, wanted, list(chunks)), seen

    @one_thread()
    def equations(self, active, readings: Readings | None = None, prior=None):
        """([(information (n, n), score (n,))] of blocks of time, the motion after its own step).

        Normal equations of the n ``active`` (N, m) bool. ``readings``: with another noise or other
        weights; ``prior``: another of rough motion.
        """
        readings = self.readings if readings is None else readings
        state = self.state if prior is None else self.state._replace(rough_prior=prior)
        few, blocks = active[:, active.any(axis=0)], blocks_of(len(readings.values))
        motion, size = state.motion.copy(), int(active.sum())

        def one(number):
            given = self.readings, self.columns, self.state, self.wanted, number * linearise.CHUNK
            chunk = self.chunks[number] or linearise.whitened_at(*given)
            chunk = chunk.reweighted(self.readings, readings)
            made = linearise.eliminated(readings, state, chunk)
            part = slice(chunk.index[0], chunk.index[-1] + 1)
            motion[part] += _motion_step(made)
            return [(block, *normal(made, few, rows)) for block, rows in _inside(blocks, part)]

        with ThreadPoolExecutor(linearise.THREADS) as pool:
            found = list(pool.map(one, range(len(self.chunks))))
        sums = [(np.zeros((size, size)), np.zeros(size)) for _ in blocks]
        for block, *both in (item for known in found for item in known):
            # in order, whichever thread was first
            for total, part in zip(sums[block], both, strict=True):
                total += part
        return sums, motion


def _motion_step(made: linearise.Eliminated) -> np.ndarray:
    """(T, D) to the motion that a chunk's readings have, all else as it is."""
    return (made.inverse.mT @ made.absorbed[..., None])[..., 0]


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


def reweighted(readings: Readings, seen: Residuals, owned, former: np.ndarray) -> Readings:
    """The readings with each triad's scale and weights as its residuals show them.

    ``owned`` (N, 2): parameters that a triad's readings have paid for. ``former`` (2,): degrees of
    freedom of t; infinite for normal noise.
    """
    free = seen.freedom.sum(axis=0)
    free = np.maximum(free - owned, 0.1 * free)
    ratio, weight, least = np.ones_like(free), np.ones_like(seen.distance), least_ratio(readings)
    for kind, nu in enumerate(former):
        own = readings.exists[:, kind] & (free[:, kind] > 0)
        if readings.exists[:, kind].sum() == 1:  # nothing to hold it against: as declared
            continue
        d, n, s = (part[:, own, kind] for part in (seen.distance, seen.number, seen.squares))
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


def resized(state: linearise.State, seen: Residuals) -> linearise.State:
    """The prior of rough motion as wide as is likeliest (MacKay's step), where readings tell."""
    if state.rough_prior is None:
        return state
    squares, number = seen.rough
    known = (number > SETTINGS.determined * len(state.motion)) & (squares > 0)
    factor = np.sqrt(np.where(known, squares, 1.0) / np.where(known, number, 1.0))
    factor = np.clip(factor, 1 / SETTINGS.widening, SETTINGS.widening)
    return state._replace(rough_prior=state.rough_prior.scaled(factor))


def least_ratio(readings: Readings) -> np.ndarray:
    """The least ratio (N, 2) of a triad's noise variance to that in use.

    Sensors that read in coarse steps may agree to the last digit, which is not without error.
    """
    steps = 0.0 if readings.resolution is None else readings.resolution / np.sqrt(12.0)
    return (np.maximum(steps, SETTINGS.least_scale * readings.declared) / readings.sd) ** 2


def freedoms(readings: Readings, seen: Residuals) -> np.ndarray:
    """Degrees of freedom (2,) that make the triads' distances likeliest, of each kind of sensor."""
    found, far = np.full(2, np.inf), seen.distance
    determined = np.median(far / median_of(seen.number), axis=0) > least_ratio(readings)
    for kind in range(2):
        used = (seen.number[..., kind] > 0) & determined[:, kind]
        if used.any() and readings.exists[:, kind].sum() > 1:  # one alone is normal, as declared
            own = far[..., kind][used], seen.number[..., kind][used]
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
