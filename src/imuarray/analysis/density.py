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
from imuarray.geometry import positions_of
from imuarray.model import ArrayModel
from imuarray.posterior import tuning
from imuarray.posterior.generic import SCALES, log_laplace, unknown
from imuarray.posterior.likelihood import Likelihood
from imuarray.posterior.marginal import Marginal, log_posterior
from imuarray.posterior.proposals import sample_covariance
from imuarray.posterior.target import GaussianPrior, TiedPrior
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

    @property
    def flat(self) -> bool:
        """True where the motion's prior is the papers'."""
        return not np.isfinite(self.model.motion_sd[0])

    def likelihood(self, rates: str = "declared") -> Likelihood:
        """(26a) for the papers' model."""
        recording = self.recording
        return Likelihood.of(
            self.model, recording.specific_force, recording.angular_rate,
            recording.saturated_gyroscopes(), motion_sd=self.model.motion_sd[:2],
            rate_distribution=sample_covariance(recording.angular_rate)
            if rates == "spread" else None,
        )  # fmt: skip


def posterior_of(
    recording: Recording, model: ArrayModel, flat: bool = False, rates: str = "declared",
    known: tuple[bool, bool] = (False, False), say: Say = silent,
) -> Posterior:  # fmt: skip
    """The posterior of a recording under the papers' model, around its mode.

    Parameters
    ----------
    flat
        Whether omega and omega_dot have the papers' prior, and the noise is at its estimate. By
        default they are normal of the recording's own size; that and the noise are unknown, with
        log-normal priors a factor of twenty wide.
    rates
        As `imuarray.sample` has it; the noise is the model's where it is ``"spread"``.
    known
        Whether the accelerometers' noise, the gyroscopes', is the model's own.
    """
    if rates == "spread":
        return _spread(recording, model, say)
    fitted = estimated_noise(recording, model, _fit(recording), known, say)
    found, chosen = fitted.calibration, fitted.model
    if not found.converged:
        say(NOT_CONVERGED)
    sizes = np.array(fitted.motion_sd)
    if not flat:  # s is flat: differences between triads do not show it
        chosen = replace(chosen, motion_sd=(*sizes[:2], np.inf))
    free = [not flat and not fixed for fixed in known] + [not flat] * 2 + [False]
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


def _spread(recording: Recording, model: ArrayModel, say: Say) -> Posterior:
    """The papers' experiment: the noise is the model's, omega's density the gyroscopes' spread."""
    from imuarray.measured.positions import locate

    found = locate(recording, recording.accelerometer_noise_sd)
    if not found.converged:
        say(NOT_CONVERGED)
    prior, mode = prior_of(recording, model), found.mean[1:].ravel()
    return Posterior(recording, model, prior, mode, found.covariance, ())


def prior_of(recording: Recording, model: ArrayModel) -> GaussianPrior:
    """Prior of the positions r_2 ... r_A, then of the effects' parameters."""
    mean = np.append(model.array.parameters, np.zeros(model.effect_size))
    sd = np.full(mean.size, recording.position_prior_sd)
    sd[3 * (model.array.accelerometers - 1) :] = model.effect_prior_sd
    return GaussianPrior.of(mean, sd)


def _fit(recording: Recording) -> Callable:
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


def traced(posterior: Posterior, rates: str = "declared", say: Say = silent):
    """(log density, data): a function of theta (P,) and of arrays, to be compiled by JAX."""
    prior = posterior.prior
    if isinstance(prior, TiedPrior):
        assert posterior.readings is not None  # there are, with effects
        given = unknown(posterior.readings, posterior.motion, posterior.spread)
        return log_extended(posterior.model), (given, prior.mean, prior.root)
    recording = posterior.recording
    likelihood = posterior.likelihood(rates)
    saturated = recording.saturated_gyroscopes()
    own = likelihood.collapsed.mean.T[:, None]
    nothing = np.zeros((len(own), 3 * posterior.model.array.accelerometers))
    apart = posterior.model.noise.misfit(nothing, recording.angular_rate - own, saturated)
    size = 3 * (posterior.model.array.accelerometers - 1)
    found = Marginal.of(
        likelihood, positions_of(posterior.mode[:size]),
        spread=(apart, saturated.size - saturated.sum()), enough=GAP,
    )  # fmt: skip
    if found.gap > GAP:
        say("gyroscopes that see little of the motion: the likelihood is good to"
            f" {found.gap:.1g} nats only")  # fmt: skip
    return log_posterior, (
        found.data, found.nodes, found.log_weights, posterior.spread, prior.mean, prior.sd
    )  # fmt: skip


def at_estimate(posterior: Posterior) -> Posterior:
    """The posterior with noise and motion's size at their estimates, for compiled code."""
    size, prior = len(posterior.mode) - len(posterior.scales), posterior.prior
    return posterior._replace(
        prior=GaussianPrior(prior.mean[:size], prior.sd[:size]), mode=posterior.mode[:size],
        covariance=posterior.covariance[:size, :size], scales=(),
    )  # fmt: skip


def tuned_target(posterior: Posterior, rates: str, rng, say: Say = silent):
    """(target, step length, N) of the paper's walk.

    N and the walk's length as in section III-C; where not even the largest N brings the variance of
    log p-hat near what is aimed at, omega is drawn around the integrand's mode.
    """
    prior, mode, likelihood = posterior.prior, posterior.mode, posterior.likelihood(rates)
    sweeps = tuning.Sweeps(posterior.recording.position_prior_sd * np.geomspace(1e-6, 0.3, 16))
    found = tuning.tune(
        likelihood, prior, posterior.model.array.relative, lambda _: mode, sweeps, lambda _: rng
    )
    if found.centred:
        say(f"variance of log p-hat {found.variances[-1]:.3g} at N = {sweeps.draws[-1]}: omega is"
            " drawn around the integrand's mode instead")  # fmt: skip
    return found.target, found.step, found.target.draws
