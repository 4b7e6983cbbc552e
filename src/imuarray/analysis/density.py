"""The posterior density of a recording's positions: prior, likelihood, mode."""

from __future__ import annotations

import numpy as np

from imuarray.analysis.model import Say, silent
from imuarray.geometry import positions_of
from imuarray.model import ArrayModel
from imuarray.posterior import tuning
from imuarray.posterior.generic import GenericLikelihood
from imuarray.posterior.likelihood import Likelihood
from imuarray.posterior.rate_density import sample_covariance
from imuarray.posterior.target import GaussianPrior, GenericTarget
from imuarray.recording import Recording

GAP = 1e-3  # nats in total
NOT_CONVERGED = (
    "the search for the posterior's mode did not converge; chains start from where it ended"
)


def density_of(recording: Recording, model: ArrayModel, rates: str = "declared", say: Say = silent):
    """(log density, prior, mode (P,), covariance (P, P)) of a recording's posterior.

    The log density is a function of p (P,) = (r_2 ... r_A, effect parameters), to be traced and
    differentiated by JAX. ``rates`` as `imuarray sample --rates` has it.
    """
    from imuarray.posterior.marginal import Marginal

    prior = prior_of(recording, model)
    likelihood: GenericLikelihood | Marginal
    if model.effects:
        mode, found = map_estimate(recording, model, say)
        likelihood = _generic(recording, model, found)
        covariance = found.covariance
    else:
        estimator = _likelihood(recording, model, rates == "spread")
        mode, covariance = _mode(recording, model, rates == "spread", say)
        likelihood = marginal = Marginal.of(estimator, positions_of(mode))
        if marginal.gap > GAP:
            say("gyroscopes that see little of the motion: the likelihood is good to"
                f" {marginal.gap:.1g} nats only")  # fmt: skip

    def log_density(p):
        # traced: no call out of it
        return likelihood.log_density(p) - 0.5 * (((p - prior.mean) / prior.sd) ** 2).sum()

    return log_density, prior, mode, covariance


def prior_of(recording: Recording, model: ArrayModel) -> GaussianPrior:
    """Of the positions r_2 ... r_A, then of the effects' parameters."""
    mean = np.concatenate([model.array.parameters, model.effect_prior_mean])
    sd = np.full(mean.size, recording.position_prior_sd)
    sd[3 * (model.array.accelerometers - 1) :] = model.effect_prior_sd
    return GaussianPrior.of(mean, sd)


def tuned_target(recording: Recording, model: ArrayModel, rates: str, rng, say: Say = silent):
    """(target, start near the mode, step length, N) for PmMH, tuned as in section III-C."""
    if model.effects:
        return _tuned_generic(recording, model, rng, say)
    spread = rates == "spread"
    sweeps = tuning.Sweeps(recording.position_prior_sd * np.geomspace(1e-6, 0.3, 16))
    found = tuning.tune(
        _likelihood(recording, model, spread), prior_of(recording, model), model.array.relative,
        lambda centred: _mode(recording, model, spread, say)[0], sweeps, lambda name: rng,
    )  # fmt: skip
    if found.centred:
        say(f"variance of log p-hat {found.variances[-1]:.3g} at N = {sweeps.draws[-1]}: omega is"
            " drawn around the integrand's mode instead")  # fmt: skip
    return found.target, found.start, found.step, found.target.draws


def _tuned_generic(recording, model, rng, say):
    """The same for a model with effects: Laplace-centred importance sampling of omega."""
    mode, found = map_estimate(recording, model, say)
    estimate = _generic(recording, model, found)
    target = GenericTarget(
        estimate, prior_of(recording, model), np.linalg.cholesky(found.covariance)
    )
    step = tuning.tune_step(target, mode, np.geomspace(1e-3, 1.0, 8), 200, rng)
    return target, mode, step, estimate.draws


def _likelihood(recording, model, spread: bool) -> Likelihood:
    """(26a) for the papers' model."""
    return Likelihood.of(
        model, recording.specific_force, recording.angular_rate, recording.saturated_gyroscopes(),
        rate_distribution=sample_covariance(recording.angular_rate) if spread else None,
    )  # fmt: skip


def _mode(recording, model, spread: bool, say: Say):
    """MAP (r_2 ... r_A) and the covariance there: the chains' starts spread around it."""
    from imuarray.measured.positions import locate

    if spread:
        found = locate(recording, recording.accelerometer_noise_sd)
        if not found.converged:
            say(NOT_CONVERGED)
        return found.mean[1:].ravel(), found.covariance
    mode, found = map_estimate(recording, model, say)
    return mode, found.covariance


def map_estimate(recording: Recording, model: ArrayModel, say: Say = silent):
    """(p (P,) at the posterior's mode, the estimator's whole result).

    Says so where the search did not converge. Chains start from where it ended; with effects the
    motion's prior takes its size from there, too.
    """
    from imuarray.estimation import calibrate_gauss_newton

    found = calibrate_gauss_newton(
        model, recording.specific_force, recording.angular_rate,
        saturated=recording.saturated_gyroscopes(),
        position_prior=(model.array.parameters, recording.position_prior_sd),
        time=recording.time,
    )  # fmt: skip
    if not found.converged:
        say(NOT_CONVERGED)
    extra = np.empty(0) if found.effect_parameters is None else found.effect_parameters
    return np.concatenate([found.positions[1:].ravel(), extra]), found


def _generic(recording, model, found, draws: int = 2) -> GenericLikelihood:
    """The likelihood of a model with effects, with the recording's own motion prior."""
    from imuarray.estimation.blocks import pack_motion

    start = pack_motion(model, found.motion.motion)
    return GenericLikelihood(
        model.with_motion(found.motion.motion), recording.specific_force,
        recording.angular_rate, start, draws=draws, saturated=recording.saturated_gyroscopes(),
        time=recording.time,
    )  # fmt: skip
