"""Effects of whole readings, found before any fit: repeats, rails, exchanged axes."""

from dataclasses import replace
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.derivatives import polynomial_derivative
from imuarray.engine.readings import Readings, part_of
from imuarray.model.effects import KINDS
from imuarray.motion.state import lever
from imuarray.recording.record import AXES
from imuarray.tails import log_poisson

RAILS, SWAP = "saturation", "axis_swap"
UNITS = ("m s-2", "rad s-1")  # of the two kinds
TURNS = [
    np.array(signs)[:, None] * np.eye(3)[list(order)]
    for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)
]  # fmt: skip


class Finding(NamedTuple):
    """A cause as it is reported: whose, log p, its numbers, what it gains on held-out time."""

    effect: str
    imus: tuple[int, ...]
    log_p: float
    parameters: dict  # name -> (value, sd, unit)
    gain: float = 0.0  # nats
    gain_se: float = 0.0
    blocks: np.ndarray | None = None  # nats of each held-out block
    says: str = ""  # of readings, what was read
    doubtful: bool = False  # named only where it gains
    rivals: tuple | list = ()  # effects that it cannot be told from
    also: dict = {}  # what else its entry has


def triads(values) -> np.ndarray:
    """(T, N, 2, 3), a view: accelerometers and gyroscopes of values (T, N, 6)."""
    return values.reshape(*values.shape[:2], 2, 3)


def find_repeats(readings: Readings):
    """Triads that repeat their former sample: (causes, lost (T, N, 6) bool)."""
    together, lost, found = np.diff(readings.run) == 0, np.zeros(readings.values.shape, bool), []
    for imu, kind in np.argwhere(readings.exists):
        values = _as_read(readings, imu, kind)
        close = np.abs(np.diff(values, axis=0)) <= SETTINGS.equal * (1 + np.abs(values[1:]))
        same = close & together[:, None]
        every = same.all(axis=1)
        log_p = log_poisson(every.sum(), max(_by_chance(same, every), 1e-9 * together.sum()))
        if log_p < SETTINGS.rare_repeats:
            # after a gap, the sample before is not at hand
            triads(lost)[1:, imu, kind] = (every | ~together)[:, None]
            found.append((int(imu), every.mean(), float(log_p)))
    if not found:
        return [], lost
    imus, shares, logs = zip(*found, strict=True)
    numbers = {"share": (float(np.mean(shares)), float(np.std(shares)), "1")}
    says = f"{100 * np.mean(shares):.2g} % of the readings repeat the one before exactly"
    # a coarse converter at rest repeats itself, too, and is right
    imus = tuple(sorted({*imus}))
    return [Finding("stale_samples", imus, min(logs), numbers, says=says, doubtful=True)], lost


def _as_read(readings: Readings, imu: int, kind: int) -> np.ndarray:
    """Readings (T, 3) of a triad without first order's map, which mixes its axes' steps."""
    values, left = triads(readings.values)[:, imu, kind], readings.left
    removed = [] if left is None or left.removed is None else left.removed.reshape(-1, 3, 3)
    place = kind * readings.array.accelerometers + imu
    return values @ np.linalg.inv(removed[place]).T if place < len(removed) else values


