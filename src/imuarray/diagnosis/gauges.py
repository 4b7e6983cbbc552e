"""Directions that no recording can tell: what the model's own freedom takes up is pinned.

A common scale of all gyroscopes is a dilation of the array, for instance. Left to their priors
such directions wander as soon as anything else is misfitted; pinned they stay where the effect
has no common part, and the reported sds say what the priors leave open.
"""

from __future__ import annotations

import numpy as np

from imuarray.diagnosis.parameters import Columns

STIFF = 1e-3  # of a parameter's prior sd: the sd that a pinned mean keeps
OFFSET = 3  # which of a clock's parameters
COMMON = {  # effects whose mean over all IMUs is a gauge, and over which of their columns
    "gyroscope_scale": "together", "accelerometer_scale": "together", "sensor_delay": "together",
    "sensor_clock": "offset", "size_effect": "each",
}  # fmt: skip


def prior_precision(columns: Columns, active) -> np.ndarray:
    """(n, n) precision of the active parameters (N, m): their priors, and the pinned gauges."""
    sds = np.broadcast_to(columns.prior_sd, active.shape)[active]
    precision = np.diag(1.0 / sds**2)
    for mask in gauge_masks(columns, active):
        along = mask[active].astype(float)
        along /= along.sum() * STIFF * sds[along > 0].mean()
        precision += np.outer(along, along)
    return precision


def gauge_masks(columns: Columns, active) -> list[np.ndarray]:
    """(N, m) bool of the parameters whose mean is a gauge, where all of them are active."""
    found = []
    for effect, how in COMMON.items():
        if effect not in columns.names:
            continue
        own = columns.of(effect)
        if how == "offset":
            own = own[OFFSET : OFFSET + 1]
        for chosen in own[:, None] if how == "each" else [own]:
            mask = np.zeros_like(active)
            mask[:, chosen] = columns.owner[:, chosen]
            found.append(mask)
    if "size_effect" in columns.names:
        found += _centres(columns, active)
    return [mask for mask in found if mask.any() and active[mask].all()]


def _centres(columns: Columns, active) -> list[np.ndarray]:
    """The mean place of a triad's three axes is its position."""
    own = columns.of("size_effect").reshape(3, 3)
    masks = []
    for imu in np.flatnonzero(active[:, own[0, 0]]):
        for coordinate in range(3):
            mask = np.zeros_like(active)
            mask[imu, own[:, coordinate]] = True
            masks.append(mask)
    return masks
