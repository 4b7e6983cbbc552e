"""Clocks' phases where rates and drifts leave something, and the turn that each reading is in.

An oscillator wanders by tenths of a turn in minutes, and the host reads now before, now after a
clock's jump. The gyroscopes of a sample tell: once their ages are nearly known, what is left of
a reading over the angular acceleration is how far its own age is off.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import BSpline

from imuarray.engine.gyroscope_clocks import Gyroscopes, moved, remapped, robust
from imuarray.engine.linearise import State
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS
from imuarray.model.timing import clock_turns


def with_phases(readings: Readings, state: State, clocks: dict) -> Readings:
    """The readings with the `wander` of clocks {imu: (P, f, phi, c, g)}.

    ``state``: one of rough motion, `with_free_gyroscopes`.
    """
    imus = sorted(clocks)
    values = np.array([clocks[imu] for imu in imus])
    kept = readings.keep[:, imus, 3:].all(axis=2)
    used = kept.sum(axis=1) >= SETTINGS.enough
    steady = clock_turns(values.T, readings.time[:, None], readings.span)
    seen = Gyroscopes(
        readings.time[used], readings.span, readings.values[used][:, imus, 3:],
        state.motion[used, 3:6],
    )  # fmt: skip
    noise = np.sqrt(np.mean(readings.declared[imus, 1] ** 2))
    stiffness = (noise / state.rough_prior.sd[used, 9:12]) ** 2
    every = splines(readings.time, seen.time)
    shift, place, jumps = _phases(
        seen, values[:, 0], steady[used], kept[used], stiffness, every[used]
    )
    turns = steady + every @ shift
    whole = np.floor(turns - place)
    whole[used] = jumps
    wander = np.zeros(readings.values.shape[:2])
    wander[:, imus] = turns - whole - (steady - np.floor(steady))
    return replace(readings, wander=wander)


def splines(time, seen) -> np.ndarray:
    """(T, B) cubic B-splines of ``time``, whose knots share the instants ``seen`` evenly."""
    length = len(seen) * np.median(np.diff(seen))
    spans = int(np.clip(length / SETTINGS.knot, 1, SETTINGS.most_knots))
    inner = np.quantile(seen, np.linspace(0, 1, spans + 1))
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])
    return BSpline.design_matrix(np.clip(time, inner[0], inner[-1]), knots, 3).toarray()


def _phases(seen: Gyroscopes, period, steady, kept, stiffness, basis):
    """(coefficients (B, K) of turns to add, places of the jumps (K,), jumps so far (T, K))."""
    shift, place = np.zeros((basis.shape[1], len(period))), np.zeros(len(period))
    maps = np.tile(np.eye(4)[:3], (len(period), 1, 1))
    weights, turns, jumps = kept.astype(float), steady, np.floor(steady)
    for number in range(SETTINGS.phase_rounds):
        ages = period * (turns - jumps - 0.5)
        motion, left = moved(seen, maps, ages, weights, stiffness)
        size = 1.4826 * np.median(np.abs(left[kept]))
        weights = kept * robust(left, size)
        maps = remapped(seen, motion, ages, weights)
        slope = motion[:, None, 3:6] - ages[..., None] * motion[:, None, 6:]
        slope = -period[:, None] * np.einsum("kij,tkj->tki", maps[..., :3], slope)
        told = kept * np.sum(slope**2, axis=2) / size**2
        off = np.sum(slope * left, axis=2) / np.maximum(told * size**2, 1e-9)
        clear = told * SETTINGS.around_jump**2 > 9.0
        shift = shift + _smoothed(basis, off, weights * told)
        if number < SETTINGS.phase_rounds // 4 or not clear.any(axis=0).all():
            turns = steady + basis @ shift
            continue
        # a whole turn off: the jump has not happened yet, or already
        asked = jumps - np.sign(off) * (np.abs(off) > 0.5)
        turns = steady + basis @ shift
        place = np.nanmedian(np.where(clear, turns - jumps, np.nan), axis=0) - 0.5
        past = turns - place - asked
        near = np.abs(past - 0.5) < 0.5 + SETTINGS.around_jump
        jumps = np.where(clear & near, asked, np.floor(turns - place))
    return shift, place, jumps


def _smoothed(basis, off, weights) -> np.ndarray:
    """Coefficients (B, K) of what turns are ``off`` (T, K), readings of another turn left aside."""
    out = np.zeros((basis.shape[1], off.shape[1]))
    for k in range(off.shape[1]):
        heavy = (weights[:, k] / (1 + (off[:, k] / SETTINGS.jump_jitter) ** 2))[:, None] * basis
        gram = heavy.T @ basis
        gram[np.diag_indices_from(gram)] += 1e-6 * np.trace(gram) / len(gram) + 1e-300
        out[:, k] = np.linalg.solve(gram, heavy.T @ off[:, k])
    return out
