"""Covariance of an estimate's parameters: formal, by a jackknife, and with what was corrected."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtrc

from imuarray.engine.estimate import Estimate, jackknifed, means, pinned, shown, tested
from imuarray.engine.linearise import State
from imuarray.engine.parameters import Columns, columns_of, stepped
from imuarray.engine.readings import ResidualMaps
from imuarray.engine.settings import SETTINGS
from imuarray.linear import scaled_inverse, scaled_solve
from imuarray.model.catalogue import OFF_COLUMNS, OFF_ROWS
from imuarray.model.effects import KINDS

SCALES, SKEWS = ("accelerometer_scale", "gyroscope_scale"), (
    "accelerometer_misalignment", "gyroscope_misalignment",
)  # fmt: skip
MAPS = SCALES + SKEWS  # effects that are 3 x 3 maps, which first order corrects
OFFSETS = "accelerometer_bias", "gyroscope_bias"
DRIFT = "bias_drift"


def widened(found: Estimate) -> Estimate:
    """An estimate beside what a first-order correction left of maps and offsets.

    Each as uncertain as that. One step of everything at once: such errors are so small that it is
    the last one. They stay out of the answer, as they belong to a recording's correction;
    ``information``, ``precision`` and ``blocks`` have them after the n parameters, those of each
    recording. ``maps_hold``: of the kinds whose maps were corrected and not estimated, how likely
    maps as far from the correction's as it takes them to be are. Recordings that one calibration
    corrected have its errors of the maps in common.
    """
    lefts = [one.readings.left for one in found.recorded]
    if any(left is None for left in lefts):
        return found
    wide = _with_maps(found)
    maps = residual_map_mask(lefts, wide.columns, wide.active)
    active, count = wide.active | maps, len(found.values)
    names = np.array(wide.columns.names)[np.nonzero(maps)[1]]
    places, spread = _places_left(lefts, [spread_of(left, wide.columns, maps) for left in lefts],
                                  np.isin(names, MAPS), count)  # fmt: skip
    precision = block_diag(found.precision, np.linalg.inv(spread))
    every, mine = [], maps[active]
    for own, left in zip(found.places, places, strict=True):
        place = np.empty(len(mine), int)
        place[~mine], place[mine] = own, left
        every.append(place)
    blocks = tested(wide, active, every).blocks
    information = sum(inner for inner, _ in blocks)
    slope = sum(score for _, score in blocks)
    mean = means(found.recorded, found.columns, found.active, found.places)
    slope[:count] -= found.precision @ (found.values - mean)
    whole = scaled_solve(information + precision, slope)[0]
    step = whole[:count]
    left = scaled_inverse(information / lost(found.freedoms) + precision)[count:, count:]
    places, imus = [place - count for place in places], np.nonzero(maps)[0]
    of_kinds = {kind: np.char.startswith(names, kind) & np.isin(names, MAPS) for kind in KINDS}
    holds = {
        kind: _hold(places, np.where(mine, imus, -1), whole[count:], spread, left)
        for kind, mine in of_kinds.items() if mine.any()
    }  # fmt: skip
    recorded = tuple(
        replace(one, state=stepped(one.state, found.columns, found.active, step[place]))
        for one, place in zip(found.recorded, found.places, strict=True)
    )
    # what the blocks say where the step ends: a jackknife takes the rest for their scatter
    blocks = [(inner, score - inner @ whole) for inner, score in blocks]
    return replace(
        found, recorded=recorded, information=information, precision=precision, blocks=blocks,
        maps_hold=holds,
    )  # fmt: skip


def _hold(places, imus, off, spread, left) -> tuple[float, list[int]]:
    """(chance of maps so far ``off`` (k,) from a correction's, the farthest IMUs first).

    ``places`` of each recording's (m,) among the k, ``imus`` (m,) whose they are, -1 of others;
    covariances (k, k) ``spread`` before and ``left`` after.
    """

    def distance(chosen) -> tuple[float, int]:
        own = np.unique([place[chosen] for place in places])
        square = np.ix_(own, own)
        return hausman(off[own], spread[square], left[square])

    statistic, freedom = distance(imus >= 0)
    far = {int(imu): distance(imus == imu)[0] for imu in np.unique(imus[imus >= 0])}
    most = SETTINGS.map_nearly * max(far.values())
    farthest = [imu for imu in sorted(far, key=far.get, reverse=True) if far[imu] > most]
    return float(chdtrc(max(freedom, 1), statistic)), farthest


def hausman(apart, wide, narrow) -> tuple[float, int]:
    """(chi-square, degrees of freedom) of how far apart (k,) two estimates of one truth are.

    Covariances ``wide`` and, of the one that knows all that the other does and more, ``narrow``:
    what differs has their difference (Hausman, Econometrica 46, 1978). Directions of which more
    tells hardly anything are left out.
    """
    root = np.linalg.cholesky(wide)
    share = np.linalg.solve(root, np.linalg.solve(root, narrow).T)
    determined, axes = np.linalg.eigh(np.eye(len(wide)) - (share + share.T) / 2)
    informed = determined > SETTINGS.least_difference
    along = (axes.T @ np.linalg.solve(root, apart))[informed]
    return float(np.sum(along**2 / determined[informed])), int(informed.sum())


def _places_left(lefts, spreads, of_maps, begin):
    """(each recording's places from ``begin`` on of what was left in it, covariance of all).

    ``spreads`` each recording's covariance (k, k), in which those ``of_maps`` (k,) bool belong to
    the calibration that corrected it, all others to the recording itself.
    """
    places, parts, end = [], [], begin
    for number, (left, spread) in enumerate(zip(lefts, spreads, strict=True)):
        place = np.empty(len(spread), int)
        same = next(k for k, other in enumerate(lefts) if left.is_of(other))
        for mine in (of_maps, ~of_maps):
            if mine is of_maps and same < number:
                place[mine] = places[same][mine]
                continue
            place[mine] = end + np.arange(mine.sum())
            parts.append(spread[np.ix_(mine, mine)])
            end += mine.sum()
        places.append(place)
    return places, block_diag(*parts)


def widths(found: Estimate) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Covariance (n, n); formal sds (n,), and a jackknife's: the covariance has the larger."""
    formal, count = _formal(found), len(found.values)
    sds = np.sqrt(np.diag(formal))
    resampled = jackknifed(found.information, found.precision, found.blocks)[:count]
    wider = np.maximum(resampled / sds, 1.0)
    return formal * np.outer(wider, wider), sds, resampled


def growing(found: Estimate) -> np.ndarray:
    """Sds (B, n) had one recording ended with its first 1 ... B blocks of time, of the same values.

    By the information of these blocks; as much wider than the formal ones as those of all of it.
    """
    sums = np.cumsum([inner for inner, _ in found.blocks], axis=0)
    formal = np.sqrt([np.diag(_formal(replace(found, information=inner))) for inner in sums])
    return formal * np.sqrt(np.diag(widths(found)[0])) / formal[-1]


def _formal(found: Estimate) -> np.ndarray:
    """Gauges that the array's size takes up not pinned, but as large as they may well be."""
    count, prior = len(found.values), found.precision.copy()
    prior[:count, :count] = priors_of(found)
    out = lost(found.freedoms) * scaled_inverse(found.information + prior)[:count, :count]
    # r goes with the rate's scale to the power of -2, and a clock's is in all rates
    size, pairs = np.zeros(count), np.argwhere(found.active)
    mine = pairs[:, 1] < 3
    size[found.places[0][mine]] = 2.0 * found.positions[pairs[mine, 0], pairs[mine, 1]]
    variance = np.mean([one.readings.clock_sd**2 for one in found.recorded])
    return out + variance * np.outer(size, size)


def priors_of(found: Estimate) -> np.ndarray:
    """Precision (n, n) of the priors, gauges as wide as they may be."""
    given = found.columns, found.active, found.places, found.values
    return pinned(*given, shown(found.recorded))


def lost(freedoms) -> float:
    """Normal noise's information over Student's t's: weights fall as readings move away."""
    return max((nu + 5) / (nu + 3) if np.isfinite(nu) else 1.0 for nu in freedoms)


def corrected(*lefts: ResidualMaps | None) -> tuple[str, ...]:
    """Effects of which a correction may have left something in some of a board's recordings."""
    if any(left is None for left in lefts):
        return ()
    return (*MAPS, DRIFT) if any(left.walks for left in lefts) else MAPS + OFFSETS


def residual_map_mask(lefts: Sequence[ResidualMaps | None], columns: Columns, active) -> np.ndarray:
    """(N, m) bool of maps and offsets that corrections left, where they are not ``active``."""
    known, forces = corrected(*lefts), _accelerometers(columns)
    if any(len(left.maps) == forces for left in lefts if left is not None):
        known = tuple(name for name in known if name not in MAPS[1::2])
    return np.isin(columns.names, known) & columns.owner & ~np.asarray(active)


def _accelerometers(columns: Columns) -> int:
    """Number of entries of the accelerometers' maps."""
    return 9 * columns.model.array.accelerometers


def spread_of(left: ResidualMaps, columns: Columns, chosen) -> np.ndarray:
    """Covariance of the parameters ``chosen`` (N, m) bool, in their order, of those left.

    Entries that are known are not singular, but tight.
    """
    entry = [_entry(left, columns, *pair) for pair in np.argwhere(chosen)]
    offsets = left.offsets.reshape(-1, *left.offsets.shape[2:])
    own = block_diag(left.maps, *offsets)[np.ix_(entry, entry)]
    return own + SETTINGS.fixed_map**2 * np.eye(len(own))


def _entry(left: ResidualMaps, columns: Columns, imu: int, column: int) -> int:
    """Where a parameter is among the maps, triad by triad and row by row, and the offsets."""
    name, places = columns.names[column], columns.places[column]
    gyroscope, place = name.startswith("gyroscope"), places[-1]
    if name == DRIFT:
        kind, axis, degree = places[-3:]
        return int(len(left.maps) + 4 * (6 * imu + 3 * kind + axis) + degree)
    if name in OFFSETS:
        return int(len(left.maps) + 4 * (6 * imu + 3 * gyroscope + place))
    begin = 9 * imu + gyroscope * _accelerometers(columns)
    if name in SCALES:
        return begin + 4 * place
    return begin + int(3 * OFF_ROWS[place] + OFF_COLUMNS[place])


def _with_maps(found: Estimate) -> Estimate:
    """The estimate with columns for all maps and offsets."""
    old, lefts = found.columns, [one.readings.left for one in found.recorded]
    missing = [name for name in corrected(*lefts) if name not in old.names]
    if not missing:
        return found
    readings = found.recorded[0].readings
    columns = columns_of(readings.array, (*old.model.effects, *missing), readings.position_prior_sd)
    known = np.isin(columns.names, old.names)

    def wider(values) -> np.ndarray:
        out = np.zeros((len(values), columns.size), values.dtype)
        out[:, known] = values
        return out

    def moved(state: State) -> State:
        return columns.unflat(state, wider(old.flat(state)))

    recorded = tuple(replace(one, state=moved(one.state)) for one in found.recorded)
    return replace(found, recorded=recorded, columns=columns, active=wider(found.active))
