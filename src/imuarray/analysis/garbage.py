"""Readings that no sensor made: rows of zeros, spikes, bursts of garbage, one triad frozen."""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import binary_closing, binary_dilation, median_filter

from imuarray.analysis.settings import SETTINGS
from imuarray.recording import Recording
from imuarray.recording.channels import runs
from imuarray.recording.record import KINDS
from imuarray.recording.rig import Log
from imuarray.recording.settings import SETTINGS as RECORDING

WHAT = "spikes", "readings of bursts of garbage", "frozen readings"  # `garbage`, `frozen`


def without_garbage(recording: Recording) -> tuple[Recording, list[str]]:
    """Without rows of zeros; garbage of one triad bridged and marked as lost; lines that say so."""
    lines: list[str] = []
    changed: dict[str, Any] = {}
    empty = ~(recording.specific_force.any(axis=(1, 2)) | recording.angular_rate.any(axis=(1, 2)))
    if 0 < empty.sum() < SETTINGS.rare * empty.size:
        recording = recording.select(~empty)
        lines.append(f"{empty.sum()} rows of zeros left out")
    turning = np.mean(np.sum(recording.angular_rate**2, axis=2), axis=1) > RECORDING.turning**2
    for kind, name in KINDS.items():
        values, labels = getattr(recording, name), getattr(recording, f"{kind}_labels")
        held = frozen(values, turning)
        released = binary_dilation(held, np.ones((3, 1)))  # a jump, but no spike
        parts = garbage(values, getattr(recording, f"{kind}_noise_sd"))
        parts = *(part & ~released for part in parts), held
        every = np.any(parts, axis=0)
        if not 0 < every.sum() < SETTINGS.rare * len(values):
            continue
        lost = getattr(recording, f"saturated_{kind}s")() | every[..., None]
        changed |= {name: bridged(values, every), f"{name}_saturated": lost}
        for what, part in zip(WHAT, parts, strict=True):
            if part.any():
                whose = ", ".join(labels[k] for k in np.flatnonzero(part.any(axis=0)))
                lines.append(f"{kind} {whose}: {part.sum()} {what} left out")
    return replace(recording, **changed) if changed else recording, lines


def without_garbage_of(log: Log) -> tuple[Log, list[str]]:
    """A log of one IMU without garbage, by its own readings alone; lines that say so."""
    lines: list[str] = []
    changed: dict[str, Any] = {}
    empty = log.accelerometer_time[~log.specific_force.any(axis=1)]  # no accelerometer reads that
    speed = np.linalg.norm(log.angular_rate, axis=1)
    for kind, name in KINDS.items():
        time, values = getattr(log, f"{kind}_time"), getattr(log, name)
        zeros = ~values.any(axis=1) & np.isin(time, empty)
        held = frozen(
            values[:, None], np.interp(time, log.gyroscope_time, speed) > RECORDING.turning
        )
        found = zeros | far_alone(values, getattr(log, f"{kind}_noise_sd")) | held[:, 0]
        if 0 < found.sum() < SETTINGS.rare * len(time):
            changed |= {f"{kind}_time": time[~found], name: values[~found]}
            lines.append(f"{log.label}: {kind}: {found.sum()} readings of garbage left out")
    return replace(log, **changed) if changed else log, lines


def far_alone(values, noise: float) -> np.ndarray:
    """(T,) bool: readings (T, 3) far from their neighbours, single or in short bursts.

    Second differences, against the usual ones of all and of those near by.
    """
    lost = np.zeros(len(values), bool)
    if len(values) < SETTINGS.near:
        return lost
    bend = np.abs(values[1:-1] - (values[:-2] + values[2:]) / 2)
    near = median_filter(bend, size=(SETTINGS.near, 1))
    least = SETTINGS.spike * np.maximum(np.median(bend, axis=0), noise)
    far = np.any(bend > np.maximum(least, SETTINGS.spike_near * near), axis=1)
    for first, past in runs(binary_closing(far, np.ones(3))):
        if past - first <= SETTINGS.burst_near:
            lost[first + 1 : past + 1] = True
    return lost


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
    # in rough motion all are far; one alone has the next far below it
    second = np.partition(size, -2, axis=1)[:, -2:-1]
    far = size > np.maximum(SETTINGS.spike, SETTINGS.only * second)
    spikes[2:-2] = far[1:-1] & alone
    for k in np.flatnonzero(far.any(axis=0)):
        for first, past in runs(binary_closing(far[:, k], np.ones(3))):
            if SETTINGS.burst[0] <= past - first <= SETTINGS.burst[1]:
                bursts[first + 1 : past + 1, k] = True
    return spikes & ~bursts, bursts


def frozen(values, turning) -> np.ndarray:
    """(T, K) bool: readings that one triad repeats again and again while the array turns.

    None where all of several do so at once, or where they are many: that is another check's.
    """
    same, out = np.zeros(values.shape[:2], bool), np.zeros(values.shape[:2], bool)
    same[1:] = np.all(values[1:] == values[:-1], axis=2)
    same &= ~same.all(axis=1, keepdims=True) | (same.shape[1] == 1)
    for k in np.flatnonzero(same.any(axis=0)):
        for first, past in runs(same[:, k]):  # the one that is repeated may be no reading, too
            out[first - 1 : past, k] |= turning[first:past].sum() >= RECORDING.frozen
    return out & (out.sum() < SETTINGS.rare * len(values))
