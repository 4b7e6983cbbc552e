"""Rails of a chip's own axes, seen through the maps that a correction has taken out."""

from dataclasses import replace

import numpy as np
import xarray as xr

from imuarray.firstorder.settings import SETTINGS
from imuarray.recording import Recording


def rails_shown(inverse, rails) -> np.ndarray:
    """Where rails (T, K, 3) show when maps with an inverse (K, 3, 3) are taken out."""
    near = np.abs(inverse) > SETTINGS.coupled
    return np.einsum("kij,tkj->tki", near.astype(np.int8), rails.astype(np.int8)) > 0


def less_leak(
    recording: Recording, correction: xr.Dataset, rate, saturated
) -> tuple[Recording, np.ndarray]:
    """The recording as if axes at their rail had read the ``rate`` (T, 3), NaN if unknown.

    And (T, 3, 3), by how much the mean of the gyroscopes changes with the rate of such axes.
    """
    inverse, offset = (correction[f"gyroscope_{x}"].values for x in ("inverse", "offset"))
    maps = np.linalg.inv(inverse)
    read, true = (
        np.einsum("kij,tkj->tki", maps, x) + offset
        for x in (recording.angular_rate, np.asarray(rate)[:, None])
    )
    at_rail = rails_shown(np.swapaxes(inverse, 1, 2), saturated)  # back to the chip's own axes
    short = np.where(at_rail & np.isfinite(true), true - read, 0.0)
    free = ~saturated
    mended = recording.angular_rate + free * np.einsum("kij,tkj->tki", inverse, short)
    mixed = free[..., None] * inverse * at_rail[:, :, None]
    leak = np.einsum("tkij,kjl->til", mixed, maps) / np.maximum(free.sum(axis=1), 1)[..., None]
    return replace(recording, angular_rate=mended), leak


def less_leak_by_others(recording: Recording) -> Recording:
    """`less_leak` where gyroscopes without an axis at its rail say what the rate was."""
    correction = recording.correction
    if correction is None or not recording.at_rail("gyroscope").any():
        return recording
    recording = recording.in_memory()
    saturated = recording.saturated_gyroscopes()
    free = ~saturated.any(axis=2)
    count = free.sum(axis=1)[:, None]
    total = np.einsum("tk,tki->ti", free, recording.angular_rate)
    rate = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return less_leak(recording, correction, rate, saturated)[0]
