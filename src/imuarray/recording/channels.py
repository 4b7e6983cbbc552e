"""Channels that no live sensor gives: constant, copied, held, recorded twice; unreadable files.

Equality tells: while an array turns, noise does not repeat a reading of three axes for long.
"""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from imuarray.errors import InputError, require
from imuarray.provenance import seal_of
from imuarray.recording.record import AXES, KINDS, Recording
from imuarray.recording.settings import SETTINGS

SIGNATURE = b"\x89HDF"
LOOK = """
import sys, h5py
def look(name, item):
    # what declares more than it holds is refused before it is read
    if isinstance(item, h5py.Dataset) and item.nbytes < 1e9:
        item[()]
    dict(item.attrs)
with h5py.File(sys.argv[1], "r") as file:
    dict(file.attrs)
    file.visititems(look)
"""


def require_live(recording: Recording) -> None:
    """InputError for channels that leave nothing to compute: constant, or another's copy."""
    if found := dead(recording):
        raise InputError(f"recording: expected readings of live sensors; {'; '.join(found[:3])}")


def require_once(recording: Recording) -> None:
    """InputError for samples that are copies of others, before poses or samples are drawn of them.

    Afterwards few copies may be left to see, and all would count twice.
    """
    if found := _twice(recording, _turning(recording)):
        raise InputError(f"recording: expected each sample once; {found[0]}: leave it out")


def require_apart(recordings: Sequence[Recording]) -> None:
    """InputError for no recording, and for turning samples that two of them share."""
    require(recordings, "recordings", "at least one", "none")
    if len(recordings) == 1:
        return
    before: list[np.ndarray] = []
    for number, recording in enumerate(recordings, 1):
        turning = recording.select(_turning(recording))
        marks = np.unique(np.concatenate([_marks(_rows(part)) for part in turning.parts()]))
        for other, known in enumerate(before, 1):
            shared = len(np.intersect1d(marks, known, assume_unique=True))
            found = f"{shared} samples of number {other} in number {number}, too"
            require(shared < SETTINGS.least_samples, "recordings", "different ones", found)
        before.append(marks)


def dead(recording: Recording) -> list[str]:
    """A sentence for each axis that hardly changes, and for each triad or axis that is a copy."""
    if len(recording.time) < SETTINGS.least_samples:
        return []
    return [x for kind in KINDS for x in (*_constant(recording, kind), *_copied(recording, kind))]


def repeated(recording: Recording) -> list[str]:
    """A sentence for each channel that is dead or held while the array turns, and for a log that
    is there twice.

    They leave an answer, off or with intervals that are too narrow.
    """
    turning = _turning(recording)
    if turning.sum() < SETTINGS.least_samples:
        return []
    held = [sentence for kind in KINDS for sentence in _held(recording, kind, turning)]
    return dead(recording.select(turning)) + held + _twice(recording, turning)


def _parts(recording: Recording, kind: str):
    """(n, K, 3) readings in turn, and which are at a rail, where they are constant by right."""
    for part in recording.parts():
        yield getattr(part, KINDS[kind]), getattr(part, f"saturated_{kind}s")()


def _constant(recording: Recording, kind: str) -> list[str]:
    labels = getattr(recording, f"{kind}_labels")
    count = _different(values for values, _ in _parts(recording, kind))
    first = next(_parts(recording, kind))[0][0]
    least = np.where(len(recording.time) < SETTINGS.dead_samples, 1, SETTINGS.dead_values)
    few = count <= least
    if few.any():
        few &= ~np.all([rail.all(axis=0) for _, rail in _parts(recording, kind)], axis=0)
    return [
        f"{kind} {labels[k]!r}, axis {AXES[axis]}: "
        + (f"{first[k, axis]:g}" if count[k, axis] == 1
           else f"{count[k, axis]} values")
        + " in all samples"
        for k, axis in np.argwhere(few)
    ]  # fmt: skip


