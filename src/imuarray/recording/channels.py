"""Channels that cannot be what a live sensor reads: constant, copied, held, recorded twice.

Equality tells: while an array turns, noise does not repeat a reading of three axes for long.
"""

from collections.abc import Sequence

import numpy as np

from imuarray.errors import InputError
from imuarray.recording.record import AXES, Recording

LEAST = 10  # samples below which equal readings may be chance
TURNING = 0.2  # rad/s; at rest, coarse readings do repeat
HELD = 0.3  # share of repeated readings; a sensor of half the rate, filled up, has 0.5
FROZEN = 20  # readings in a row
COARSE, MANY = 5, 100  # values of a dead axis that flickers, in at least so many samples
ALIKE = 1e-6  # share of a triad's readings that is its own; noise is 2e-5 of a MEMS sensor's range
_KINDS = {"accelerometer": "specific_force", "gyroscope": "angular_rate"}


def require_live(recording: Recording, where: str = "recording") -> None:
    """InputError for channels that leave nothing to compute: constant, or another's copy."""
    found = dead(recording)
    if found:
        raise InputError(f"{where}: expected readings of live sensors; {'; '.join(found[:3])}")


def require_once(recording: Recording) -> None:
    """InputError for samples that are copies of others, before poses or samples are drawn of them.

    Afterwards few copies may be left to see, and all would count twice.
    """
    found = _twice(recording, _turning(recording))
    if found:
        raise InputError(f"recording: expected each sample once; {found[0]}: leave it out")


def require_apart(recordings: Sequence[Recording]) -> None:
    """InputError for no recording, and for turning samples that two of them share."""
    if not recordings:
        raise InputError("recordings: expected at least one, found none")
    before: list[np.ndarray] = []
    for number, recording in enumerate(recordings, 1):
        marks = np.unique(_marks(_rows(recording)[_turning(recording)]))
        for other, known in enumerate(before, 1):
            shared = len(np.intersect1d(marks, known, assume_unique=True))
            if shared >= LEAST:
                raise InputError(
                    f"recordings: expected different ones, found {shared} samples of number {other}"
                    f" in number {number}, too"
                )
        before.append(marks)


def dead(recording: Recording) -> list[str]:
    """A sentence for each axis that hardly changes, and for each triad or axis that is a copy."""
    if len(recording.time) < LEAST:
        return []
    return [
        sentence
        for kind in _KINDS
        for sentence in (*_constant(recording, kind), *_copied(recording, kind))
    ]


def repeated(recording: Recording) -> list[str]:
    """A sentence for each channel that is dead or held while the array turns, and for a log that
    is there twice.

    They leave an answer, off or with intervals that are too narrow.
    """
    turning = _turning(recording)
    if turning.sum() < LEAST:
        return []
    held = [sentence for kind in _KINDS for sentence in _held(recording, kind, turning)]
    return dead(recording.select(turning)) + held + _twice(recording, turning)


def _readings(recording: Recording, kind: str):
    """(T, K, 3) readings, labels, and which are at a rail, where they are constant by right."""
    return (
        getattr(recording, _KINDS[kind]), getattr(recording, f"{kind}_labels"),
        getattr(recording, f"saturated_{kind}s")(),
    )  # fmt: skip


def _constant(recording: Recording, kind: str) -> list[str]:
    values, labels, railed = _readings(recording, kind)
    count = _different(values)
    least = np.where(len(values) < MANY, 1, COARSE)
    return [
        f"{kind} {labels[k]!r}, axis {AXES[axis]}: "
        + (f"{values[0, k, axis]:g}" if count[k, axis] == 1 else f"{count[k, axis]} values")
        + " in all samples"
        for k, axis in np.argwhere((count <= least) & ~railed.all(axis=0))
    ]


def _different(values) -> np.ndarray:
    """(K, 3) how many different values each axis has, at most one more than `COARSE`."""
    count, left = np.zeros(values.shape[1:], int), np.ones(values.shape, bool)
    for _ in range(COARSE + 1):
        count += left.any(axis=0)
        first = np.take_along_axis(values, left.argmax(axis=0)[None], axis=0)
        left &= values != first
    return count


