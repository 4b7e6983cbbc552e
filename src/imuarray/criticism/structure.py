"""Effects of whole readings, found before any fit: repeats, rails, exchanged axes."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from scipy.stats import poisson

from imuarray.criticism.readings import Readings
from imuarray.model.structure import design, products

KINDS = ("accelerometer", "gyroscope")
LEAST_REPEATS = 4
LEAST_CLIPPED = 3
RARE = -12.0  # log p from which repeats are no chance of a coarse converter
NEAR = 0.5  # a signed permutation is believed when the triad's matrix is this near to it
TURNS = [
    np.array(signs)[:, None] * np.eye(3)[list(order)]
    for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)
]  # fmt: skip


class Structural(NamedTuple):
    """One such effect: whose, log p, its numbers and the sentence that says it."""

    effect: str
    imus: tuple[int, ...]
    log_p: float
    parameters: dict  # name -> (value, sd, unit)
    says: str


def part(readings: Readings, kind: int) -> np.ndarray:
    """The readings of the accelerometers (0) or the gyroscopes (1), (T, N, 3)."""
    return readings.values[..., 3 * kind : 3 * kind + 3]


def find_repeats(readings: Readings):
    """Triads that repeat their former sample: (causes, lost (T, N, 6) bool)."""
    together = np.diff(readings.run) == 0
    lost = np.zeros(readings.values.shape, bool)
    hit, shares, logs = [], [], []
    for imu, kind in np.argwhere(readings.exists):
        values = part(readings, kind)[:, imu]
        same = (values[1:] == values[:-1]) & together[:, None]
        every = same.all(axis=1)
        chance = np.prod(same.mean(axis=0)) if not every.all() else 1.0
        alone = np.prod((same & ~every[:, None]).mean(axis=0))
        log_p = poisson.logsf(every.sum() - 1, max(min(chance, alone), 1e-9) * together.sum())
        if every.sum() >= LEAST_REPEATS and log_p < RARE:
            lost[1:, imu, 3 * kind : 3 * kind + 3] = every[:, None]
            hit.append(int(imu))
            shares.append(every.mean())
            logs.append(log_p)
    if not hit:
        return [], lost
    numbers = {"share": (float(np.mean(shares)), float(np.std(shares)), "1")}
    says = f"{100 * np.mean(shares):.2g} % of the readings repeat the one before exactly"
    return [Structural("stale_samples", unique(hit), float(min(logs)), numbers, says)], lost


def find_rails(readings: Readings):
    """Readings that pile up at a value below the declared range: (causes, lost)."""
    lost = np.zeros(readings.values.shape, bool)
    hit, rails, logs = [], {}, []
    for imu, kind in np.argwhere(readings.exists):
        values = part(readings, kind)[:, imu]
        kept = readings.keep[:, imu, 3 * kind : 3 * kind + 3]
        rail, at = _pile(values, kept)
        if rail is None:
            continue
        lost[:, imu, 3 * kind : 3 * kind + 3] = at
        hit.append(int(imu))
        rails.setdefault(kind, []).append(rail)
        logs.append(-9.0 * (at.sum() - 1))
    if not hit:
        return [], lost
    units = ("m s-2", "rad s-1")
    numbers = {
        f"{KINDS[kind]}_rail": (float(np.median(found)), float(np.std(found)), units[kind])
        for kind, found in rails.items()
    }
    where = ", ".join(f"{n} {v[0]:.4g} {v[2]}" for n, v in numbers.items())
    says = f"readings pile up at a rail that the declared range does not tell of ({where})"
    return [Structural("saturation", unique(hit), float(min(logs)), numbers, says)], lost


def _pile(values, kept):
    """(rail, at (T, 3)) of a triad whose largest sizes are one value over and over, or Nones."""
    size = np.where(kept, np.abs(values), 0.0)
    top = size.max()
    at = size >= top * (1 - 1e-9)
    count = int(at.sum())
    if count < LEAST_CLIPPED or top == 0:
        return None, None
    # a coarse converter has ties by chance: the next values below must have far fewer
    below = np.unique(size[size < top * (1 - 1e-9)])[-5:]
    rivals = [int(np.sum(size == value)) for value in below]
    most = max(rivals, default=0)
    return (top, at) if most <= 1 or count > 3 * most + 1 else (None, None)


def find_swaps(readings: Readings):
    """Triads with exchanged or reversed axes: (causes, turns (N, 2, 3, 3))."""
    turns = np.tile(np.eye(3), (len(readings.exists), 2, 1, 1))
    rate = np.median(part(readings, 1)[:, readings.exists[:, 1]], axis=1)
    hit = []
    for imu, kind in np.argwhere(readings.exists):
        reference = rate if kind else _force_elsewhere(readings, rate, imu)
        matrix = np.linalg.lstsq(reference, part(readings, kind)[:, imu], rcond=None)[0].T
        nearest = min(TURNS, key=lambda turn: np.linalg.norm(turn - matrix))
        near = np.linalg.norm(matrix - nearest) < min(NEAR, np.linalg.norm(matrix - np.eye(3)) / 2)
        if near and not np.array_equal(nearest, np.eye(3)):
            turns[imu, kind] = nearest
            hit.append((int(imu), int(kind)))
    turned = {kind: [i for i, k in hit if k == kind] for kind in (0, 1)}
    for kind, imus in turned.items():
        if 2 * len(imus) > readings.exists[:, kind].sum():
            # most of them: it is the others that differ, and the frame is the gyroscopes'
            turns[:, kind] = np.eye(3)
            hit = [pair for pair in hit if pair[1] != kind]
    if not hit:
        return [], turns
    says = "; ".join(
        f"{KINDS[kind]} {readings.labels[imu]}: {_axes(turns[imu, kind])}" for imu, kind in hit
    )
    return [Structural("axis_swap", unique([imu for imu, _ in hit]), -1e6, {}, says)], turns


def _force_elsewhere(readings: Readings, rate, imu) -> np.ndarray:
    """The specific force at an IMU's nominal place from the median of all triads, (T, 3).

    The centrifugal part is that of the gyroscopes; what omega_dot adds averages out.
    """
    there = readings.exists[:, 0]
    centrifugal = products(rate) @ design(readings.array.relative)[:, :6].T
    centrifugal = centrifugal.reshape(len(rate), -1, 3)
    common = np.median(part(readings, 0)[:, there] - centrifugal, axis=1)
    return common + centrifugal[:, imu]


def _axes(turn) -> str:
    """A signed permutation in words: reads (+y, +x, +z)."""
    names = ["+-"[int(row.sum() < 0)] + "xyz"[int(np.argmax(np.abs(row)))] for row in turn]
    return f"reads ({', '.join(names)})"


def undo_swaps(readings: Readings, turns) -> Readings:
    """The readings with the axes put right."""
    values = readings.values.copy()
    for imu, kind in np.argwhere(readings.exists):
        block = slice(3 * kind, 3 * kind + 3)
        values[:, imu, block] = readings.values[:, imu, block] @ turns[imu, kind]
    return replace(readings, values=values)


def unique(imus) -> tuple[int, ...]:
    """Sorted, each once."""
    return tuple(sorted(set(imus)))


def find_structural(readings: Readings, without=()):
    """(causes, readings put right): stale samples and rails left out, axes turned back."""
    causes = []
    for name, find in (("stale_samples", find_repeats), ("saturation", find_rails)):
        if name not in without:
            found, lost = find(readings)
            causes += found
            readings = readings.without(lost)
    if "axis_swap" not in without:
        found, turns = find_swaps(readings)
        causes += found
        readings = undo_swaps(readings, turns)
    return causes, readings
