"""Channels that cannot be what a live sensor reads: constant, copied, held, recorded twice.

Exact equality tells: while an array turns, noise does not repeat a reading of three axes for long.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from imuarray.errors import InputError
from imuarray.recording.record import AXES, Recording

LEAST = 10  # samples below which equal readings may be chance
TURNING = 0.2  # rad/s; at rest, coarse readings do repeat
HELD = 0.3  # share of repeated readings; a sensor of half the rate, filled up, has 0.5
FROZEN = 20  # readings in a row
_KINDS = {"accelerometer": "specific_force", "gyroscope": "angular_rate"}


def require_live(recording: Recording, where: str = "recording") -> None:
    """InputError for channels that leave nothing to compute: constant, or another's copy."""
    found = dead(recording)
    if found:
        raise InputError(f"{where}: expected readings of live sensors; {'; '.join(found[:3])}")


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
    """A sentence for each axis that never changes, and for each triad or axis that is a copy."""
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
    still = (np.ptp(values, axis=0) == 0) & ~railed.all(axis=0)
    return [
        f"{kind} {labels[k]!r}, axis {AXES[axis]}: {values[0, k, axis]:g} in all samples"
        for k, axis in np.argwhere(still)
    ]


def _copied(recording: Recording, kind: str) -> list[str]:
    """Equal columns up to their sign, as axes that are named anew have; whole triads first."""
    values, labels, railed = _readings(recording, kind)
    columns = values.reshape(len(values), -1).T
    marks = _marks(columns * np.where(columns[:, :1] < 0, -1.0, 1.0) + 0.0)
    other = (np.ptp(columns, axis=1) == 0) | ((~railed).sum(axis=0).ravel() < LEAST)
    marks[other] = np.arange(1, 1 + other.sum())  # alike for another reason
    first: dict[int, int] = {}
    of = [first.setdefault(int(mark), place) for place, mark in enumerate(marks)]
    found = []
    for k, label in enumerate(labels):
        own = [(axis, of[3 * k + axis]) for axis in range(3) if of[3 * k + axis] != 3 * k + axis]
        others = {place // 3 for _, place in own}
        if len(own) == 3 and len(others) == 1 and others != {k}:
            found.append(f"{kind} {label!r} reads what {labels[others.pop()]!r} reads")
            continue
        found += [
            f"{kind} {label!r}, axis {AXES[axis]}, reads what {labels[place // 3]!r}, axis"
            f" {AXES[place % 3]}, reads"
            for axis, place in own
        ]
    return found


def _held(recording: Recording, kind: str, turning) -> list[str]:
    values, labels, railed = _readings(recording, kind)
    judged = turning[1:, None] & ~railed[1:].any(axis=2)
    again = judged & np.all(values[1:] == values[:-1], axis=2)
    found = []
    for k, label in enumerate(labels):
        share = again[:, k].sum() / max(judged[:, k].sum(), 1)
        run, begin = _longest(again[:, k])
        if share > HELD:
            found.append(
                f"{kind} {label!r} repeats {100 * share:.0f} % of its readings while the array"
                " turns: slower than the log and filled up? keep the samples it took"
            )
        elif run >= FROZEN:
            found.append(
                f"{kind} {label!r} is frozen at {recording.time[begin]:g} s, for {run + 1} samples"
                " in which the array turns: leave them out"
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


def _longest(mask) -> tuple[int, int]:
    """Length and begin of the longest run of True in ``mask`` (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    begins, lengths = edges[::2], edges[1::2] - edges[::2]
    if not len(lengths):
        return 0, 0
    longest = int(np.argmax(lengths))
    return int(lengths[longest]), int(begins[longest])


def _marks(rows) -> np.ndarray:
    """64 bits of each row of ``rows`` (N, M): equal for equal rows, else not (to 2**-64)."""
    odd = np.random.default_rng(0).integers(1, 2**63, rows.shape[1], dtype=np.uint64) * 2 + 1
    return np.sum(np.ascontiguousarray(rows, float).view(np.uint64) * odd, axis=1)