def _copied(recording: Recording, kind: str) -> list[str]:
    """Triads that are another's up to turn and scale, and single axes up to their sign."""
    values, labels, railed = _readings(recording, kind)
    live = (~railed).sum(axis=0) >= LEAST
    source = _source(values, live.all(axis=1))
    found = [
        f"{kind} {label!r} reads what {labels[source[k]]!r} reads"
        for k, label in enumerate(labels) if source[k] >= 0
    ]  # fmt: skip
    columns = values.reshape(len(values), -1).T
    marks = _marks(columns * np.where(columns[:, :1] < 0, -1.0, 1.0) + 0.0)
    other = (np.ptp(columns, axis=1) == 0) | ~live.ravel() | np.repeat(source >= 0, 3)
    marks[other] = np.arange(1, 1 + other.sum())  # named already, or alike for another reason
    first: dict[int, int] = {}
    of = [first.setdefault(int(mark), place) for place, mark in enumerate(marks)]
    return found + [
        f"{kind} {labels[place // 3]!r}, axis {AXES[place % 3]}, reads what"
        f" {labels[same // 3]!r}, axis {AXES[same % 3]}, reads"
        for place, same in enumerate(of)
        if same != place
    ]


def _source(values, live) -> np.ndarray:
    """(K,) the first triad of which each is a linear copy, or -1; only of ``live`` (K,) ones."""
    count, source = values.shape[1], np.full(values.shape[1], -1)
    columns = values.reshape(len(values), -1)
    columns = columns - columns.mean(axis=0)
    size = np.sqrt(np.mean(columns**2, axis=0))
    columns = columns / np.where(size > 0, size, 1.0)
    gram = (columns.T @ columns / len(columns)).reshape(count, 3, count, 3).swapaxes(1, 2)
    live = live & (size.reshape(count, 3) > 0).all(axis=1)
    for i in range(count):
        later = np.flatnonzero(live & (source < 0))
        later = later[later > i]
        if not live[i] or source[i] >= 0 or not later.size or np.linalg.cond(gram[i, i]) > 1e6:
            continue
        told = gram[later, i] @ np.linalg.solve(gram[i, i], gram[i, later])
        left = 1.0 - np.einsum("jaa->ja", told)
        source[later[(left < ALIKE**2).all(axis=1)]] = i
    return source


def _held(recording: Recording, kind: str, turning) -> list[str]:
    values, labels, railed = _readings(recording, kind)
    judged = turning[1:, None] & ~railed[1:].any(axis=2)
    again = judged & np.all(values[1:] == values[:-1], axis=2)
    found = []
    for k, label in enumerate(labels):
        share = again[:, k].sum() / max(judged[:, k].sum(), 1)
        begin, end = max(runs(again[:, k]), key=lambda run: run[1] - run[0], default=(0, 0))
        if share > HELD:
            found.append(
                f"{kind} {label!r} repeats {100 * share:.0f} % of its readings while the array"
                " turns: slower than the log and filled up? keep the samples it took"
            )
        elif end - begin >= FROZEN:
            found.append(
                f"{kind} {label!r} is frozen at {recording.time[begin]:g} s, for"
                f" {end - begin + 1} samples in which the array turns: leave them out"
            )
    return found


def _twice(recording: Recording, turning) -> list[str]:
    """Whole samples that came before, other than just before."""
    samples, marks = len(recording.time), _marks(_rows(recording))
    _, first, inverse = np.unique(marks, return_index=True, return_inverse=True)
    source = first[inverse]
    again = turning & (source < np.arange(samples))
    again[1:] &= marks[1:] != marks[:-1]
    if again.sum() < LEAST:
        return []
    place = int(np.argmax(again))
    return [
        f"{again.sum()} of {samples} samples are copies of others, the first at"
        f" {recording.time[place]:g} s of that at {recording.time[source[place]]:g} s: a part of"
        " the log is there twice"
    ]


def _turning(recording: Recording) -> np.ndarray:
    """(T,) bool"""
    return np.sqrt(np.mean(np.sum(recording.angular_rate**2, axis=2), axis=1)) > TURNING


def _rows(recording: Recording) -> np.ndarray:
    """(T, 3 (A + G)) all readings of each sample."""
    parts = [getattr(recording, name) for name in _KINDS.values()]
    return np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)


def runs(mask) -> list[tuple[int, int]]:
    """First and past-the-last index of each run of True in ``mask`` (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _marks(rows) -> np.ndarray:
    """64 bits of each row of ``rows`` (N, M): equal for equal rows, else not (to 2**-64)."""
    odd = np.random.default_rng(0).integers(1, 2**63, rows.shape[1], dtype=np.uint64) * 2 + 1
    return np.sum(np.ascontiguousarray(rows, float).view(np.uint64) * odd, axis=1)