def _different(parts) -> np.ndarray:
    """(K, 3) how many different values each axis has, at most one more than `dead_values`."""
    known: list[np.ndarray] = []
    for values in parts:
        columns = values.reshape(len(values), -1).T
        known = known or [np.empty(0)] * len(columns)
        known = [
            before if len(before) > SETTINGS.dead_values else np.union1d(before, column)
            for before, column in zip(known, columns, strict=True)
        ]
        if min(map(len, known)) > SETTINGS.dead_values:
            break
    return np.minimum([len(one) for one in known], SETTINGS.dead_values + 1).reshape(-1, 3)


def _copied(recording: Recording, kind: str) -> list[str]:
    """Triads that are another's up to turn and scale, and single axes up to their sign."""
    labels = getattr(recording, f"{kind}_labels")
    live, size, gram, marks = _sums(recording, kind)
    source = _source(gram, size, live.reshape(-1, 3).all(axis=1))
    found = [
        f"{kind} {label!r} reads what {labels[source[k]]!r} reads"
        for k, label in enumerate(labels) if source[k] >= 0
    ]  # fmt: skip
    other = (size == 0) | ~live | np.repeat(source >= 0, 3)
    marks[other] = np.arange(1, 1 + other.sum())  # named already, or alike for another reason
    first: dict[int, int] = {}
    of = [first.setdefault(int(mark), place) for place, mark in enumerate(marks)]
    named = [f"{label!r}, axis {axis}, reads" for label in labels for axis in AXES]
    pairs = ((named[place], named[same]) for place, same in enumerate(of) if same != place)
    return found + [f"{kind} {one} what {other}" for one, other in pairs]


def _sums(recording: Recording, kind: str):
    """Sums by axis (3 K,): whether it is live, its sd, correlations, and a mark up to its sign."""
    middle, sign, rng = None, None, np.random.default_rng(0)
    total, square, mark, free, low, high = 0.0, 0.0, np.uint64(0), 0, np.inf, -np.inf
    for values, railed in _parts(recording, kind):
        columns = values.reshape(len(values), -1)
        if middle is None:  # close to that of all, or sums of squares lose digits
            middle, sign = columns.mean(axis=0), np.where(columns[0] < 0, -1.0, 1.0)
        off = columns - middle
        total, square = total + off.sum(axis=0), square + off.T @ off
        mark = mark + _marks((columns * sign + 0.0).T, rng)
        free = free + (~railed).sum(axis=0).ravel()
        low, high = np.minimum(low, columns.min(axis=0)), np.maximum(high, columns.max(axis=0))
    mean = total / len(recording.time)
    covariance = square / len(recording.time) - np.outer(mean, mean)
    size = np.where(high > low, np.sqrt(np.abs(np.diag(covariance))), 0.0)
    scale = np.where(size > 0, size, 1.0)
    return free >= SETTINGS.least_samples, size, covariance / np.outer(scale, scale), mark


def _source(gram, size, live) -> np.ndarray:
    """(K,) the first triad of which each is a linear copy, or -1; only of ``live`` (K,) ones.

    ``gram`` (3 K, 3 K) are the axes' correlations, ``size`` (3 K,) their sds.
    """
    count, source = len(live), np.full(len(live), -1)
    gram = gram.reshape(count, 3, count, 3).swapaxes(1, 2)
    live = live & (size.reshape(count, 3) > 0).all(axis=1)
    for i in range(count):
        later = np.flatnonzero(live & (source < 0))
        later = later[later > i]
        if not live[i] or source[i] >= 0 or not later.size or np.linalg.cond(gram[i, i]) > 1e6:
            continue
        told = gram[later, i] @ np.linalg.solve(gram[i, i], gram[i, later])
        left = 1.0 - np.einsum("jaa->ja", told)
        source[later[(left < SETTINGS.own_share**2).all(axis=1)]] = i
    return source


