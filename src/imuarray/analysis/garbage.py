"""Readings that no sensor made: rows of zeros, spikes, bursts of garbage of one triad."""

from dataclasses import replace
from typing import Any

import numpy as np

from imuarray.analysis.settings import SETTINGS
from imuarray.recording import Recording
from imuarray.recording.channels import runs
from imuarray.recording.record import KINDS


def without_garbage(recording: Recording) -> tuple[Recording, list[str]]:
    """Without rows of zeros; garbage of one triad bridged and marked as lost; lines that say so."""
    lines: list[str] = []
    changed: dict[str, Any] = {}
    empty = ~(recording.specific_force.any(axis=(1, 2)) | recording.angular_rate.any(axis=(1, 2)))
    if 0 < empty.sum() < SETTINGS.rare * empty.size:
        recording = recording.select(~empty)
        lines.append(f"{empty.sum()} rows of zeros left out")
    for kind, name in KINDS.items():
        values, labels = getattr(recording, name), getattr(recording, f"{kind}_labels")
        parts = garbage(values, getattr(recording, f"{kind}_noise_sd"))
        every = parts[0] | parts[1]
        if not 0 < every.sum() < SETTINGS.rare * len(values):
            continue
        lost = getattr(recording, f"saturated_{kind}s")() | every[..., None]
        changed |= {name: bridged(values, every), f"{name}_saturated": lost}
        for what, part in zip(("spikes", "readings of bursts of garbage"), parts, strict=True):
            if part.any():
                whose = ", ".join(labels[k] for k in np.flatnonzero(part.any(axis=0)))
                lines.append(f"{kind} {whose}: {part.sum()} {what} left out")
    return replace(recording, **changed) if changed else recording, lines


def bridged(values, lost) -> np.ndarray:
    """The readings (T, K, 3), the ``lost`` (T, K) ones on lines between those around them."""
    out, place = values.copy(), np.arange(len(values))
    for k in np.flatnonzero(lost.any(axis=0)):
        gone = lost[:, k]
        for axis in range(3):
            out[gone, k, axis] = np.interp(place[gone], place[~gone], values[~gone, k, axis])
    return out


def garbage(values, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """(T, K) bool each: spikes, one reading of one triad far from its neighbours, and bursts.

    Where the other triads are not: what is against their median, its second difference.
    """
    spikes, bursts = np.zeros((2, *values.shape[:2]), bool)
    if values.shape[1] < 3 or len(values) < 5:
        return spikes, bursts
    apart = values - np.median(values, axis=1, keepdims=True)
    bend = apart[1:-1] - (apart[:-2] + apart[2:]) / 2
    usual = np.maximum(np.median(np.abs(bend), axis=0), noise)
    size = np.max(np.abs(bend) / usual, axis=2)
    # a spike bends its neighbours by half the other way, and moves what the others are held against
    square = np.maximum(np.sum(bend**2, axis=2), 1e-300)[1:-1]
    halves = [np.sum(bend[1:-1] * part, axis=2) / square for part in (bend[:-2], bend[2:])]
    alone = np.all([(part > -0.8) & (part < -0.2) for part in halves], axis=0)
    largest = size == size.max(axis=1, keepdims=True)
    far = (size > SETTINGS.spike) & largest
    spikes[2:-2] = far[1:-1] & alone
    second = np.partition(size, -2, axis=1)[:, -2:-1]
    far &= size > SETTINGS.only * second
    for k in np.flatnonzero(far.any(axis=0)):
        for first, past in runs(_closed(far[:, k])):
            if SETTINGS.burst[0] <= past - first <= SETTINGS.burst[1]:
                bursts[first + 1 : past + 1, k] = True
    return spikes & ~bursts, bursts


def _closed(mask) -> np.ndarray:
    """The mask (T,) with gaps of up to two filled."""
    out = mask.copy()
    for first, past in runs(~mask):
        if past - first <= 2 and 0 < first and past < len(mask):
            out[first:past] = True
    return out
