"""Positions and effects of a board from one recording or several, jointly and robustly.

Gauss-Newton over the shared parameters, each sample's motion eliminated; noise of each triad by
restricted maximum likelihood and Student's t (`imuarray.engine.robust`), all re-estimated in turn.
Effects that a recording has of its own (biases, clocks) have parameters in each of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal, NamedTuple, Self

import numpy as np

from imuarray.engine.alike import with_likely_spread
from imuarray.engine.linearise import State
from imuarray.engine.parameters import Columns, stepped
from imuarray.engine.readings import Readings
from imuarray.engine.robust import Linearised, Residuals, freedoms, median_of, resized, reweighted
from imuarray.engine.settings import SETTINGS
from imuarray.engine.start import is_smooth, start, with_derivatives, with_rough_prior
from imuarray.linear import matrix_function, scaled_solve
from imuarray.model.effects import EFFECTS

NORMAL, ROBUST = np.array([np.inf, np.inf]), np.array([4.0, 4.0])  # degrees of freedom


@dataclass(frozen=True)
class Recorded:
    """A recording of the board: its readings with the noise in use, and where they are fitted."""

    readings: Readings
    state: State
    smooth: bool

    @classmethod
    def of(cls, readings: Readings, columns: Columns, former: State | None = None) -> Self:
        """At the nominal positions and no effect, or at another fit's (``former``)."""
        first = start(readings, columns)
        if former is not None:
            first = first._replace(positions=former.positions, parameters=former.parameters)
        smooth = readings.gapless and is_smooth(readings, first.motion)
        if readings.gapless and not smooth:
            first = with_rough_prior(readings, first)
        return cls(readings, first, smooth)

    def select(self, used) -> Self:
        """The samples in ``used`` (T,) bool, where they are fitted."""
        return replace(self, readings=self.readings.select(used), state=self.state.select(used))


@dataclass(frozen=True)
class Estimate:
    """Result of `estimate`; n parameters: those shared, then each recording's own.

    Attributes
    ----------
    recorded, residuals : of each recording, where it stands and what it leaves there
    active : (N, m) bool, the parameters fitted
    places : for each recording, where its active parameters are among the n
    information, precision : (n, n) of the readings; of the priors, gauges pinned
    blocks : [(information, score)] of each block of time of each recording
    freedoms : (2,) degrees of freedom of Student's t, of accelerometers and gyroscopes
    steps : largest step of each iteration, in sds
    """

    recorded: tuple[Recorded, ...]
    residuals: tuple[Residuals, ...]
    columns: Columns
    active: np.ndarray
    places: tuple[np.ndarray, ...]
    information: np.ndarray
    precision: np.ndarray
    blocks: list[tuple[np.ndarray, np.ndarray]]
    freedoms: np.ndarray
    steps: tuple[float, ...]
    converged: bool
    unpaid: int = 0  # parameters that no estimate of noise has allowed for
    # by kind of sensor: chance that the correction's maps hold in this motion, the farthest IMUs
    maps_hold: dict[str, tuple[float, list[int]]] = field(default_factory=dict)

    @property
    def positions(self) -> np.ndarray:
        """(A, 3) m, relative to the first triad."""
        return self.recorded[0].state.positions

    @property
    def values(self) -> np.ndarray:
        """The parameters (n,)."""
        return _values(self.recorded, self.columns, self.active, self.places)

    @property
    def scale_sd(self) -> float:
        """Sd of the scale common to all gyroscopes: the least that a recording knows, or NaN."""
        return float(np.fmin.reduce([one.readings.scale_sd for one in self.recorded]))

    def residual_ratio(self) -> float:
        """Rms residual over the declared noise, degrees of freedom allowed for."""
        squares, number = 0.0, 0.0
        for one, seen in zip(self.recorded, self.residuals, strict=True):
            scale = (one.readings.sd / one.readings.declared) ** 2
            squares += np.sum(seen.distance * scale)
            number += seen.number.sum()
        return float(np.sqrt(squares / max(number - self.unpaid, 1e-3)))

    def smooth_ratio(self) -> np.ndarray | None:
        """Where motion is rough: (N, 2) the same of each triad in the smooth samples, robust.

        Of the half with most angular acceleration, in which what a model misses shows, the fifth of
        least jerk: what is faster than the samples is in the rest. None where motion is smooth.
        """
        parts = []
        for one, seen in zip(self.recorded, self.residuals, strict=True):
            if one.state.rough_prior is None:
                return None
            jerk = np.linalg.norm(one.state.jerk[1], axis=1)
            scale = (one.readings.sd / one.readings.declared) ** 2
            turn = np.linalg.norm(one.state.motion[:, 3:6], axis=1)
            turning = turn > np.median(turn)
            smooth = turning & (jerk <= np.quantile(jerk[turning], SETTINGS.smooth_share))
            far = seen.distance / median_of(seen.number)
            parts.append(far[smooth] * scale)
        return np.sqrt(np.median(np.concatenate(parts), axis=0))

    def noise_sd(self) -> np.ndarray:
        """Sds (N, 2), m/s^2 and rad/s, that Student's t has; rms over the recordings."""
        share = np.where(np.isfinite(self.freedoms), self.freedoms, 1.0)
        wide = np.where(np.isfinite(self.freedoms), share / (share - 2.0), 1.0)
        squares = [one.readings.sd**2 for one in self.recorded]
        return np.sqrt(wide * np.mean(squares, axis=0))


