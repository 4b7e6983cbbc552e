"""The posterior density of a recording's positions: noise, motion's prior, likelihood, mode."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from imuarray.analysis.model import Notify, silent
from imuarray.analysis.noise import (
    NoiseEstimate,
    estimated_noise,
    factors,
    noise_estimate,
    noise_of,
)
from imuarray.analysis.settings import SETTINGS
from imuarray.engine.dataset import effects_of, parameters_of, places_among
from imuarray.engine.estimate import Estimate
from imuarray.engine.parameters import model_of
from imuarray.engine.readings import Readings
from imuarray.engine.widths import priors_of
from imuarray.geometry import positions_of
from imuarray.linear import scaled_inverse
from imuarray.model import ArrayModel
from imuarray.model.effects import KINDS
from imuarray.posterior.generic import SCALES, log_laplace, unknown
from imuarray.posterior.marginal import Marginal, log_posterior
from imuarray.posterior.prior import GaussianPrior
from imuarray.recording import Recording

NOT_CONVERGED = (
    "the search for the posterior's mode did not converge; chains start from where it ended"
)


class Posterior(NamedTuple):
    """Density, mode and covariance for a sampler, by `posterior_of` or `posterior_beyond`."""

    recording: Recording
    model: ArrayModel  # with the noise, and the motion's prior, that belong to ``scales`` = 0
    prior: GaussianPrior  # of r_2 ... r_A (m), the effects' parameters, then the scales
    mode: np.ndarray  # (P,)
    covariance: np.ndarray  # (P, P) about the mode's
    scales: tuple[str, ...]  # of `SCALES`, those whose logs are unknown
    motion: np.ndarray | None = None  # (T, 9 or 15) at the mode
    readings: Readings | None = None  # with effects: what is sampled from, with its noise
    converged: bool = True  # with effects: whether the search for the mode did
    size_sd: float = 0.0  # of the logarithm of a factor that the density leaves out


def posterior_of(recording: Recording, known: bool = False, notify: Notify = silent) -> Posterior:
    """The posterior of a recording under the papers' model, around its mode.

    omega and omega_dot are normal of the recording's own size; that and the noise are unknown, with
    log-normal priors a factor of twenty wide. ``known``: whether the accelerometers' noise is the
    declared one.
    """
    readings, found, estimated = estimated_noise(recording, known, notify)
    if not found.converged:
        notify(NOT_CONVERGED)
    # s is flat: differences between triads do not show it
    chosen = replace(
        model_of(recording), noise=noise_of(readings), motion_sd=(*estimated.motion_sd[:2], np.inf)
    )
    free = [not known, True, True, True, False]
    unknown = unknown_scales(recording, chosen, estimated, np.zeros(3), len(recording.time))
    before, freedom = (part[free] for part in unknown)
    prior = prior_of(recording, chosen)
    return Posterior(
        recording, chosen,
        GaussianPrior(
            np.append(prior.mean, before), np.append(prior.sd, np.full(sum(free), SETTINGS.wide))
        ),
        np.concatenate([found.positions[1:].ravel(), np.zeros(sum(free))]),
        block_diag(found.covariance, np.diag(0.5 / np.maximum(freedom, 1.0))),
        tuple(name for name, one in zip(SCALES, free, strict=True) if one),
        found.state.motion,
    )  # fmt: skip


def posterior_beyond(recording: Recording, found: Estimate, notify: Notify = silent) -> Posterior:
    """The posterior under a model with effects, around where the engine has fitted it.

    Readings, their noise, and what is known of gauges are the estimate's; noise and the size of
    omega, omega_dot and s are unknown as in `posterior_of`.
    """
    if not found.converged:
        notify(NOT_CONVERGED)
    one, mine = found.recorded[0], found.places[0]
    place = places_among(found, effects_of(found))[0][mine]
    precision = priors_of(found)[np.ix_(mine, mine)]
    inverse = scaled_inverse(found.information[np.ix_(mine, mine)] + precision)
    readings, estimated = _judged(found, inverse)
    model = _model(recording, found, readings, estimated.motion_sd)
    prior = prior_of(recording, model)
    mode = np.concatenate([found.positions[1:].ravel(), parameters_of(found, model)])
    mean, spread = mode.copy(), np.diag((SETTINGS.held * prior.sd) ** 2)
    mean[place], root = prior.mean[place], np.diag(1.0 / (SETTINGS.held * prior.sd))
    root[np.ix_(place, place)] = np.linalg.cholesky(precision).T
    spread[np.ix_(place, place)] = inverse
    own = np.log(estimated.motion_sd / model.motion_sd)
    before, freedom = unknown_scales(recording, model, estimated, own, len(readings.time))
    motion = one.state.motion[:, :9]
    if model.needs_derivatives:
        motion = np.hstack([motion, *one.state.jerk])
    return Posterior(
        recording, model,
        GaussianPrior.tied(
            np.append(mean, before), block_diag(root, np.eye(len(SCALES)) / SETTINGS.wide)
        ),
        np.concatenate([mode, [0.0, 0.0], own]),
        block_diag(spread, np.diag(0.5 / np.maximum(freedom, 1.0))), SCALES, motion, readings,
        found.converged,
    )  # fmt: skip


def _model(recording: Recording, found: Estimate, readings: Readings, sizes) -> ArrayModel:
    """With the readings' noise and clock, and priors of the motion's own size: ``sizes`` (3,)."""
    plain = model_of(recording, effects_of(found))
    derivative_sd = plain.derivative_sd
    rms = [np.sqrt(np.mean(field**2)) for field in found.recorded[0].state.jerk]
    if plain.needs_derivatives and all(rms):
        first, second = (float(2.0 ** np.ceil(np.log2(size))) for size in rms)
        derivative_sd = first, second
    return replace(
        plain, noise=noise_of(readings), clock=(readings.origin, readings.span),
        # a compiled function has them: powers of two serve other recordings, too
        motion_sd=tuple(2.0 ** np.round(np.log2(sizes))),
        derivative_sd=derivative_sd,
    )  # fmt: skip


def _judged(found: Estimate, covariance) -> tuple[Readings, NoiseEstimate]:
    """The estimate's readings with the normal noise that they show; few of them share a factor."""
    one = found.recorded[0]
    squares = np.where(one.readings.exists, found.noise_sd() ** 2, np.nan)
    sds = np.broadcast_to(np.sqrt(np.nanmean(squares, axis=0)), squares.shape)
    readings = one.readings.with_noise(sds, None)
    estimated = noise_estimate(readings, found.columns, one.state, found.active, covariance)
    return readings.with_sd(sds * factors(estimated, readings.exists)), estimated


