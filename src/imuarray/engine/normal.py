"""Normal equations of chosen parameters, each sample's motion eliminated, chunk by chunk."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from imuarray.engine.linearise import CHUNK, THREADS
from imuarray.engine.settings import SETTINGS


def summed_normal(linearised, chosen, part=slice(None)):
    """`normal` of many samples, chunk by chunk: what is made of each is small."""
    first, last, _ = part.indices(len(linearised.residual))

    def over(starts):
        information, score = np.zeros((chosen.sum(), chosen.sum())), np.zeros(chosen.sum())
        for start in starts:
            inner, slope = normal(linearised, chosen, slice(start, min(start + CHUNK, last)))
            information += inner
            score += slope
        return information, score

    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(over, np.array_split(np.arange(first, last, CHUNK), THREADS)))
    return sum(inner for inner, _ in found), sum(slope for _, slope in found)


def normal(linearised, chosen, part):
    """Information (n, n) and score (n,) of the chosen parameters, motion projected out.

    ``linearised``: an `Eliminated` or a `Fit`.
    """
    projected, blocks = projected_columns(linearised.whitened[part], linearised.basis[part], chosen)
    prior_slope = np.empty((*linearised.innovation[part].shape, projected.shape[2]))
    for imu, places, _ in blocks:
        prior_slope[..., places] = linearised.prior_slope[part, :, imu][..., chosen[imu]]
    if prior_slope.shape[1]:
        projected += linearised.expected[part] @ prior_slope
    flat, prior = (x.reshape(x.shape[0] * x.shape[1], x.shape[2]) for x in (projected, prior_slope))
    information = prior.T @ prior - flat.T @ flat
    for _, places, block in blocks:
        own = block.reshape(-1, block.shape[-1])
        information[places, places] += own.T @ own
    return information, score_of(linearised, chosen, part)


def score_of(linearised, chosen, part=slice(None)):
    """Score (n,) of the chosen parameters; the residual is orthogonal to the motion already."""
    score = np.einsum("tkim,tki->km", linearised.whitened[part], linearised.residual[part])
    score += np.einsum("tdkm,td->km", linearised.prior_slope[part], linearised.innovation[part])
    return score[chosen]


def projected_columns(whitened, basis, chosen):
    """The n ``chosen`` (N, m) bool in the motion's basis: (T, D, n), and [(imu, places, block)].

    A block is an IMU's own part of the derivatives ``whitened`` (T, N, 6, m), (T, 6, n_imu).
    """
    counts = chosen.sum(axis=1)
    projected, blocks = np.empty((len(basis), basis.shape[2], counts.sum())), []
    for imu in np.flatnonzero(counts):
        block = whitened[:, imu]
        if not chosen[imu].all():
            block = block[..., chosen[imu]]
        places = slice(counts[:imu].sum(), counts[: imu + 1].sum())
        own = np.swapaxes(basis[:, 6 * imu : 6 * imu + 6], 1, 2)
        np.matmul(own, block, out=projected[..., places])
        blocks.append((imu, places, block))
    return projected, blocks


def uncorrelated(residual, basis, keep) -> np.ndarray:
    """Triads' residuals (..., 3) as three uncorrelated ones of unit variance, NaN where left out.

    What the motion takes up, by its basis (..., 3, D), correlates them: on a small array the sum of
    their squares would have tails where the noise has none. NaN, too, where it leaves hardly
    anything; ``keep`` (..., 3) bool.
    """
    out, factor = np.empty_like(residual), np.zeros((*residual.shape, 3))
    clean, free = keep.copy(), np.ones(residual.shape, bool)
    for i in range(3):  # Cholesky's factor and the forward substitution, all samples at once
        for j in range(i):
            known = np.sum(factor[..., i, :j] * factor[..., j, :j], axis=-1)
            known += np.einsum("...d,...d->...", basis[..., i, :], basis[..., j, :])
            factor[..., i, j] = np.where(free[..., j], -known / factor[..., j, j], 0.0)
        own = 1.0 - np.einsum("...d,...d->...", basis[..., i, :], basis[..., i, :])
        own = own - np.sum(factor[..., i, :i] ** 2, axis=-1)
        clear = free[..., i] = own > SETTINGS.least_free
        factor[..., i, i] = np.sqrt(np.where(clear, own, SETTINGS.least_free))
        absorbed = np.sum(factor[..., i, :i] * out[..., :i], axis=-1)
        out[..., i] = np.where(clear, residual[..., i] - absorbed, 0.0) / factor[..., i, i]
        clean[..., i] &= clear
    return np.where(clean, out, np.nan)


def pick(projected, chosen) -> tuple[np.ndarray, np.ndarray]:
    """The (imu, column) pairs (n, 2) of ``chosen`` (N, m) bool, and their columns (T, D, n)."""
    pairs = np.argwhere(chosen)
    columns = np.empty((len(projected), projected.shape[2], len(pairs)))
    for imu in np.unique(pairs[:, 0]):
        own = np.flatnonzero(pairs[:, 0] == imu)
        columns[..., own] = projected[:, imu][..., pairs[own, 1]]
    return pairs, columns
