"""Posterior predictive checks: the residual's test quantities beside those of simulations.

A replicate is what the fitted model simulates at the recording's own times, motion and rails, and
fits again: noise of the declared size, the motion and the parameters projected out of it.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from imuarray.diagnosis.fit import Fit
from imuarray.diagnosis.noise import observable, standardised
from imuarray.model.effects import KINDS
from imuarray.words import first_up


class Test(NamedTuple):
    """A test quantity."""

    function: Callable  # (`Part`) -> values or None
    label: str  # in figures
    words: str  # with a place for whose residual
    by_axis: bool = False  # or by triad


class Discrepancy(NamedTuple):
    """A test quantity beside its simulated band, and one sentence."""

    check: str
    statistic: float
    simulated: dict  # median, q025, q975
    p_value: float
    sensors: list[str]
    says: str


def replicator(fit: Fit) -> Callable[[np.random.Generator], np.ndarray]:
    """Draws residuals (T, N, 6) of the fitted model, in the units of the noise sd in use.

    After motion and parameters have been fitted to them.
    """
    pairs = np.argwhere(fit.active)
    inverse = np.linalg.pinv(fit.normal(fit.active)[0] + fit.precision, hermitian=True)
    place = np.searchsorted(fit.wanted, pairs[:, 1])
    own = [np.flatnonzero(pairs[:, 0] == k) for k in range(len(fit.active))]
    # of each IMU (T 6, n): what moves its readings
    each = [
        (rows, fit.whitened[:, k][..., place[rows]].reshape(6 * len(fit.residual), len(rows)))
        for k, rows in enumerate(own)
    ]

    def draw(rng) -> np.ndarray:
        noise = rng.standard_normal(fit.residual.shape) * fit.readings.keep
        left, score = fit.less_motion(noise), np.empty(len(pairs))
        for k, (rows, along) in enumerate(each):
            score[rows] = left[:, k].ravel() @ along
        step = inverse @ score
        moved = np.stack([along @ step[rows] for rows, along in each])
        moved = moved.reshape(len(moved), len(left), 6).swapaxes(0, 1)
        return left - fit.less_motion(moved)

    return draw


class Sensors:
    """Parts that the test quantities of a kind's n triads have in common, whatever the residual."""

    def __init__(self, fit: Fit, kind: int):
        known = observable(fit.readings, fit.basis)[:, kind]
        self.labels = [fit.readings.labels[k] for k in np.flatnonzero(known)]
        self.there = (known[:, None] & (np.arange(6) // 3 == kind)).ravel()
        keep = fit.readings.keep.astype(float)
        together = (np.diff(fit.readings.run) == 0)[:, None, None]
        # weights of readings, and of pairs of neighbours
        self.keep, self.pairs = self.picked(keep), self.picked(together * keep[1:] * keep[:-1])
        time = fit.readings.time
        self.time, self.length = time - time.mean(), np.ptp(time)
        direction = fit.state.motion[:, 3:6]
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        self.way = direction / np.where(length > 0, length, 1.0)
        self.sizes = {}  # of the motion: weights of its highest quarter and lowest half, (2, T)
        for name, values in motion_sizes(fit).items():
            size = np.linalg.norm(values, axis=1)
            if np.any(size):
                low, high = np.quantile(size, [0.5, 0.75])
                self.sizes[name] = np.stack([size > high, size < low]).astype(float)

    def picked(self, values) -> np.ndarray:
        """(T, n, 3) of values (T, N, 6)."""
        return values.reshape(len(values), -1)[:, self.there].reshape(len(values), -1, 3)

    def mean(self, values) -> np.ndarray:
        """Mean by triad of values that are zero where readings are left out."""
        return values.sum(axis=(0, 2)) / self.keep.sum(axis=(0, 2))


class Part(NamedTuple):
    """A kind's residuals: ``values`` and their squares (T, n, 3), zero where left out."""

    of: Sensors
    values: np.ndarray
    square: np.ndarray


def quantities(unit, kinds: list[Sensors]) -> dict[tuple[int, str], np.ndarray]:
    """Values by sensor of each kind's `TESTS` of a residual (T, N, 6), NaN where left out."""
    filled, found = np.nan_to_num(unit), {}
    for kind, sensors in enumerate(kinds):
        if not sensors.labels:
            continue
        values = sensors.picked(filled)
        part = Part(sensors, values, values**2)
        every = {(kind, check): test.function(part) for check, test in TESTS.items()}
        found |= {key: values for key, values in every.items() if values is not None}
    return found


def motion_sizes(fit: Fit) -> dict[str, np.ndarray]:
    """Sizes that a residual may grow with, (T, 3) each; of the jerk zeros where it is not known."""
    motion = fit.state.motion
    return {
        "omega": motion[:, :3], "omega dot": motion[:, 3:6], "specific force": motion[:, 6:9],
        "jerk": fit.state.jerk[1],
    }  # fmt: skip


def _growth(size):
    """rms in the highest quarter of a size of the motion over that in the lowest half, by triad."""

    def ratio(part):
        chosen = part.of.sizes.get(size)
        if chosen is None:
            return None
        above, below = (
            (chosen @ values.reshape(len(values), -1)).reshape(2, -1, 3).sum(axis=2)
            for values in (part.square, part.of.keep)
        )
        return np.sqrt(above[0] / below[0] / (above[1] / below[1]))

    return ratio


def _rms(part):
    return np.sqrt(part.square.sum(axis=0) / part.of.keep.sum(axis=0)).ravel()


def _along(part):
    along = np.einsum("tki,ti->tk", part.values, part.of.way)
    return np.sum(along**2, axis=0) / np.maximum(np.sum(part.square, axis=(0, 2)), 1e-300)


def _lag_one(part):
    products = np.sum(part.of.pairs * part.values[1:] * part.values[:-1], axis=(0, 2))
    return products / part.of.pairs.sum(axis=(0, 2)) / part.of.mean(part.square)


def _drift(part):
    x = part.of.time
    return x @ part.values.reshape(len(x), -1) / np.sum(x**2) * part.of.length


def _between(part):
    count = part.values.shape[1]
    if count < 3:
        return None  # the motion leaves the difference of two
    matrix = np.corrcoef(part.values.reshape(len(part.values), -1).T)
    blocks = np.abs(matrix).reshape(count, 3, count, 3).max(axis=(1, 3))
    np.fill_diagonal(blocks, 0.0)
    return blocks.max(axis=1)


GROWTH = "{{}} where {} is large over where it is small"
TESTS = {
    "residual": Test(_rms, "size", "{}, in assumed sds,", by_axis=True),
    **{
        f"residual against {name}": Test(
            _growth(size), f"growth with {symbol}", GROWTH.format(name)
        )
        for size, name, symbol in (
            ("omega", "|omega|", "|ω|"),
            ("omega dot", "|omega dot|", "|dω/dt|"),
            ("specific force", "|specific force|", "|specific force|"),
            ("jerk", "jerk", "|ds/dt|"),
        )
    },
    "residual along omega dot": Test(
        _along, "share along dω/dt", "the share of {} along omega dot"
    ),
    "whiteness": Test(_lag_one, "correlation in time", "the lag-one correlation of {}"),
    "drift": Test(_drift, "drift", "the drift of {} from start to end", by_axis=True),
    "kurtosis": Test(  # a fourth power by pow is slow
        lambda part: part.of.mean(part.square * part.square) / part.of.mean(part.square) ** 2 - 3.0,
        "tails (kurtosis)",
        "the excess kurtosis of {}",
    ),
    "correlation between IMUs": Test(
        _between, "correlation between IMUs", "the largest correlation of {} between two IMUs"
    ),
}


def discrepancies(fit: Fit, rng, replicates: int) -> list[Discrepancy]:
    """Every test quantity of a fit beside its band over replicates, most striking first."""
    draw, kinds = replicator(fit), [Sensors(fit, kind) for kind in range(len(KINDS))]
    share = fit.readings.keep / np.sqrt(np.maximum(1.0 - fit.leverage, 1e-6))
    measured = quantities(standardised(fit), kinds)
    drawn = [quantities(draw(rng) * share, kinds) for _ in range(replicates)]
    found = [
        _compare(kinds[key[0]].labels, *key, values, np.array([each[key] for each in drawn]))
        for key, values in measured.items()
    ]
    return [item for _, item in sorted(found, key=lambda pair: pair[0], reverse=True)]


def _compare(labels, kind: int, check: str, values, drawn):
    """(how far out, Discrepancy) of the worst sensor, against the worst of each replicate."""
    test, name = TESTS[check], KINDS[kind]
    places = [f"{k}{axis}" for k in labels for axis in "xyz"] if test.by_axis else labels
    centre, spread = drawn.mean(axis=0), np.maximum(drawn.std(axis=0), 1e-12)
    away = np.abs(values - centre) / spread
    worst = int(np.nanargmax(away))
    others = np.nanmax(np.abs(drawn - centre) / spread, axis=1)
    p_value = (1 + np.sum(others >= away[worst])) / (1 + len(others))
    own = drawn[:, worst]
    band = {
        "median": float(np.median(own)),
        "q025": float(np.quantile(own, 0.025)), "q975": float(np.quantile(own, 0.975)),
    }  # fmt: skip
    limit = np.quantile(others, 0.95)
    sensors = [places[k] for k in np.flatnonzero(away > limit)]
    value, words = float(values[worst]), first_up(test.words.format(f"the {name}s' residual"))
    says = f"{words} is {value:.3g} at IMU {places[worst]}, {_beside(value, band, p_value)}."
    found = Discrepancy(f"{name} {check}", value, band, float(p_value), sensors, says)
    return float(away[worst] / limit), found


def _beside(value, band, p_value) -> str:
    """Where a value lies: the worst of many sensors may leave its own band as often as not."""
    simulated = f"simulated {band['q025']:.3g} to {band['q975']:.3g}"
    within = band["q025"] <= value <= band["q975"]
    if p_value <= 0.05:
        return f"{'at the edge of' if within else 'outside'} the {simulated}"
    if within:
        return f"within the {simulated}"
    return f"{simulated} there; in {100 * p_value:.0f} % of simulations some sensor is as far out"
