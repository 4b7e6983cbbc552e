"""How likely an estimate makes its readings, on blocks of time that it was not trained on."""

import numpy as np
from scipy.special import gammaln

from imuarray.engine.estimate import Estimate, Recorded
from imuarray.engine.heldout import Scores, blocks_of, trained_elsewhere
from imuarray.engine.linearise import linearise
from imuarray.engine.parameters import Columns


def block_scores(found: Estimate) -> Scores:
    """Log densities of a recording's blocks, the parameters trained on its other blocks.

    Noise, degrees of freedom and clocks' phases are those of all blocks.
    """
    (one,) = found.recorded
    nats = log_densities(one, found.columns, found.freedoms)
    blocks = blocks_of(len(nats))
    better = trained_elsewhere(found.blocks, found.precision)
    each = np.array([nats[block].sum() for block in blocks])
    return Scores(each + better, np.array([block.stop - block.start for block in blocks]))


def log_densities(one: Recorded, columns: Columns, freedoms) -> np.ndarray:
    """(T,) nats of each sample's readings, its motion integrated out (Laplace's approximation).

    ``freedoms`` (2,) of Student's t, of accelerometers and gyroscopes. Omega, omega_dot and s have
    a flat prior, so differences between models of the same readings alone mean anything. The
    curvature is that of the weights in use, more than t's own: a sample's density is stated too
    small rather than too large.
    """
    readings, state = one.readings, one.state
    seen = linearise(readings, columns, state, [])
    number, squares = (
        part.reshape(*part.shape[:2], 2, 3).sum(axis=-1)
        for part in (readings.keep, seen.residual**2)
    )
    weighted = squares.sum(axis=(1, 2))
    if readings.trust is not None:
        squares = squares / readings.trust**2
    nats = np.zeros(len(weighted))
    for kind, nu in enumerate(freedoms):
        n, d = number[..., kind], squares[..., kind]
        if np.isfinite(nu):
            scale = gammaln((nu + n) / 2) - gammaln(nu / 2) - n / 2 * np.log(nu * np.pi)
            density = scale - (nu + n) / 2 * np.log1p(d / nu)
        else:
            density = -n / 2 * np.log(2 * np.pi) - d / 2
        nats += np.sum(density - n * np.log(readings.sd[:, kind]), axis=1)
    nats += seen.inverse.shape[1] / 2 * np.log(2 * np.pi) - seen.log_volume / 2
    if state.rough_prior is not None:
        sd = state.rough_prior.sd
        nats -= np.sum(np.log(sd), axis=1) + sd.shape[1] / 2 * np.log(2 * np.pi)
    if state.turning is not None:
        nats -= state.turning.log_norm
    return nats - (seen.misfit - weighted) / 2
