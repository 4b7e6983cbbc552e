"""Simulation-based calibration: is the truth where the posterior says, as often as it says?

Positions are drawn from their prior and motion from its own, measurements from both; a sampler
that is right puts the truth at a uniform quantile of its posterior.
"""

import numpy as np
import pandas as pd
from scipy import stats

from imuarray.studies.batches import run_batches
from imuarray.studies.pit import METHODS, names_of
from imuarray.studies.truths import Setting, replicate

SHARES = (0.5, 0.9, 0.95)
REFERENCE = "NUTS"  # whose PIT values the others' are compared with, replicate by replicate
ML_MORE = 25  # times as many truths as for samplers, as they cost so little
MIXED = 50  # independent draws of a posterior, of 199: fewer are a slow chain
WHOLE = ("size", "misfit")  # quantities that hang on all coordinates


def pit_values(
    setting: Setting, replicates, threads: int = 1, methods=tuple(METHODS)
) -> pd.DataFrame:
    """A row for each method, replicate and quantity; ``pit`` is uniform if all is right.

    ``replicates``: their numbers; what one gives does not depend on the others.
    """
    made = run_batches(
        lambda number: replicate(setting, number), replicates, threads, True, "replicates"
    )
    names, numbers, frames = np.array(names_of(setting)), np.array(replicates), []
    for method in methods:
        found, independent = METHODS[method](setting, made, threads)
        rows, columns = np.indices(found.shape)
        frames.append(
            pd.DataFrame(
                {"setting": setting.name, "method": method, "samples": setting.samples,
                 "replicate": numbers[rows.ravel()], "quantity": names[columns.ravel()],
                 "pit": found.ravel(), "independent": independent[rows.ravel()]}
            )
        )  # fmt: skip
    return pd.concat(frames, ignore_index=True)


def coverage(table: pd.DataFrame) -> pd.DataFrame:
    """How often central intervals hold the truth, and whether PIT values are uniform.

    A row for each setting, method and T: ``covered_50`` and so on of the coordinates with standard
    errors over replicates (coordinates of one replicate are not independent); ``shift_z`` and
    ``width_z``, the mean normal score and the mean squared one less 1 over all coordinates of a
    replicate, ``size_z`` and ``misfit_z``, the mean scores of those, in standard errors; and
    ``none``, replicates without intervals; ``slow``, chains with few independent draws; ``apart``,
    how far from NUTS' a replicate's PIT values are at most (rms; 0.05 is their own noise); and
    ``p``, the smallest Kolmogorov-Smirnov p-value of a quantity times their number.
    """
    rows = []
    keys = ["setting", "method", "samples"]
    for key, part in table.groupby(keys, sort=False):
        grid = part.pivot(index="replicate", columns="quantity", values="pit")
        grid = grid.dropna(axis="columns", how="all").dropna()
        own = grid.drop(columns=[name for name in WHOLE if name in grid]).to_numpy()
        mixed = part.groupby("replicate").independent.first()
        row = dict(zip(keys, key, strict=True)) | {
            "replicates": len(grid), "none": part.replicate.nunique() - len(grid),
            "slow": int(np.sum(mixed < MIXED)), "apart": _apart(table, key),
        }  # fmt: skip
        for share in SHARES:
            inside = (np.abs(own - 0.5) < share / 2).mean(axis=1)
            row[f"covered_{100 * share:.0f}"] = inside.mean()
            row[f"se_{100 * share:.0f}"] = inside.std(ddof=1) / np.sqrt(len(grid))
        scores = stats.norm.ppf(own)
        row |= {"shift_z": _mean_z(scores.mean(axis=1)),
                "width_z": _mean_z(np.mean(scores**2, axis=1) - 1)}  # fmt: skip
        for name in WHOLE:
            row[f"{name}_z"] = _mean_z(stats.norm.ppf(grid[name])) if name in grid else np.nan
        smallest = min(stats.kstest(grid[name], "uniform").pvalue for name in grid)
        rows.append({**row, "p": min(1.0, smallest * grid.shape[1])})
    return pd.DataFrame(rows)


def _apart(table: pd.DataFrame, key) -> float:
    """Largest rms difference of a replicate's coordinates' PIT values from `REFERENCE`'s."""
    setting, method, samples = key
    same = table[(table.setting == setting) & (table.samples == samples)]
    same = same[~same.quantity.isin(WHOLE)]
    places = ["replicate", "quantity"]
    own, other = (same[same.method == name].set_index(places).pit for name in (method, REFERENCE))
    square = ((own - other) ** 2).dropna().groupby("replicate").mean()
    return float(np.sqrt(square.max())) if method != REFERENCE and len(square) else np.nan


def _mean_z(scores) -> float:
    """Mean of one score a replicate (R,) over its standard error."""
    return float(np.mean(scores) / (np.std(scores, ddof=1) / np.sqrt(len(scores))))
