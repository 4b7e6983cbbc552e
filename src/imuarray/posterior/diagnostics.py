"""Judging paired chains: burn-in, R-hat, effective sample size, agreement, a summary."""

import warnings

import numpy as np
import pandas as pd

from imuarray.posterior.chains import Chains
from imuarray.posterior.settings import SETTINGS

QUANTILES = (0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975)


def _arviz(name, draws, **options) -> np.ndarray:
    """An ArviZ statistic per parameter of draws (chains, draws, size): (size,)."""
    import arviz

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dataset = arviz.convert_to_dataset({"x": np.asarray(draws)})
        return np.atleast_1d(getattr(arviz, name)(dataset, **options)["x"].to_numpy())


def rhat(draws) -> np.ndarray:
    """Rank-normalised split R-hat per parameter, (size,), of draws (chains, draws, size)."""
    return _arviz("rhat", draws, method="rank")


def ess(draws) -> np.ndarray:
    """Bulk effective sample size per parameter, (size,), over all chains together."""
    return _arviz("ess", draws, method="bulk")


def pareto_k(log_weights) -> float:
    """Shape of the tail of importance weights: their moments up to 1 / k exist; inf if none do."""
    import arviz

    if not np.all(np.isfinite(log_weights)):
        return np.inf
    return float(arviz.psislw(np.ravel(log_weights))[1])


def agreement(draws) -> np.ndarray:
    """|difference of the two halves of the chains' means| in its Monte Carlo sd, (size,).

    The split comparison: chain 1 against chain 2, each with its own effective size.
    """
    means = draws.mean(axis=1)
    sizes = np.stack([ess(chain[None]) for chain in draws])
    variances = (draws.var(axis=1, ddof=1) / np.maximum(sizes, 1.0))[:2].sum(axis=0)
    return np.abs(means[0] - means[1]) / np.sqrt(variances)


def find_burn_in(draws, log_target, threshold: float = 1.05, candidates: int = 12):
    """(stored draws to discard, the table that says so), by cross-reference (2021, section III-C).

    No burn-in ends before each chain's log target has entered the range of the other
    chain's second half. For candidates from there to half of the chain, and for none: the
    largest R-hat over all parameters and the log target of what remains, and the smallest
    effective sample size, which a transient left in the chains lowers. The burn-in is the
    candidate with the largest such size among those below ``threshold``; where none is
    below, the one with the smallest R-hat.
    """
    length = draws.shape[1]
    first = min(_entry(log_target), length // 2)
    cuts = np.unique([0, *np.linspace(first, length // 2, candidates - 1).astype(int)])
    joined = np.concatenate([draws, log_target[..., None]], axis=2)
    worst = np.array([rhat(joined[:, cut:]) for cut in cuts])
    table = pd.DataFrame({
        "burn_in": cuts, "rhat_max": worst.max(axis=1), "rhat_log_target": worst[:, -1],
        "ess_min": [ess(joined[:, cut:]).min() for cut in cuts],
    })  # fmt: skip
    allowed = table[table.burn_in >= first]
    passing = allowed[allowed.rhat_max < threshold]
    enough = passing[passing.ess_min >= (1 - SETTINGS.burn_in_noise) * passing.ess_min.max()]
    best = enough.index[0] if len(enough) else allowed.rhat_max.idxmin()
    return int(table.burn_in[best]), table


def _entry(log_target) -> int:
    """First stored draw at which every chain has been inside the others' late range."""
    length = log_target.shape[1]
    entries = []
    for chain, values in enumerate(log_target):
        others = np.delete(log_target, chain, axis=0) if len(log_target) > 1 else log_target
        floor = np.quantile(others[:, length // 2 :], 0.01)
        inside = values >= floor
        entries.append(int(inside.argmax()) if inside.any() else length)
    return max(entries)


def summarise(chains: Chains, labels, threshold: float, truth=None):
    """(verdict dict, per-coordinate table, burn-in table) of paired chains.

    ``labels`` of the estimated triads; ``truth`` (A - 1, 3) m where known.
    """
    burn_in, tried = find_burn_in(chains.draws, chains.log_target, threshold)
    left = chains.draws[:, burn_in:]
    # over every sampled parameter, effects included, and the log target
    every = np.concatenate([left, chains.log_target[:, burn_in:, None]], axis=2)
    worst, sizes = rhat(every), ess(every[..., :-1])
    table = _coordinates(left, labels, truth, worst, sizes)
    verdict = {
        "burn_in_steps": burn_in * chains.thin,
        "burn_in_draws": burn_in,
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
    return verdict, table, tried.assign(burn_in_steps=tried.burn_in * chains.thin)


def _coordinates(left, labels, truth, rhats, sizes) -> pd.DataFrame:
    names = [(label, axis) for label in labels for axis in "xyz"]
    flat = left[..., : len(names)].reshape(-1, len(names))
    table = pd.DataFrame(names, columns=["accelerometer", "axis"])
    table["mean_m"], table["sd_m"] = flat.mean(axis=0), flat.std(axis=0, ddof=1)
    for level, values in zip(QUANTILES, np.quantile(flat, QUANTILES, axis=0), strict=True):
        table[f"q{level:g}_m"] = values
    table["rhat"], table["ess"] = rhats[: len(names)], sizes[: len(names)]
    table["split_z"] = agreement(left[..., : len(names)])
    table["mcse_mean_m"] = table.sd_m / np.sqrt(table.ess)
    if truth is not None:
        table["truth_m"] = np.ravel(truth)
    return table
