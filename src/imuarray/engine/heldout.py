"""Log scores on blocks of time that a model was not trained on."""

from typing import NamedTuple

import numpy as np

from imuarray.engine.fit import Fit
from imuarray.engine.settings import SETTINGS


class Scores(NamedTuple):
    """Held-out log scores of the blocks, nats, and how many samples each has."""

    nats: np.ndarray
    samples: np.ndarray

    @property
    def per_sample(self) -> float:
        """Nats per sample."""
        return float(self.nats.sum() / self.samples.sum())


def blocks_of(samples: int, number=SETTINGS.blocks) -> list[slice]:
    """Consecutive blocks of time, as equal as whole samples allow."""
    edges = np.linspace(0, samples, number + 1).astype(int)
    return [slice(first, last) for first, last in zip(edges[:-1], edges[1:], strict=True)]


def normal_blocks(fit: Fit, active) -> list[tuple[np.ndarray, np.ndarray]]:
    """(information (n, n), score (n,)) of the n ``active`` (N, m) parameters from each block."""
    return [fit.normal(active, block) for block in blocks_of(len(fit.residual))]


def log_scores(fit: Fit, ridge) -> Scores:
    """The log density of each block's readings, parameters trained on the other blocks.

    The motion is integrated out sample by sample, with a flat prior where it has none (so only
    differences between models of the same readings mean anything); noise sds are those of the
    whole recording. Training without a block is one Gauss-Newton step from the optimum.
    ``ridge`` (n, n) prior precision of the active parameters.
    """
    readings = fit.readings
    blocks = blocks_of(len(fit.residual))
    parts = normal_blocks(fit, fit.active)
    fixed = np.where(readings.keep, np.repeat(np.log(readings.sd), 3, axis=1), 0.0)
    constant = fixed.sum(axis=(1, 2)) + fit.log_volume / 2
    constant += np.log(2 * np.pi) / 2 * (readings.keep.sum(axis=(1, 2)) - 9)
    if fit.state.rough_prior is not None:
        constant += np.log(fit.state.rough_prior.sd).sum(axis=1)
    if fit.state.turning is not None:
        constant += fit.state.turning.log_norm
    better = trained_elsewhere(parts, ridge)
    nats = [
        -np.sum(fit.misfits[part]) / 2 - constant[part].sum() + more
        for part, more in zip(blocks, better, strict=True)
    ]
    return Scores(np.array(nats), np.array([part.stop - part.start for part in blocks]))


def trained_elsewhere(parts, ridge) -> np.ndarray:
    """(B,) what blocks' log likelihoods gain (or lose) by parameters trained on the other blocks.

    ``parts`` [(information (n, n), score (n,))] of the blocks at the optimum of all; one
    Gauss-Newton step from there.
    """
    information = sum(inner for inner, _ in parts) + ridge
    # at the optimum score and prior balance: without the block, minus its score is left
    return np.array([
        _predicted(np.linalg.solve(information - inner, -slope), inner, slope)
        if len(slope) else 0.0
        for inner, slope in parts
    ])  # fmt: skip


def gain(one: Scores, other: Scores) -> tuple[float, float]:
    """(nats per sample that ``other`` has over ``one``, standard error between blocks)."""
    difference, samples = other.nats - one.nats, one.samples.sum()
    error = np.std(difference, ddof=1) * np.sqrt(len(difference))
    return float(difference.sum() / samples), float(error / samples)


def gain_of(parts, ridge, values, freed, spare=None) -> tuple[float, float]:
    """Nats that ``freed`` (n,) bool parameters gain on held-out blocks over zero, and their error.

    ``parts`` [(information (n, n), score (n,))] of the blocks at ``values`` (n,), ``ridge`` (n, n)
    the prior's precision. Both rivals are trained without the block, the freed parameters shrunk
    as their score in the training blocks deserves (positive-part James-Stein, of as many as data
    and not the prior determine). ``spare`` (n,) bool: parameters that both rivals have beside.
    """
    information, score = sum(p[0] for p in parts), sum(p[1] for p in parts)
    spare = np.zeros(len(freed), bool) if spare is None else spare
    prior = ridge[np.ix_(freed & ~spare, freed & ~spare)]
    freed, values, gains = freed[~spare], values[~spare], []
    for part in parts:
        trained = information - part[0] + ridge, score - part[1]
        trained, (block, slope) = _eliminated(trained, part, spare)
        without = _solve(*trained, values, freed, 0.0)
        full = _solve(*trained, values, freed, None)
        found = (full + values)[freed]
        effective = _schur(trained[0], freed)
        statistic = found @ effective @ found
        determined = freed.sum() - np.trace(np.linalg.solve(effective, prior))
        shrink = max(0.0, 1 - determined / max(statistic, 1e-300))
        kept = _solve(*trained, values, freed, shrink * found)
        gains.append(_predicted(kept, block, slope) - _predicted(without, block, slope))
    return float(np.sum(gains)), float(np.std(gains, ddof=1) * np.sqrt(len(gains)))


def _eliminated(trained, part, spare):
    """Training and held-out block for the rest, the ``spare`` parameters where training puts them.

    Up to a constant of the block's.
    """
    if not spare.any():
        return trained, part
    (inner, score), (block, slope), rest = trained, part, ~spare
    cross, held = inner[np.ix_(rest, spare)], block[np.ix_(spare, spare)]
    solved = np.linalg.solve(inner[np.ix_(spare, spare)], np.column_stack([score[spare], cross.T]))
    at, back = solved[:, 0], solved[:, 1:]
    left = block[np.ix_(rest, spare)] - back.T @ held
    reduced = inner[np.ix_(rest, rest)] - cross @ back, score[rest] - cross @ at
    seen = block[np.ix_(rest, rest)] - left @ back - back.T @ block[np.ix_(spare, rest)]
    return reduced, (seen, slope[rest] - back.T @ slope[spare] - left @ at)


def _schur(information, chosen):
    """Information of the chosen given the rest."""
    rest = ~chosen
    inner = np.linalg.solve(information[np.ix_(rest, rest)], information[np.ix_(rest, chosen)])
    return information[np.ix_(chosen, chosen)] - information[np.ix_(chosen, rest)] @ inner


def _solve(information, score, values, freed, target):
    """Steps of all parameters where the freed ones go to ``target``, or anywhere if None."""
    if target is None:
        return np.linalg.solve(information, score)
    step = np.zeros(len(score))
    step[freed] = target - values[freed]
    rest = ~freed
    right = score[rest] - information[np.ix_(rest, freed)] @ step[freed]
    step[rest] = np.linalg.solve(information[np.ix_(rest, rest)], right)
    return step


def _predicted(step, block, slope) -> float:
    """Log likelihood of a block after a step, against before, quadratic."""
    return float(slope @ step - step @ block @ step / 2)
