"""Log scores on blocks of time that a model was not trained on."""

from typing import NamedTuple

import numpy as np
from scipy.special import gammaln

from imuarray.engine.linearise import State
from imuarray.engine.readings import Readings, by_triad
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


def scores_of(nats, parts, ridge) -> Scores:
    """The log density of each block's readings, parameters trained on the other blocks.

    ``nats`` (T,) of the samples at the optimum of all, ``parts`` and ``ridge`` as for
    `trained_elsewhere`. Noise sds are those of the whole recording.
    """
    blocks = blocks_of(len(nats))
    each = np.array([nats[block].sum() for block in blocks])
    samples = np.array([block.stop - block.start for block in blocks])
    return Scores(each + trained_elsewhere(parts, ridge), samples)


def log_densities(readings: Readings, state: State, residual, misfits, log_volume, freedoms):
    """(T,) nats of each sample's readings, its motion integrated out (Laplace's approximation).

    ``residual`` (T, N, 6), ``misfits`` and ``log_volume`` (T,) as `Eliminated` has them;
    ``freedoms`` (2,) of Student's t, of accelerometers and gyroscopes, infinite for normal noise.
    Omega, omega_dot and s have a flat prior, so differences between models of the same readings
    alone mean anything. The curvature is that of the weights in use, more than t's own: a sample's
    density is stated too small rather than too large.
    """
    number, squares = by_triad(readings.keep), by_triad(residual**2)
    weighted = squares.sum(axis=(1, 2))
    if readings.trust is not None:
        squares = squares / readings.trust**2
    nats = np.zeros(len(weighted))
    for kind, nu in enumerate(freedoms):
        n = number[..., kind]
        density = log_t(squares[..., kind], n, nu)
        nats += np.sum(density - n * np.log(readings.sd[:, kind]), axis=1)
    nats += state.motion.shape[1] / 2 * np.log(2 * np.pi) - log_volume / 2
    if state.rough_prior is not None:
        sd = state.rough_prior.sd
        nats -= np.sum(np.log(sd), axis=1) + sd.shape[1] / 2 * np.log(2 * np.pi)
    if state.turning is not None:
        nats -= state.turning.log_norm
    return nats - (misfits - weighted) / 2


def log_t(squares, number, freedom):
    """Log density of ``number`` readings together at their sum of ``squares``, in units of the sd.

    Student's t's of a finite ``freedom``, or a normal one's.
    """
    if np.isinf(freedom):
        return -number / 2 * np.log(2 * np.pi) - squares / 2
    scale = gammaln((freedom + number) / 2) - gammaln(freedom / 2)
    scale = scale - number / 2 * np.log(freedom * np.pi)
    return scale - (freedom + number) / 2 * np.log1p(squares / freedom)


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
    nats, error = summed(difference)
    return nats / samples, error / samples


def summed(gains) -> tuple[float, float]:
    """Nats of all blocks together, (B,) each, and their standard error by how blocks differ."""
    return float(np.sum(gains)), float(np.std(gains, ddof=1) * np.sqrt(len(gains)))


def gains_of(parts, prior, values, freed, nuisance=None, rival=None) -> np.ndarray:
    """Nats (B,) that ``freed`` (n,) bool parameters gain on each held-out block over zero.

    ``parts`` [(information (n, n), score (n,))] of the blocks at ``values`` (n,), ``prior`` its
    precision (n, n) and means (n,). Both rivals are trained without the block, the freed parameters
    shrunk as their score in the training blocks deserves (positive-part James-Stein, of as many as
    data and not the prior determine). ``nuisance`` (n,) bool: parameters that both rivals have.
    ``rival``, without nuisance ones: the precision (n, n) where the freed are zero, which pins no
    mean that only all have, if not the same.
    """
    information, score = sum(p[0] for p in parts), sum(p[1] for p in parts)
    nuisance = np.zeros(len(freed), bool) if nuisance is None else nuisance
    ridge, off = prior[0], values - prior[1]
    rival = ridge if rival is None else rival
    freed, values, gains = freed[~nuisance], values[~nuisance], []
    # a pinned mean holds those of some IMUs no more than the other IMUs let it
    own = _schur(ridge[np.ix_(~nuisance, ~nuisance)], freed)
    for part in parts:
        data, left = information - part[0], score - part[1]
        trained, (block, slope) = _eliminated((data + ridge, left - ridge @ off), part, nuisance)
        other = trained if nuisance.any() else (data + rival, left - rival @ off)
        without = _solve(*other, values, freed, 0.0)
        full = np.linalg.solve(*trained)
        found = (full + values)[freed]
        effective = _schur(trained[0], freed)
        statistic = found @ effective @ found
        determined = freed.sum() - np.trace(np.linalg.solve(effective, own))
        shrink = max(0.0, 1 - determined / max(statistic, 1e-300))
        kept = _solve(*trained, values, freed, shrink * found)
        gains.append(_predicted(kept, block, slope) - _predicted(without, block, slope))
    return np.array(gains)


def _eliminated(trained, part, nuisance):
    """Training and held-out block of the rest, ``nuisance`` parameters where training puts them.

    Up to a constant of the block's.
    """
    if not nuisance.any():
        return trained, part
    (inner, score), (block, slope), rest, out = trained, part, ~nuisance, nuisance
    cross, held = inner[np.ix_(rest, out)], block[np.ix_(out, out)]
    solved = np.linalg.solve(inner[np.ix_(out, out)], np.column_stack([score[out], cross.T]))
    at, back = solved[:, 0], solved[:, 1:]
    left = block[np.ix_(rest, out)] - back.T @ held
    reduced = inner[np.ix_(rest, rest)] - cross @ back, score[rest] - cross @ at
    reduced_block = block[np.ix_(rest, rest)] - left @ back - back.T @ block[np.ix_(out, rest)]
    return reduced, (reduced_block, slope[rest] - back.T @ slope[out] - left @ at)


def _schur(information, chosen):
    """Information of the chosen given the rest."""
    rest = ~chosen
    inner = np.linalg.solve(information[np.ix_(rest, rest)], information[np.ix_(rest, chosen)])
    return information[np.ix_(chosen, chosen)] - information[np.ix_(chosen, rest)] @ inner


def _solve(information, score, values, freed, target):
    """Steps of all parameters where the freed ones go to ``target``."""
    step = np.zeros(len(score))
    step[freed] = target - values[freed]
    rest = ~freed
    right = score[rest] - information[np.ix_(rest, freed)] @ step[freed]
    step[rest] = np.linalg.solve(information[np.ix_(rest, rest)], right)
    return step


def _predicted(step, block, slope) -> float:
    """Log likelihood of a block after a step, against before, quadratic."""
    return float(slope @ step - step @ block @ step / 2)
