"""A posterior in numbers: per coordinate, and the chains' verdict."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.posterior import diagnostics
from imuarray.posterior.chains import Chains

QUANTILES = (0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975)


def summarise(chains: Chains, labels, threshold: float, truth=None):
    """(verdict dict, per-coordinate table, burn-in table) of paired chains.

    ``labels`` of the estimated triads; ``truth`` (A - 1, 3) m where known.
    """
    burn_in = diagnostics.find_burn_in(chains.draws, chains.log_target, threshold)
    left = chains.draws[:, burn_in.draws :]
    # over every sampled parameter, effects included, and the log target
    every = np.concatenate([left, chains.log_target[:, burn_in.draws :, None]], axis=2)
    worst, sizes = diagnostics.rhat(every), diagnostics.ess(every[..., :-1])
    table = _coordinates(left, labels, truth, worst, sizes)
    verdict = {
        "burn_in_steps": burn_in.draws * chains.thin,
        "burn_in_draws": burn_in.draws,
        "converged": bool(worst.max() < threshold),
        "rhat_max": float(worst.max()),
        "rhat_threshold": threshold,
        "ess_min": float(sizes.min()),
        "ess_median": float(np.median(sizes)),
        "split_z_max": float(table.split_z.max()),
        "acceptance": chains.acceptance.tolist(),
        "steps": chains.steps,
        "thin": chains.thin,
        "step_length_m": chains.step,
        "chains": chains.draws.shape[0],
    }
    return verdict, table, burn_in.table.assign(burn_in_steps=burn_in.table.burn_in * chains.thin)


def _coordinates(left, labels, truth, rhats, sizes) -> pd.DataFrame:
    names = [(label, axis) for label in labels for axis in "xyz"]
    flat = left[..., : len(names)].reshape(-1, len(names))
    table = pd.DataFrame(names, columns=["accelerometer", "axis"])
    table["mean_m"], table["sd_m"] = flat.mean(axis=0), flat.std(axis=0, ddof=1)
    for level, values in zip(QUANTILES, np.quantile(flat, QUANTILES, axis=0), strict=True):
        table[f"q{level:g}_m"] = values
    table["rhat"], table["ess"] = rhats[: len(names)], sizes[: len(names)]
    table["split_z"] = diagnostics.agreement(left[..., : len(names)])
    table["mcse_mean_m"] = table.sd_m / np.sqrt(table.ess)
    if truth is not None:
        table["truth_m"] = np.ravel(truth)
    return table