def jackknifed(information, precision, blocks) -> np.ndarray:
    """Sds (n,) from what each block of time says against all, beside the priors' ``precision``.

    A block left out moves the estimate by (1 - h)^-1, h its share of the information, and so by too
    much where it holds most of it; with (1 - h)^-1/2 the variance is unbiased where the model holds
    (Bell and McCaffrey, "Bias reduction in standard errors ...", 2002).
    """
    whole = information + precision
    scale = 1 / np.sqrt(np.diag(whole))
    back = np.linalg.inv(np.linalg.cholesky(whole * np.outer(scale, scale))) * scale
    inverse = back.T @ back
    variance = np.maximum(np.sum((inverse @ precision) * inverse, axis=1), 0.0)
    for inner, score in blocks:
        product = partial(_between, back, inner)
        variance += (back.T @ matrix_function(product, back @ score, _spared)) ** 2
    return np.sqrt(variance)


def _between(back, inner, vector) -> np.ndarray:
    return back @ (inner @ (vector @ back))


def _spared(share) -> np.ndarray:
    """(1 - h)^-1/2, as if no block held all of the information."""
    return np.maximum(1 - share, SETTINGS.spared) ** -0.5


def estimate(
    recorded: Sequence[Recorded], columns: Columns, active,
    noise: Literal["robust", "normal", "fixed"] = "robust",
    steps: int = SETTINGS.iterations,
) -> Estimate:  # fmt: skip
    """The most likely parameters from where the recordings stand.

    ``active`` (N, m) bool. ``noise``: "robust" Student's t, degrees of freedom and each triad's
    scale estimated; "normal" each triad's sd estimated; "fixed" normal, of the readings' own sds.
    ``steps``: at most. LinAlgError where the readings do not determine the motion.
    """
    active = columns.movable(active, [one.state for one in recorded])
    places = places_of(columns, active, len(recorded))
    nu, length, moved, tails, trail, near = NORMAL, 1.0, [], [], [], False
    # from a former estimate: readings far out have little weight as it is
    weighted = all(one.readings.trust is not None for one in recorded)
    first = 0 if weighted or noise == "fixed" else SETTINGS.robust_first
    enough = SETTINGS.exact if noise == "fixed" else SETTINGS.settled
    for number in range(steps):
        far = number < first
        linear, seen = _linearised(recorded, columns, active, int(far))
        if noise == "robust":
            pairs = zip(linear, seen, strict=True)  # the least of all recordings' is all's
            nu = ROBUST if far else np.min([freedoms(x.readings, y) for x, y in pairs], axis=0)
            tails.append(nu)
            nu = steady(tails)
        # before the equations: weights of a step before would halve the pace
        if noise == "fixed":
            change = 0.0
        else:
            recorded, seen, change = _judged(recorded, linear, seen, columns, active, nu)
        recorded, equations = _solvable(recorded, linear, active)
        information, score, blocks = _summed(equations, places)
        precision = pinned(columns, active, places, shown=shown(recorded))
        values = _values(recorded, columns, active, places)
        columns = with_likely_spread(columns, active, values, information + precision, places[0])
        precision = pinned(columns, active, places, shown=shown(recorded))
        slope = score - precision @ (values - means(recorded, columns, active, places))
        step, sds = scaled_solve(information + precision, slope)
        if noise != "fixed":
            sds = np.maximum(sds, jackknifed(information, precision, blocks))
        trail = [*trail, step / sds]
        length = paced(length, trail)
        farther = 1.0 if far or length < 1.0 else to_come(trail)
        moved.append(float(np.max(np.abs(step) / sds, initial=0.0)))
        near = len(trail) > 1 and farther * moved[-1] < enough
        if near and change < SETTINGS.same_noise and number > first:
            break
        recorded = tuple(
            replace(one, state=stepped(one.state, columns, active, farther * length * step[place]))
            for one, place in zip(recorded, places, strict=True)
        )
        trail = trail if farther == 1.0 else []
    return Estimate(
        recorded, seen, columns, active, places, information, precision, blocks, nu,
        tuple(moved), near, len(score) if noise == "fixed" else 0,
    )  # fmt: skip