def _by_chance(same, every) -> float:
    """Samples that repeat all axes (T, 3) by chance, as axes repeat by themselves: slow ones do."""
    few = same & ~every[:, None]
    blocks = np.array_split(few, max(len(few) // SETTINGS.repeats_block, 1))
    return float(sum(len(block) * np.prod(block.mean(axis=0)) for block in blocks))


def find_rails(readings: Readings):
    """Readings of one triad or several that pile up below the declared range: (causes, lost)."""
    lost, found, logs = np.zeros(readings.values.shape, bool), [], []
    sizes = triads(np.where(readings.keep, np.abs(readings.values), 0.0))
    for kind in range(len(KINDS)):
        there = np.flatnonzero(readings.exists[:, kind])
        chance, own = len(there) * _tied(readings, kind), sizes[:, there, kind]
        tops = own.max(axis=(0, 2))
        at = (own >= tops[:, None] * (1 - SETTINGS.same)) & (own > 0)
        counts = at.sum(axis=(0, 2))
        for place, imu in enumerate(there):
            count = counts[np.isclose(tops, tops[place], rtol=SETTINGS.same, atol=0.0)].sum()
            log_p = float(log_poisson(count - 1, chance) + np.log(len(there)))
            if log_p < SETTINGS.check or _piles(own[:, place], at[:, place]):
                triads(lost)[:, imu, kind] = at[:, place]
                found.append((int(imu), kind, float(tops[place])))
                logs.append(float(np.clip(log_p, SETTINGS.least_log, SETTINGS.check)))
    if not found:
        return [], lost
    says = "readings pile up at a rail that the declared range does not give"
    return [rails_cause(found, min(logs), says)], lost


def _tied(readings: Readings, kind: int) -> float:
    """Share of a kind's readings that another equals: a coarse converter's are, by chance."""
    every = max(len(readings.time) // SETTINGS.searched, 1)
    values, keep = (triads(x[::every])[:, :, kind] for x in (readings.values, readings.keep))
    some = np.abs(values[keep])
    return (1 + some.size - np.unique(some).size) / max(some.size, 1)


def rails_cause(found, log_p: float, says: str) -> Finding:
    """The cause of triads (imu, kind, rail in SI) whose readings a rail clips."""
    numbers = {}
    for kind, name in enumerate(KINDS):
        sizes = [rail for _, own, rail in found if own == kind]
        if sizes:
            numbers[f"{name}_rail"] = float(np.median(sizes)), float(np.std(sizes)), UNITS[kind]
    where = ", ".join(f"{n} {v[0]:.4g} {v[2]}" for n, v in numbers.items())
    imus = tuple(sorted({imu for imu, *_ in found}))
    return Finding(RAILS, imus, log_p, numbers, says=f"{says} ({where})")


def _piles(size, at) -> bool:
    """True where so many of a triad's sizes (T, 3) are ``at`` the largest that it is no chance."""
    count = int(at.sum())
    if count < SETTINGS.least_clipped:
        return False
    # a coarse converter has ties by chance: the next values below must have far fewer
    below = np.unique(size[~at])[-5:]
    most = max((int(np.sum(size == value)) for value in below), default=0)
    return most <= 1 or count > 3 * most + 1


def find_swaps(readings: Readings):
    """Triads with exchanged or reversed axes: (causes, turns (N, 2, 3, 3), whether mended).

    Axes are those that most triads of a kind agree on; without such a majority the turns stay
    unknown and nothing is mended.
    """
    count = len(readings.exists)
    turns, hit, corrected = np.tile(np.eye(3), (count, 2, 1, 1)), [], True
    lever = np.zeros((len(readings.time), count, 3))
    for kind in (1, 0):
        there = np.flatnonzero(readings.exists[:, kind])
        values = triads(readings.values)[:, :, kind]
        own = values - lever
        # by each triad, those that agree where it is right
        agreeing = max((
            [k for k in there if _is_straight(_nearest(own[:, j] + lever[:, k], values[:, k])[0])]
            for j in there
        ), key=len)  # fmt: skip
        if 2 * len(agreeing) <= len(there) and len(there) > 2:
            corrected = False
            hit += [(int(k), kind) for k in there]
            continue
        common = np.median(own[:, agreeing], axis=1)
        for imu in there:
            nearest, matrix = _nearest(common + lever[:, imu], values[:, imu])
            limit = min(SETTINGS.near_turn, np.linalg.norm(matrix - np.eye(3)) / 2)
            if not _is_straight(nearest) and np.linalg.norm(matrix - nearest) < limit:
                turns[imu, kind] = nearest
                hit.append((int(imu), kind))
        if kind:
            lever = _lever(readings, common)
    if not hit:
        return [], turns, True
    says = "; ".join(
        f"{KINDS[kind]} {readings.labels[imu]}: {_axes(turns[imu, kind])}" for imu, kind in hit
    )
    if not corrected:
        turns[:] = np.eye(3)
        says = "no majority of the triads agrees on the axes: put them right first"
    imus = tuple(sorted({imu for imu, _ in hit}))
    return [Finding(SWAP, imus, -1e6, {}, says=says)], turns, corrected


def _nearest(reference, values) -> tuple[np.ndarray, np.ndarray]:
    """(nearest signed permutation, matrix) that turns a reference (T, 3) into readings (T, 3)."""
    matrix = np.linalg.lstsq(reference, values, rcond=None)[0].T
    return min(TURNS, key=lambda turn: np.linalg.norm(turn - matrix)), matrix


def _is_straight(turn) -> bool:
    return np.array_equal(turn, np.eye(3))


def _lever(readings: Readings, rate) -> np.ndarray:
    """Specific force that rotation adds at the nominal places, (T, N, 3)."""
    turning = polynomial_derivative(readings.time, readings.run, rate, readings.window, 1)
    places = np.zeros((len(readings.exists), 3))
    places[: readings.array.accelerometers] = readings.array.relative
    return lever(rate[:, None], turning[:, None], places)


def _axes(turn) -> str:
    """A signed permutation in words: reads (+y, +x, +z)."""
    names = ["+-"[int(row.sum() < 0)] + AXES[int(np.argmax(np.abs(row)))] for row in turn]
    return f"reads ({', '.join(names)})"


def find_reading_faults(readings: Readings, without=()):
    """(causes, readings put right, whether they could be): axes turned back, the rest left out."""
    causes, corrected = [], True
    for name, find in (("stale_samples", find_repeats), (RAILS, find_rails)):
        if name not in without:
            found, lost = find(readings)
            causes += found
            readings = readings.without(lost)
    if SWAP not in without:
        # each triad against each: a part tells
        found, turns, corrected = find_swaps(part_of(readings, SETTINGS.searched))
        causes += found
        if found:
            values = (triads(readings.values)[..., None, :] @ turns).reshape(readings.values.shape)
            readings = replace(readings, values=values)
    return causes, readings, corrected