def unknown_scales(
    recording: Recording, chosen: ArrayModel, estimated: NoiseEstimate, own, samples: int
):  # fmt: skip
    """(prior means, degrees of freedom) (5,) of the logs of `SCALES`, 0 at the model ``chosen``.

    ``own`` (3,): where the logs of the motion's size are expected.
    """
    declared = model_of(recording).noise
    ratios = [
        np.trace(getattr(declared, kind)) / np.trace(getattr(chosen.noise, kind)) for kind in KINDS
    ]
    freedom = np.append(estimated.freedom.sum(axis=0), np.full(3, 3.0 * samples))
    return np.append(0.5 * np.log(ratios), own), freedom


def prior_of(recording: Recording, model: ArrayModel) -> GaussianPrior:
    """Prior of the positions r_2 ... r_A, then of the effects' parameters."""
    mean = np.append(model.array.parameters, np.zeros(model.effect_size))
    sd = np.full(mean.size, recording.position_prior_sd)
    sd[3 * (model.array.accelerometers - 1) :] = model.effect_prior_sd
    return GaussianPrior.of(mean, sd)


def log_extended(theta, model: ArrayModel, data, mean, root):
    """Log density under a model with effects."""
    return log_laplace(model, theta, data) - 0.5 * ((root @ (theta - mean)) ** 2).sum()


def traced(posterior: Posterior, notify: Notify = silent):
    """(log density, data): a function of theta (P,) and of arrays, to be compiled by JAX."""
    prior = posterior.prior
    # (5, K) from the unknown logs to those of `SCALES`
    spread = np.eye(len(SCALES))[:, [SCALES.index(name) for name in posterior.scales]]
    if prior.root is not None:
        assert posterior.readings is not None  # there are, with effects
        given = unknown(posterior.readings, posterior.motion, spread)
        return log_extended, (posterior.model, given, prior.mean, prior.root)
    found = _marginal(posterior, posterior.motion)
    if found.gap > SETTINGS.node_gap:
        notify("gyroscopes that see little of the motion: the likelihood is good to"
            f" {found.gap:.1g} nats only")  # fmt: skip
    return log_posterior, (
        found.data, found.nodes, found.log_weights, spread, prior.mean, prior.sd
    )  # fmt: skip


def _marginal(posterior: Posterior, motion) -> Marginal:
    """The papers' marginal likelihood of all samples, around the ``motion`` (T, 9) at the mode."""
    recording, model = posterior.recording, posterior.model
    noise, rate, saturated = model.noise, recording.angular_rate, recording.saturated_gyroscopes()
    observed, information = noise.angular_rate_given_gyroscopes(rate, saturated)
    force = recording.specific_force
    force = force - force.mean(axis=1, keepdims=True)  # s takes it up; less is lost to rounding
    apart = noise.misfit(np.zeros((len(rate), force[0].size)), rate - observed[:, None], saturated)
    precision = noise.accelerometer_precision
    weighted = force.reshape(len(force), -1) @ precision
    covariance = np.linalg.inv(information + model.motion_sd[0] ** -2.0 * np.eye(3))
    mean = np.einsum("tij,tjk,tk->ti", covariance, information, observed)
    return Marginal.of(
        weighted, np.sum(weighted * force.reshape(weighted.shape), axis=1), precision,
        (mean, covariance), motion[:, :3],
        positions_of(posterior.mode[: 3 * (model.array.accelerometers - 1)]), model.motion_sd[:2],
        observed=observed, spread=(apart, saturated.size - saturated.sum()),
        enough=SETTINGS.node_gap,
    )  # fmt: skip
