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
    """A step of each triad's position, at the instant where it gains most."""
    active = given.places(fit.active)
    chosen = fit.columns.of(POSITION)
    outside = scaled_inverse(
        given.information[np.ix_(active, active)] + given.precision[np.ix_(active, active)]
    )
    blocks = blocks_of(len(fit.residual), SETTINGS.cuts)
    mask, found = fit.active.copy(), []
    mask[np.ix_(imus, chosen)] = True
    parts = [fit.normal(mask, block) for block in blocks]
    for imu in imus:
        own, rest = _places(mask, fit.active, imu, chosen)
        ridge = np.diag(1.0 / fit.columns.prior_sd[fit.columns.of(SHIFT)[:3]] ** 2)
        best = (0.0, 0, np.zeros(3))
        for cut in range(1, SETTINGS.cuts):
            gain, shift = _step_gain(parts[cut:], own, rest, outside, ridge)
            best = max(best, (gain, blocks[cut].start, shift), key=lambda b: b[0])
        gain, place, shift = best
        log_p = log_chi_square(gain, 3) + np.log(2 * len(imus) * SETTINGS.cuts)
        score = Score(Candidate(SHIFT, (imu,)), gain, 3, min(log_p, 0.0))
        found.append(Scanned(score, {imu: np.append(shift, fit.readings.time[place])}))
    return found


def _places(mask, active, imu, chosen):
    """Places in the mask's parameters of the IMU's position, and of the active ones."""
    number = np.full(mask.shape, -1)
    number[mask] = np.arange(mask.sum())
    return number[imu, chosen], number[active]


def _step_gain(parts, own, rest, outside, ridge):
    """(chi-square, shift (3,) m) of a position step over the given stretches of time."""
    information = sum(part[0] for part in parts)
    score = sum(part[1] for part in parts)[own]
    cross = information[np.ix_(own, rest)]
    block = information[np.ix_(own, own)] - cross @ outside @ cross.T + ridge
    inverse = scaled_inverse(block)
    shift = inverse @ score
    return float(score @ shift), shift


def refine_instant(fit: Fit, imu: int, around: float) -> float:
    """The instant of an adopted step, to a sample: where moving it gains most.

    The step's derivative, taken from the residual sample by sample, is added before or removed
    after; the shift itself stays.
    """
    columns, state = fit.columns, fit.state
    place = np.flatnonzero(columns.of(POSITION) >= 0)
    chosen = columns.of(POSITION)[place]
    shift = columns.model.split(state.parameters)[SHIFT][imu, :3]
    along = fit.whitened[:, imu][..., chosen] @ shift
    through = fit.through(chosen)[:, imu] @ shift
    linear = np.einsum("ti,ti->t", along, fit.residual[:, imu])
    square = np.sum(along**2, axis=1) - np.sum(through**2, axis=1)
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
    """The search with an adopted step's instants refined, alternating with the fit."""
    columns = search.columns
    chosen = columns.of(SHIFT)
    for _ in range(times):
        whole = flat_parameters(columns, search.fit.state)
        for imu in imus:
            found = refine_instant(search.fit, imu, whole[imu, chosen[3]])
            moved = abs(found - whole[imu, chosen[3]])
            whole[imu, chosen[3]] = found
        search = search.refit(from_flat(columns, search.fit.state, whole))
        if moved == 0:
            break
    return search
