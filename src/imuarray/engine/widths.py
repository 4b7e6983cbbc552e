"""How well an estimate's parameters are known: formal, by a jackknife, and what was corrected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imuarray.engine.estimate import Estimate, jackknifed, pinned, places_of, tested
from imuarray.engine.fit import flat_parameters, from_flat
from imuarray.engine.linearise import State
from imuarray.engine.parameters import Columns, columns_of, gauge_masks
from imuarray.linear import scaled_inverse
from imuarray.model.catalogue import OFF_COLUMNS, OFF_ROWS

SCALES, SKEWS = ("accelerometer_scale", "gyroscope_scale"), (
    "accelerometer_misalignment", "gyroscope_misalignment",
)  # fmt: skip
MAPS = SCALES + SKEWS  # effects that are 3 x 3 maps, which first order corrects


def widths(found: Estimate) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Covariance (n, n); formal sds (n,), and a jackknife's: the covariance has the larger."""
    formal = _formal(found) + _corrected(found)
    sds = np.sqrt(np.diag(formal))
    resampled = jackknifed(found.information + found.precision, found.blocks)
    wider = np.maximum(resampled / sds, 1.0)
    return formal * np.outer(wider, wider), sds, resampled


def _formal(found: Estimate) -> np.ndarray:
    """Gauges that the array's size takes up not pinned, but as large as they may well be."""
    known, gauges = np.isfinite(found.scale_sd), gauge_masks(found.columns, found.active)
    prior = pinned(found.recorded, found.columns, found.active, found.places, resized=known)
    sizes = [mask[found.active] for effect, mask in gauges if effect.resizes]
    if not known:
        for mine in sizes:
            chosen = found.places[0][mine]
            mean = np.zeros(len(prior))
            mean[chosen] = 1.0 / len(chosen)
            # the mean of so many that differ by so much
            prior += np.outer(mean, mean) * len(chosen) / np.var(found.values[chosen], ddof=1)
    out = _lost(found.freedoms) * scaled_inverse(found.information + prior)
    if known and sizes:
        # r goes with the rate's scale to the power of -2
        size = np.zeros(len(prior))
        pairs = np.argwhere(found.active)
        mine = pairs[:, 1] < 3
        size[found.places[0][mine]] = 2.0 * found.positions[pairs[mine, 0], pairs[mine, 1]]
        out += found.scale_sd**2 * np.outer(size, size)
    return out


def _lost(freedoms) -> float:
    """Normal noise's information over Student's t's: weights fall as readings move away."""
    return max((nu + 5) / (nu + 3) if np.isfinite(nu) else 1.0 for nu in freedoms)


def _corrected(found: Estimate) -> np.ndarray:
    """What is added by errors that a first-order correction left in maps, (n, n).

    Maps that are not estimated: by so much would their errors move what is. Each recording has
    its own correction.
    """
    if all(left is None for one in found.recorded for left in one.readings.left):
        return np.zeros_like(found.information)
    wide = _with_maps(found)
    maps = np.isin(wide.columns.names, MAPS) & wide.columns.owner & ~wide.active
    active = wide.active | maps
    blocks, _, _ = tested(wide, active)
    places = places_of(wide.columns, active, len(wide.recorded))
    mine, size = maps[active], len(blocks[0][1])
    added = np.unique(np.concatenate([place[mine] for place in places]))
    kept = np.setdiff1d(np.arange(size), added)
    inverse, out = scaled_inverse(found.information + found.precision), np.zeros((len(kept),) * 2)
    parts = np.split(np.array([inner for inner, _ in blocks]), len(wide.recorded))
    for one, place, part in zip(wide.recorded, places, parts, strict=True):
        moved = inverse @ part.sum(axis=0)[np.ix_(kept, place[mine])]
        out += moved @ spread_of(one.readings.left, wide.columns, maps) @ moved.T
    return out


def spread_of(left, columns: Columns, maps) -> np.ndarray:
    """Covariance of the parameters ``maps`` (N, m) bool, in their order, from those of the maps."""
    pairs = np.argwhere(maps)
    kind = np.array([columns.names[c].startswith("gyroscope") for c in pairs[:, 1]], int)
    entry = np.array([9 * imu + _entry(columns, column) for imu, column in pairs])
    out = np.zeros((len(pairs), len(pairs)))
    for which, covariance in enumerate(left):
        rows = np.flatnonzero(kind == which)
        if covariance is not None and len(rows):
            out[np.ix_(rows, rows)] = covariance[np.ix_(entry[rows], entry[rows])]
    return out


def _entry(columns: Columns, column: int) -> int:
    """Where a scale or a misalignment is in its 3 x 3 map, row by row."""
    place = columns.places[column][-1]
    if columns.names[column] in SCALES:
        return 4 * place
    return int(3 * OFF_ROWS[place] + OFF_COLUMNS[place])


def _with_maps(found: Estimate) -> Estimate:
    """The same with columns for all maps."""
    old = found.columns
    missing = [name for name in MAPS if name not in old.names]
    if not missing:
        return found
    readings = found.recorded[0].readings
    columns = columns_of(readings.array, (*old.model.effects, *missing), readings.position_prior_sd)
    index = [
        list(zip(columns.names, columns.places, strict=True)).index(one)
        for one in zip(old.names, old.places, strict=True)
    ]

    def wider(values) -> np.ndarray:
        out = np.zeros((len(values), columns.size), values.dtype)
        out[:, index] = values
        return out

    def moved(state: State) -> State:
        return from_flat(columns, state, wider(flat_parameters(old, state)))

    recorded = tuple(replace(one, state=moved(one.state)) for one in found.recorded)
    return replace(found, recorded=recorded, columns=columns, active=wider(found.active))
