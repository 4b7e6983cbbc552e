"""The posterior density of a recording's positions: noise, motion's prior, likelihood, mode."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from imuarray.analysis.model import Say, silent
from imuarray.analysis.noise import estimated_noise
from imuarray.engine.readings import Readings
from imuarray.errors import IdentifiabilityError
from imuarray.estimation.collapsed import Collapsed
from imuarray.geometry import positions_of
from imuarray.model import ArrayModel
from imuarray.posterior.generic import SCALES, log_laplace, unknown
from imuarray.posterior.marginal import Marginal, log_posterior
from imuarray.posterior.prior import GaussianPrior, TiedPrior
from imuarray.recording import Recording
from imuarray.streams import stream

GAP = 0.05  # nats in total, nearly the same at all positions: finer nodes would cost 27 times
NOT_CONVERGED = (
    "the search for the posterior's mode did not converge; chains start from where it ended"
)
WIDE = 3.0  # prior sd of the log of a noise's sd, and of the motion's: a factor of twenty
FEW, STARTS = 50, 8  # samples; searches for the mode where there are no more


class Posterior(NamedTuple):
    """Density, mode and covariance for a sampler, by `posterior_of` or `posterior_beyond`."""

    recording: Recording
    model: ArrayModel  # with the noise, and the motion's prior, that belong to ``scales`` = 0
    prior: GaussianPrior  # of r_2 ... r_A (m), the effects' parameters, then the scales
    mode: np.ndarray  # (P,)
    covariance: np.ndarray  # (P, P) about the mode's
    scales: tuple[str, ...]  # of `SCALES`, those whose logs are unknown
    motion: np.ndarray | None = None  # (T, 9 or 15) at the mode; with effects
    readings: Readings | None = None  # with effects: what is sampled from, with its noise

    @property
    def spread(self) -> np.ndarray:
        """(5, K) from the unknown logs to those of `SCALES`."""
        return np.eye(len(SCALES))[:, [SCALES.index(name) for name in self.scales]]


def posterior_of(
    recording: Recording, model: ArrayModel, known: tuple[bool, bool] = (False, False),
    say: Say = silent,
) -> Posterior:  # fmt: skip
    """The posterior of a recording under the papers' model, around its mode.

    omega and omega_dot are normal of the recording's own size; that and the noise are unknown, with
    log-normal priors a factor of twenty wide. ``known``: whether the accelerometers' noise, the
    gyroscopes', is the model's own.
    """
    fitted = estimated_noise(recording, model, mode_search(recording), known, say)
    found, chosen = fitted.calibration, fitted.model
    if not found.converged:
        say(NOT_CONVERGED)
    # s is flat: differences between triads do not show it
    chosen = replace(chosen, motion_sd=(*fitted.motion_sd[:2], np.inf))
    free = [*np.logical_not(known), True, True, False]
    unknown = unknown_scales(model, chosen, fitted.freedom, np.zeros(3), len(recording.time))
    before, freedom = (part[free] for part in unknown)
    prior = prior_of(recording, chosen)
    return Posterior(
        recording, chosen,
        GaussianPrior(
            np.append(prior.mean, before), np.append(prior.sd, np.full(sum(free), WIDE))
        ),
        np.concatenate([found.positions[1:].ravel(), np.zeros(sum(free))]),
        block_diag(found.covariance, np.diag(0.5 / np.maximum(freedom, 1.0))),
        tuple(name for name, one in zip(SCALES, free, strict=True) if one),
    )  # fmt: skip


def unknown_scales(declared: ArrayModel, chosen: ArrayModel, freedom, own, samples: int):
    """(prior means, degrees of freedom) (5,) of the logs of `SCALES`, 0 at the model ``chosen``.

    ``own`` (3,): where the logs of the motion's size are expected.
    """
    kinds = "accelerometer", "gyroscope"
    size, other = (
        np.array([np.trace(getattr(model.noise, kind)) for kind in kinds])
        for model in (declared, chosen)
    )
    before = 0.5 * np.log(size / other)
    return np.append(before, own), np.append(freedom, np.full(3, 3.0 * samples))


def prior_of(recording: Recording, model: ArrayModel) -> GaussianPrior:
    """Prior of the positions r_2 ... r_A, then of the effects' parameters."""
    mean = np.append(model.array.parameters, np.zeros(model.effect_size))
    sd = np.full(mean.size, recording.position_prior_sd)
    sd[3 * (model.array.accelerometers - 1) :] = model.effect_prior_sd
    return GaussianPrior.of(mean, sd)


def mode_search(recording: Recording) -> Callable:
    """A function of the model that searches the posterior's mode, from where it was last found.

    The first time from elsewhere, too, where few samples leave local optima.
    """
    from imuarray.estimation.newton import calibrate_gauss_newton

    last: list[np.ndarray] = []

    def search(model, start):
        return calibrate_gauss_newton(
            model, recording.specific_force, recording.angular_rate, start,
            saturated=recording.saturated_gyroscopes(),
            position_prior=(model.array.parameters, recording.position_prior_sd),
        )  # fmt: skip

    def fit(model):
        found = search(model, last[0] if last else None)
        if not last and len(recording.time) <= FEW:
            rng = stream(0, "sample", "mode")
            for _ in range(STARTS):
                off = recording.position_prior_sd * rng.standard_normal(found.positions.shape)
                with suppress(IdentifiabilityError):  # it ran to triads on one line
                    other = search(model, model.array.relative + off)
                    found = min(found, other, key=lambda one: one.cost[-1])
        last[:] = [found.positions]
        return found

    return fit


@cache
def log_extended(model: ArrayModel) -> Callable:
    """Log density under a model with effects; one function for models that predict the same."""

    def log_density(theta, data, mean, root):
        prior = -0.5 * ((root @ (theta - mean)) ** 2).sum()
        return log_laplace(model, theta, data) + prior

    return log_density


def traced(posterior: Posterior, say: Say = silent):
    """(log density, data): a function of theta (P,) and of arrays, to be compiled by JAX."""
    prior = posterior.prior
    if isinstance(prior, TiedPrior):
        assert posterior.readings is not None  # there are, with effects
        given = unknown(posterior.readings, posterior.motion, posterior.spread)
        return log_extended(posterior.model), (given, prior.mean, prior.root)
    recording = posterior.recording
    saturated = recording.saturated_gyroscopes()
    collapsed = Collapsed.of(
        posterior.model, recording.specific_force, recording.angular_rate, saturated
    )
    own = collapsed.mean.T[:, None]
    nothing = np.zeros((len(own), 3 * posterior.model.array.accelerometers))
    apart = posterior.model.noise.misfit(nothing, recording.angular_rate - own, saturated)
    size = 3 * (posterior.model.array.accelerometers - 1)
    found = Marginal.of(
        collapsed, positions_of(posterior.mode[:size]), motion_sd=posterior.model.motion_sd[:2],
        spread=(apart, saturated.size - saturated.sum()), enough=GAP,
    )  # fmt: skip
    if found.gap > GAP:
        say("gyroscopes that see little of the motion: the likelihood is good to"
            f" {found.gap:.1g} nats only")  # fmt: skip
    return log_posterior, (
        found.data, found.nodes, found.log_weights, posterior.spread, prior.mean, prior.sd
    )  # fmt: skip
