"""A triad that moves on the board: how `position_shift` is found, and its instant refined."""

import numpy as np

from imuarray.diagnosis.scores import (
    Candidate,
    Information,
    Scanned,
    Score,
)
from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.fit import Fit, flat_parameters, from_flat
from imuarray.engine.heldout import blocks_of
from imuarray.engine.parameters import POSITION
from imuarray.linear import scaled_inverse
from imuarray.tails import log_chi_square

SHIFT = "position_shift"


def scan_shifts(fit: Fit, given: Information, imus) -> list[Scanned]:
    """A step of each triad's position, and of all at once, at the instant where it gains most."""
    active = given.places(fit.active)
    chosen = fit.columns.of(POSITION)
    outside = scaled_inverse(
        given.information[np.ix_(active, active)] + given.precision[np.ix_(active, active)]
    )
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
        score = Score(Candidate(SHIFT, tuple(moved), "", whole), gain, freedom, min(log_p, 0.0))
        since = fit.readings.time[blocks[best + 1].start]
        starts = zip(moved, shift.reshape(-1, 3), strict=True)
        found.append(Scanned(score, {imu: np.append(step, since) for imu, step in starts}))
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

    The step's derivative, taken from the residual sample by sample, is added before or removed
    after; the shifts themselves stay.
    """
    columns, state = fit.columns, fit.state
    chosen = columns.of(POSITION)
    shifts = columns.model.split(state.parameters)[SHIFT][list(imus), :3]
    blocks, motion = fit.whitened[:, imus][..., chosen], fit.through(chosen)[:, imus]
    along = np.einsum("tnic,nc->tni", blocks, shifts)
    through = np.einsum("tndc,nc->td", motion, shifts)
    linear = np.einsum("tni,tni->t", along, fit.residual[:, imus])
    square = np.sum(along**2, axis=(1, 2)) - np.sum(through**2, axis=1)
    after = fit.readings.time >= around
    # switching the step off where it is on costs s + i / 2, on where it is off -s + i / 2
    change = np.where(after, linear + square / 2, -(linear - square / 2))
    # cost of starting at sample n instead: samples between change their state
    first = int(np.argmax(after)) if after.any() else len(after) - 1
    forward = np.concatenate([[0.0], np.cumsum(change[first:])])
    backward = np.concatenate([[0.0], np.cumsum(-(linear - square / 2)[:first][::-1])])[::-1]
    cost = np.concatenate([backward[:-1], forward[:-1]])
    return float(fit.readings.time[int(np.argmin(cost))])


def refine_instants(search, imus, times=3):
    """The search with the instant of a step adopted for ``imus`` refined, alternating with the fit.

    It is one instant for all of them.
    """
    columns, imus = search.columns, list(imus)
    chosen = columns.of(SHIFT)
    for _ in range(times):
        whole = flat_parameters(columns, search.fit.state)
        last = whole[imus[0], chosen[3]]
        whole[imus, chosen[3]] = found = refine_instant(search.fit, imus, last)
        search = search.refit(from_flat(columns, search.fit.state, whole))
        if found == last:
            break
    return search
