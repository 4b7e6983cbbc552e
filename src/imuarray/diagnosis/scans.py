"""Scans along time: a triad that moves, biases that follow one temperature.

How `position_shift` is found and its instant refined; how `warm_up` is found by its course.
"""

import numpy as np
from scipy.optimize import minimize_scalar

from imuarray.diagnosis.fit import Fit
from imuarray.diagnosis.scores import Candidate, Information, Score
from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.heldout import blocks_of
from imuarray.engine.parameters import POSITION
from imuarray.linear import scaled_inverse
from imuarray.model.effects import EFFECTS, KINDS
from imuarray.model.timing import warming
from imuarray.tails import log_chi_square

SHIFT = "position_shift"
WARM_UP = "warm_up"


def scan_shifts(fit: Fit, given: Information, imus, _=None) -> list[Score]:
    """A step of each triad's position, and of all at once, at the instant where it gains most."""
    chosen, outside = fit.columns.of(POSITION), given.covariance(given.places(fit.active))
    blocks = blocks_of(len(fit.residual), SETTINGS.cuts)
    mask = fit.active.copy()
    mask[np.ix_(imus, chosen)] = True
    parts = [fit.normal(mask, block) for block in blocks]
    # what is left from each cut on
    later = [tuple(map(sum, zip(*parts[cut:], strict=True))) for cut in range(1, SETTINGS.cuts)]
    found = []
    for whole in [False] * len(imus) + [True] * (len(imus) > 1):
        moved = list(imus) if whole else [imus[len(found)]]
        own, rest = _places(mask, fit.active, moved, chosen)
        sd = fit.columns.prior_sd[fit.columns.of(SHIFT)[:3]]
        ridge = np.diag(np.tile(sd**-2.0, len(moved)))
        steps = [_step_gain(part, own, rest, outside, ridge) for part in later]
        best = int(np.argmax([step[0] for step in steps]))
        gain, shift, freedom = steps[best]
        tests = SETTINGS.cuts * (1 if whole else len(imus))
        log_p = log_chi_square(gain, freedom) + np.log(2 * tests)
        since = fit.readings.time[blocks[best + 1].start]
        steps = zip(moved, shift.reshape(-1, 3), strict=True)
        starts = {imu: np.append(step, since) for imu, step in steps}
        candidate = Candidate(SHIFT, tuple(moved), "", whole)
        found.append(Score(candidate, gain, freedom, min(log_p, 0.0), starts))
    return found


def _places(mask, active, imus, chosen):
    """Places in the mask's parameters of the IMUs' positions, and of the active ones."""
    number = np.full(mask.shape, -1)
    number[mask] = np.arange(mask.sum())
    return number[np.ix_(imus, chosen)].ravel(), number[active]


def _step_gain(part, own, rest, outside, ridge):
    """(chi-square, shifts (3 n,) m, degrees of freedom) of position steps in a stretch of time."""
    information, score = part[0], part[1][own]
    cross = information[np.ix_(own, rest)]
    block = information[np.ix_(own, own)] - cross @ outside @ cross.T + ridge
    inverse = scaled_inverse(block)
    shift = inverse @ score
    # a shift of all triads alike is the motion's
    freedom = len(own) - float(np.sum(inverse * ridge))
    return float(score @ shift), shift, max(round(freedom), 1)


def refine_instant(fit: Fit, imus, around: float) -> float:
    """The instant of an adopted step of some IMUs, to a sample: where moving it gains most.

    The step's derivative is added before or removed after; the shifts themselves stay.
    """
    columns, state = fit.columns, fit.state
    chosen = columns.of(POSITION)
    shifts = columns.model.split(state.parameters)[SHIFT][list(imus), :3]
    blocks, motion = fit.whitened[:, imus][..., chosen], fit.projected(chosen)[:, imus]
    along = np.einsum("tnic,nc->tni", blocks, shifts)
    projected = np.einsum("tndc,nc->td", motion, shifts)
    linear = np.einsum("tni,tni->t", along, fit.residual[:, imus])
    square = np.sum(along**2, axis=(1, 2)) - np.sum(projected**2, axis=1)
    after = fit.readings.time >= around
    # switching the step off where it is on costs s + i / 2, on where it is off -s + i / 2
    change = np.where(after, linear + square / 2, -(linear - square / 2))
    # cost of starting at sample n instead: samples between change their state
    first = int(np.argmax(after)) if after.any() else len(after) - 1
    sooner, later = np.cumsum(change[:first][::-1])[::-1], np.cumsum(change[first:-1])
    cost = np.concatenate([sooner, [0.0], later])
    return float(fit.readings.time[int(np.argmin(cost))])


def refine_instants(search, imus):
    """The search, the one instant of a step of ``imus`` refined in turns with the fit."""
    columns, imus = search.columns, list(imus)
    chosen = columns.of(SHIFT)
    for _ in range(3):
        whole = columns.flat(search.fit.state)
        last = whole[imus[0], chosen[3]]
        whole[imus, chosen[3]] = found = refine_instant(search.fit, imus, last)
        search = search.refit(columns.unflat(search.fit.state, whole))
        if found == last:
            break
    return search


