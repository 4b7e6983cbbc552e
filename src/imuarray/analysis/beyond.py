"""The posterior density under a model with effects, around where the engine has fitted it."""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from imuarray.analysis.density import WIDE, Posterior, prior_of, unknown_scales
from imuarray.analysis.noise import Shown, factors, shown
from imuarray.engine.dataset import effects_of, parameters_of, places_among
from imuarray.engine.estimate import Estimate
from imuarray.engine.fit import flat_parameters
from imuarray.engine.linearise import State
from imuarray.engine.parameters import gauge_masks, model_of, prior_precision
from imuarray.engine.readings import Readings
from imuarray.linear import scaled_inverse
from imuarray.model import ArrayModel, Noise
from imuarray.posterior.generic import SCALES
from imuarray.posterior.prior import TiedPrior
from imuarray.recording import Recording

HELD = 1e-3  # of its prior's sd: the sd of a parameter that the estimate does not free


def posterior_beyond(recording: Recording, found: Estimate) -> Posterior:
    """The posterior under a model with effects, around where the engine has fitted it.

    Readings, their noise, and what is known of gauges are the estimate's; noise and the size of
    omega, omega_dot and s are unknown as in `posterior_of`.
    """
    one, mine = found.recorded[0], found.places[0]
    place = places_among(found, effects_of(found))[0][mine]
    precision = _known(found)
    inverse = scaled_inverse(found.information[np.ix_(mine, mine)] + precision)
    readings, seen = _judged(found, inverse)
    model = _model(recording, found, readings, seen.motion_sd)
    prior = prior_of(recording, model)
    mode = np.concatenate([found.positions[1:].ravel(), parameters_of(found, model)])
    mean, spread = mode.copy(), np.diag((HELD * prior.sd) ** 2)
    mean[place], root = prior.mean[place], np.diag(1.0 / (HELD * prior.sd))
    root[np.ix_(place, place)] = np.linalg.cholesky(precision).T
    spread[np.ix_(place, place)] = inverse
    own, number = np.log(seen.motion_sd / model.motion_sd), seen.freedom.sum(axis=0)
    declared = model_of(recording)
    before, freedom = unknown_scales(declared, model, number, own, len(readings.time))
    motion = one.state.motion[:, :9]
    if model.needs_derivatives:
        motion = np.hstack([motion, *one.state.jerk])
    return Posterior(
        recording, model,
        TiedPrior.of(np.append(mean, before), block_diag(root, np.eye(len(SCALES)) / WIDE)),
        np.concatenate([mode, [0.0, 0.0], own]),
        block_diag(spread, np.diag(0.5 / np.maximum(freedom, 1.0))), SCALES, motion, readings,
    )  # fmt: skip


def _model(recording: Recording, found: Estimate, readings: Readings, sizes) -> ArrayModel:
    """With the readings' noise and clock, and priors of the motion's size (3,)."""
    plain, counts = model_of(recording, effects_of(found)), readings.exists.sum(axis=0)
    sds = (readings.sd[:n, kind] for kind, n in enumerate(counts))
    return replace(
        plain, noise=Noise.of(*counts, *sds), clock=(readings.origin, readings.span),
        # a compiled function has them: powers of two serve other recordings, too
        motion_sd=tuple(2.0 ** np.round(np.log2(sizes))),
        derivative_sd=_derivative_sd(plain, found.recorded[0].state),
    )  # fmt: skip


def _known(found: Estimate) -> np.ndarray:
    """Prior precision (n, n) of the active parameters: what the positions take up is pinned.

    A gauge that the array's size takes up is as wide as is known of it, or as the mean of
    parameters that differ as these do.
    """
    columns, active = found.columns, found.active
    precision = prior_precision(columns, active, resized=False)
    values = flat_parameters(columns, found.recorded[0].state)
    for effect, mask in gauge_masks(columns, active):
        if effect.resizes:
            mean, prior = mask[active] / mask.sum(), np.mean(np.diag(precision)[mask[active]])
            more = max(1.0 / np.var(values[mask], ddof=1) - prior, 0.0) * mask.sum()
            if effect.kinds == [1] and np.isfinite(found.scale_sd):
                more = found.scale_sd**-2
            precision += np.outer(mean, mean) * more
    return precision


def _judged(found: Estimate, covariance) -> tuple[Readings, Shown]:
    """The estimate's readings with the normal noise that they show; few of them share a factor."""
    one = found.recorded[0]
    squares = np.where(one.readings.exists, found.noise_sd() ** 2, np.nan)
    sds = np.broadcast_to(np.sqrt(np.nanmean(squares, axis=0)), squares.shape)
    readings = one.readings.with_noise(sds, None)
    seen = shown(readings, found.columns, one.state, found.active, covariance)
    return readings.with_sd(sds * factors(seen, readings.exists)), seen


def _derivative_sd(model: ArrayModel, state: State) -> tuple[float, float]:
    """Prior sds of omega double dot and s dot: the recording's own where it shows them."""
    sizes = [np.sqrt(np.mean(field**2)) for field in state.jerk]
    if not model.needs_derivatives or not all(sizes):
        return model.derivative_sd
    return float(2.0 ** np.ceil(np.log2(sizes[0]))), float(2.0 ** np.ceil(np.log2(sizes[1])))