def _held(recording: Recording, kind: str, turning) -> list[str]:
    labels, again, judged, start = getattr(recording, f"{kind}_labels"), [], 0, 0
    last = None
    for values, railed in _parts(recording, kind):
        before = values[:1] + np.nan if last is None else last
        moved = turning[start : start + len(values), None] & ~railed.any(axis=2)
        moved[0] &= last is not None
        same = np.concatenate([before, values[:-1]]) == values
        again.append(moved & same.all(axis=2))
        judged = judged + moved.sum(axis=0)
        start, last = start + len(values), values[-1:]
    repeats, found = np.concatenate(again), []
    for k, label in enumerate(labels):
        share = repeats[:, k].sum() / max(judged[k], 1)
        begin, end = max(runs(repeats[:, k]), key=lambda run: run[1] - run[0], default=(1, 1))
        if share > SETTINGS.held_share:
            found.append(
                f"{kind} {label!r} repeats {100 * share:.0f} % of its readings while the array"
                " turns: slower than the log and filled up? keep the samples it took"
            )
        elif end - begin >= SETTINGS.frozen:
            found.append(
                f"{kind} {label!r} is frozen at {recording.time[begin - 1]:g} s, for"
                f" {end - begin + 1} samples in which the array turns: leave them out"
            )
    return found


def _twice(recording: Recording, turning) -> list[str]:
    """Whole samples that came before, other than just before."""
    samples = len(recording.time)
    marks = np.concatenate([_marks(_rows(part)) for part in recording.parts()])
    _, first, inverse = np.unique(marks, return_index=True, return_inverse=True)
    source = first[inverse]
    again = turning & (source < np.arange(samples))
    again[1:] &= marks[1:] != marks[:-1]
    if again.sum() < SETTINGS.least_samples:
        return []
    place = int(np.argmax(again))
    return [
        f"{again.sum()} of {samples} samples are copies of others, the first at"
        f" {recording.time[place]:g} s of that at {recording.time[source[place]]:g} s: a part of"
        " the log is there twice"
    ]


def _turning(recording: Recording) -> np.ndarray:
    """(T,) bool"""
    squares = [np.mean(np.sum(p.angular_rate**2, axis=2), axis=1) for p in recording.parts()]
    return np.sqrt(np.concatenate(squares)) > SETTINGS.turning


def _rows(recording: Recording) -> np.ndarray:
    """(T, 3 (A + G)) all readings of each sample."""
    parts = [getattr(recording, name) for name in KINDS.values()]
    return np.concatenate([part.reshape(len(part), 3 * part.shape[1]) for part in parts], axis=1)


def runs(mask) -> list[tuple[int, int]]:
    """First and past-the-last index of each run of True in ``mask`` (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _marks(rows, rng=None) -> np.ndarray:
    """64 bits of each row of ``rows`` (N, M): equal for equal rows, else not (to 2**-64)."""
    rng = rng or np.random.default_rng(0)
    odd = rng.integers(1, 2**63, rows.shape[1], dtype=np.uint64) * 2 + 1
    return np.sum(np.ascontiguousarray(rows, float).view(np.uint64) * odd, axis=1)


def require_readable(path: Path, patience: float = SETTINGS.patience) -> None:
    """InputError for an HDF5 file without a seal at which HDF5 hangs or dies.

    ``patience`` in s. What HDF5 refuses by itself, and what is no HDF5 file, is left to the reader.
    """
    with open(path, "rb") as handle:
        if handle.read(len(SIGNATURE)) != SIGNATURE or seal_of(path) is not None:
            return
    limit = patience * (1 + path.stat().st_size / SETTINGS.patient_size)
    call = [sys.executable, "-c", LOOK, str(path)]
    try:
        status = subprocess.run(call, capture_output=True, timeout=limit, check=False).returncode
    except subprocess.TimeoutExpired:
        raise InputError(
            f"{path}: expected a NetCDF-4 file, found one that HDF5 is not through with after"
            f" {limit:.0f} s: damaged?"
        ) from None
    require(status >= 0, str(path), "a NetCDF-4 file", "one that HDF5 crashes at")