class Courses:
    """Gains of all biases along a course of time, constant in each block, all else projected out.

    ``back``: whether biases that are fitted go back to zero.
    """

    def __init__(self, fit: Fit, given: Information, imus, back: bool = False):
        columns = [c for kind in KINDS for c in fit.columns.of(f"{kind}_bias")]
        places, beside = np.ix_(imus, columns), fit.active.copy()
        values = np.zeros(len(imus) * len(columns))
        if back:
            beside[places] = False
            values = fit.columns.flat(fit.state)[places].ravel()
        mask = beside.copy()
        mask[places] = True
        own, rest = _places(mask, beside, imus, columns)
        blocks = blocks_of(len(fit.residual), SETTINGS.cuts)
        parts = [fit.normal(mask, block) for block in blocks]
        self.whole = np.array([part[0][np.ix_(own, own)] for part in parts])
        self.cross = np.array([part[0][np.ix_(own, rest)] for part in parts])
        self.score = np.array([part[1][own] for part in parts]) + self.whole @ values
        self.moved = values @ self.cross.sum(axis=0)
        self.time = np.array([fit.readings.time[block].mean() for block in blocks])
        self.steady = np.ones_like(self.time)  # the course of a constant
        self.span = fit.readings.span
        # the catalogue's: a diagnosis without the effect asks, too, whether biases grew
        sds = np.reshape(EFFECTS[WARM_UP].prior_sd[:6], (2, 3))
        own = [k for k, kind in enumerate(KINDS) for _ in fit.columns.of(f"{kind}_bias")]
        self.ridge = np.diag(np.tile(sds[own, np.arange(len(own)) % 3] ** -2.0, len(imus)))
        self.kind = np.tile(own, len(imus))
        self.outside = given.covariance(given.places(beside))

    def gain(self, course, among=slice(None)) -> tuple[float, np.ndarray]:
        """(chi-square, coefficients (n,)) of n biases, or of some of them, along a course (B,)."""
        whole = np.einsum("t,tmn->mn", course**2, self.whole)
        aside = np.einsum("t,tmr->mr", course, self.cross)
        left = (whole - aside @ self.outside @ aside.T + self.ridge)[among][:, among]
        score = (course @ self.score - aside @ self.outside @ self.moved)[among]
        values = scaled_inverse(left) @ score
        return float(score @ values), values

    def course(self, pace: float, zero: float) -> np.ndarray:
        """Course of the blocks, (B,)."""
        return np.asarray(warming(pace / self.span, self.time, self.span)) - zero

    def best_zero(self, pace: float) -> tuple[float, float]:
        """(chi-square, zero) of the courses of a pace."""
        found = minimize_scalar(
            lambda zero: -self.gain(self.course(pace, zero))[0], bounds=SETTINGS.zeros,
            method="bounded",
        )  # fmt: skip
        return -found.fun, found.x

    def best(self) -> tuple[float, float]:
        """Pace and zero of the course that gains most."""
        first = int(np.argmax([self.best_zero(pace)[0] for pace in SETTINGS.paces]))
        near = SETTINGS.paces[max(first - 1, 0) : first + 2]
        around = near[0], near[-1]
        pace = minimize_scalar(
            lambda pace: -self.best_zero(pace)[0], bounds=around, method="bounded",
            options={"xatol": 0.05},
        ).x  # fmt: skip
        return pace, self.best_zero(pace)[1]


def scan_warming(fit: Fit, given: Information, imus, _=None) -> list[Score]:
    """All IMUs' biases along the course where they gain most.

    Of both kinds and more than one IMU, more than as constants: else it is no thermometer.
    """
    biases = all(len(fit.columns.of(f"{kind}_bias")) for kind in KINDS)
    few = len(fit.residual) < 2 * SETTINGS.cuts or len(imus) < fit.readings.exists.all(axis=1).sum()
    if few or not biases:
        return []
    courses = Courses(fit, given, imus)
    pace, zero = courses.best()
    course, steady = courses.course(pace, zero), courses.steady
    gain, values = courses.gain(course)
    if gain - courses.gain(steady)[0] < -2 * SETTINGS.effect:
        return []
    for kind in range(len(KINDS)):
        own = courses.kind == kind
        alone = courses.gain(course, own)[0]
        sure = log_chi_square(max(alone, 1e-9), own.sum()) < SETTINGS.likely_drift
        if not sure or alone < courses.gain(steady, own)[0]:
            return []
    # one alone that drifts, and not the board, would do for all of it
    owners = np.repeat(imus, len(values) // len(imus))
    alone = max(courses.gain(course, owners == imu)[0] for imu in imus)
    rest = max(len(values) - len(values) // len(imus), 1)
    if log_chi_square(max(gain - alone, 1e-9), rest) > SETTINGS.likely_drift:
        return []
    freedom = len(values) + 2
    log_p = min(log_chi_square(gain, freedom) + np.log(2 * len(SETTINGS.paces)), 0.0)
    each, shape = values.reshape(len(imus), 6), [pace / courses.span, zero]
    starts = {imu: np.append(own, shape) for imu, own in zip(imus, each, strict=True)}
    return [Score(Candidate(WARM_UP, tuple(imus), "", True), gain, freedom, log_p, starts)]


def maybe_grown(search, cause) -> bool:
    """True where the biases that a cause is may as well have grown from zero as be constant."""
    imus = list(cause.imus)
    courses = Courses(search.fit, search.given, imus, back=True)
    own = courses.kind == KINDS.index(EFFECTS[cause.effect].sensors)
    paces = [pace for pace in SETTINGS.paces if abs(pace) <= SETTINGS.settled_pace]
    grown = max(courses.gain(courses.course(pace, 0.0), own)[0] for pace in paces)
    return bool(grown > courses.gain(courses.steady, own)[0] - 2 * SETTINGS.rival)


def maybe_warming(search, cause, own: float) -> bool:
    """True where the biases of all sensors may as well follow one course as be constant."""
    imus = [int(k) for k in np.flatnonzero(search.readings.exists.all(axis=1))]
    if len(search.imus_with(cause.effect)) < len(imus):
        return False
    courses = Courses(search.fit, search.given, imus, back=True)
    gain = courses.gain(courses.course(*courses.best()))[0]
    return bool(gain > courses.gain(courses.steady)[0] - 2 * SETTINGS.rival)