def steady(tails: list) -> np.ndarray:
    """Degrees of freedom (2,) by their course (2,) each: the last, or the lightest that recur.

    Where motion takes up most of the readings, weights change what stands out, and so the tails
    that they follow from: of each kind that has gone up and down, late, the largest is kept.
    """
    late = np.array(tails[-SETTINGS.tails_seen :])
    with np.errstate(invalid="ignore"):  # infinite ones stay
        steps = np.nan_to_num(np.diff(late, axis=0))
    restless = (steps > 0).any(axis=0) & (steps < 0).any(axis=0)
    return np.where(restless & (len(tails) >= SETTINGS.tails_late), late.max(axis=0), tails[-1])


def places_of(columns: Columns, active, recordings: int) -> tuple[np.ndarray, ...]:
    """Places of each recording's active parameters (n_a,) among all n."""
    own = np.array([name in EFFECTS and EFFECTS[name].own for name in columns.names])
    mine = np.broadcast_to(own, active.shape)[active]
    shared = int(np.sum(~mine))
    found = []
    for number in range(recordings):
        place = np.empty(len(mine), int)
        place[~mine] = np.arange(shared)
        place[mine] = shared + number * mine.sum() + np.arange(mine.sum())
        found.append(place)
    return tuple(found)


def _linearised(recorded, columns, active, improved: int = 0):
    """(linearised, what is left) of each recording."""
    found, held = [], sum(one.readings.keep.size // 6 for one in recorded) <= SETTINGS.held
    for one in recorded:
        state = with_derivatives(one.readings, one.state, one.smooth)
        found.append(Linearised.of(one.readings, columns, state, active, improved, held))
    linear, seen = zip(*found, strict=True)
    return linear, seen


def _solvable(recorded, linear, active):
    """(recordings with the motion improved, each one's normal equations in blocks of time)."""
    equations, moved = [], []
    for one, at in zip(recorded, linear, strict=True):
        blocks, motion = at.equations(active, one.readings, one.state.rough_prior)
        equations.append(blocks)
        state = at.state._replace(motion=motion, rough_prior=one.state.rough_prior)
        moved.append(replace(one, state=state))
    return tuple(moved), equations


def paced(length: float, steps) -> float:
    """Share of the last of the ``steps`` (n,) to be gone, after ``length`` of the one before.

    Full steps may alternate across a valley: half of them lead into it.
    """
    last, now = steps[-2:] if len(steps) > 1 else (0.0 * steps[-1], steps[-1])
    back = -np.sum(now * last)
    crossed = back > 0 and back > SETTINGS.alternating * np.sum(last**2)
    return max(length / 2, SETTINGS.shortest) if crossed else min(1.0, 1.5 * length)


def to_come(steps) -> float:
    """All steps (n,) from the last one on in units of it, where three shrink alike (Aitken), or 1.

    In sds: as all parameters count alike.
    """
    if len(steps) < 3 or not all(map(np.any, steps[-3:])):
        return 1.0
    first, second, third = steps[-3:]
    before, now = first @ second / (first @ first), second @ third / (second @ second)
    alike = now * np.linalg.norm(second) > (1 - SETTINGS.same_way) * np.linalg.norm(third)
    if abs(now - before) > SETTINGS.same_pace or not alike:
        return 1.0
    return float(1.0 / np.clip(1.0 - now, 1.0 / SETTINGS.farthest, 1.0))


def _size(places) -> int:
    """n, from each recording's places among them."""
    return 1 + max((int(place.max()) for place in places if len(place)), default=-1)


def _summed(equations, places):
    """(information (n, n), score (n,), [(information, score)] of all blocks)."""
    size, blocks = _size(places), []
    for own, place in zip(equations, places, strict=True):
        for inner, slope in own:
            whole, score = np.zeros((size, size)), np.zeros(size)
            whole[np.ix_(place, place)], score[place] = inner, slope
            blocks.append((whole, score))
    return sum(b[0] for b in blocks), sum(b[1] for b in blocks), blocks


def _spread(parts, places) -> np.ndarray:
    """(n,) from each recording's (n_a,)."""
    out = np.empty(_size(places))
    for part, place in zip(parts, places, strict=True):
        out[place] = part
    return out


def _values(recorded, columns, active, places) -> np.ndarray:
    return _spread([columns.flat(one.state)[active] for one in recorded], places)


def means(recorded, columns, active, places) -> np.ndarray:
    return _spread([columns.prior_means()[active] for one in recorded], places)


def shown(recorded) -> bool:
    """True where the slope of each recording's own rate shows a scale common to all gyroscopes."""
    turnings = [one.state.turning for one in recorded]
    return all(turning is not None and turning.follows.any() for turning in turnings)


def pinned(columns, active, places, values=None, shown=False) -> np.ndarray:
    """Precision (n, n) of the priors, gauges pinned.

    A mean that the array's size takes up has the prior of a single one where it is ``shown``, as a
    gyroscopes' scale; else, if ``values`` (n,) are given, it is as near to zero as the mean of as
    many that differ by so much.
    """
    inner = columns.prior_precision(active, values is None and not shown)
    for effect, mask in columns.gauges(active) if shown or values is not None else ():
        if effect.resizes:
            chosen, own = mask != 0, np.zeros(mask.shape)
            usual = float(np.mean(columns.prior_sd[chosen.any(axis=0)] ** 2))
            variance = SETTINGS.stiff**2 * usual
            if shown and effect.kinds == [1]:
                variance = usual
            elif values is not None:
                own[active] = values[places[0]]
                variance = max(_variance_of_mean(own, chosen), variance)
            weights = mask[active] / np.abs(mask).sum()
            inner += np.outer(weights, weights) * (1 / variance - chosen.sum() / usual)
    out = np.zeros((_size(places),) * 2)
    for place in places:  # what several recordings share is written by each of them
        out[np.ix_(place, place)] = inner
    return out


def _variance_of_mean(values, chosen) -> float:
    """Variance of the mean of the ``chosen`` (N, m) bool, by how they or axes' means differ."""
    axes = chosen.any(axis=0)
    means = np.sum(values * chosen, axis=0)[axes] / chosen.sum(axis=0)[axes]
    some = [x for x in (values[chosen], means) if len(x) > 1]
    return float(max((np.var(x, ddof=1) / len(x) for x in some), default=0.0))


def _judged(recorded, linear, seen, columns, active, nu):
    """(recordings with noise, weights and priors anew, what is left in its sds, largest change).

    A triad has paid for its share of the parameters.
    """
    paid = np.zeros((len(active), 2))
    for column, name in enumerate(columns.names):
        kinds = EFFECTS[name].kinds if name in EFFECTS else [0]  # positions
        paid[:, kinds] += active[:, [column]] / len(kinds)
    made, left, change = [], [], 0.0
    for one, at, own in zip(recorded, linear, seen, strict=True):
        readings = reweighted(one.readings, own, paid / len(recorded), nu)
        ratio = np.abs(readings.sd / one.readings.sd - 1)[readings.exists]
        change = max(change, float(np.max(ratio, initial=0.0)))
        left.append(own.in_sds_of(readings, one.readings))
        made.append(replace(one, readings=readings, state=resized(at.state, own)))
    return tuple(made), tuple(left), change


class Tested(NamedTuple):
    """[(information, score)] of blocks, prior precision, means (n,) and values of ``active``."""

    blocks: list
    precision: np.ndarray
    means: np.ndarray
    values: np.ndarray
    active: np.ndarray
    places: tuple[np.ndarray, ...]

    def chosen(self, mask) -> np.ndarray:
        """(n,) bool of (N, m), in all recordings."""
        found = np.zeros(len(self.values), bool)
        for place in self.places:
            found[place] |= mask[self.active]
        return found


def tested(found: Estimate, active, places=None) -> Tested:
    """An estimate's state, noise and weights with more parameters ``active`` (N, m) bool.

    ``places`` of each recording's among all, by default those of `places_of`.
    """
    places = places or places_of(found.columns, active, len(found.recorded))
    linear, _ = _linearised(found.recorded, found.columns, active, 1)
    recorded, equations = _solvable(found.recorded, linear, active)
    values = _values(recorded, found.columns, active, places)
    precision = pinned(found.columns, active, places, shown=shown(recorded))
    mean = means(recorded, found.columns, active, places)
    return Tested(_summed(equations, places)[2], precision, mean, values, active, places)
