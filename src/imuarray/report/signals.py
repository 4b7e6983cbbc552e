"""What an adopted cause explains, reading by reading, and beside its own physical cause.

A cause's signal is its derivative times its parameters, with the motion and all other parameters
refitted: what would be back in the residual without it. It is an added-variable plot's abscissa;
residual and signal together are its ordinate, so that points on the line are explained.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from imuarray.engine.fit import Fit, flat_parameters
from imuarray.linear import scaled_inverse

if TYPE_CHECKING:
    from imuarray.diagnosis.document import Diagnosis

BINS = 14


class Signal(NamedTuple):
    """A cause as a fit sees it; arrays are (T, N, 6) in units of the noise sd."""

    made: Fit
    effect: str
    imus: tuple[int, ...]
    mask: np.ndarray  # (N, m) bool, its free parameters
    flat: np.ndarray  # (N, m) values of all parameters
    sds: np.ndarray  # (N, m)
    explained: np.ndarray  # what it explains that nothing else could
    total: np.ndarray  # the same and the residual, NaN where readings are left out
    width: np.ndarray  # (N, 6) sd of a residual


def signal_of(diagnosis: Diagnosis, cause) -> Signal:
    """The `Signal` of an adopted cause (effect, imus) in the extended model."""
    made = diagnosis.extended.fit
    columns, flat = made.columns, flat_parameters(made.columns, made.state)
    mask = np.zeros_like(made.active)
    mask[np.ix_(list(cause.imus), columns.of(cause.effect))] = True
    mask &= made.active
    left = made.less_motion(made.along(np.where(mask, flat, 0.0)))
    others = made.active & ~mask
    information, _ = made.normal(others)
    score = np.array(
        [np.sum(made.whitened[:, k, :, m] * left[:, k]) for k, m in np.argwhere(others)]
    )
    ridge = 1.0 / np.broadcast_to(columns.prior_sd, others.shape)[others] ** 2
    step = np.zeros(mask.shape)
    step[others] = scaled_inverse(information + np.diag(ridge)) @ score
    explained = left - made.less_motion(made.along(step))
    total = np.where(made.readings.keep, made.residual + explained, np.nan)
    # correlated neighbours are fewer independent ones
    rho = np.clip(diagnosis.found.search.noise.correlation, 0.0, 0.99)
    inflated = np.repeat(np.sqrt((1 + rho) / (1 - rho)), 3, axis=1)
    width = np.sqrt(np.maximum(1.0 - made.leverage, 1e-6)).mean(axis=0) * inflated
    return Signal(
        made, cause.effect, tuple(cause.imus), mask, flat, diagnosis.extended.sds, explained,
        total, width,
    )  # fmt: skip


def binned(x, total, explained, width, bins=BINS) -> pd.DataFrame:
    """Means over bins of x: x, y, se, model; NaN in total left out.

    Bins share the sum of the distances from the median, and so reach where a slope is determined.
    """
    kept = np.isfinite(total) & np.isfinite(x)
    x, total, explained = x[kept], total[kept], explained[kept]
    width = np.broadcast_to(width, kept.shape)[kept]
    if not len(x) or np.ptp(x) == 0:
        return pd.DataFrame()
    order = np.argsort(x)
    far = np.abs(x[order] - np.median(x))
    shares = np.cumsum(far + far.mean())
    edges = x[order][np.searchsorted(shares, shares[-1] * np.linspace(0, 1, bins + 1)[1:-1])]
    edges = np.unique([x[order[0]], *edges, x[order[-1]]])
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    counts = np.bincount(place, minlength=len(edges) - 1)
    some = counts > 0
    means = [
        np.bincount(place, value, len(counts))[some] / counts[some]
        for value in (x, total, explained, width**2)
    ]
    return pd.DataFrame(
        {"x": means[0], "y": means[1], "se": np.sqrt(means[3] / counts[some]), "model": means[2]}
    )
