"""The posterior density of a recording's positions: noise, motion's prior, likelihood, mode."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from imuarray.analysis.calibration_dataset import effects_of, parameters_of, places_among
from imuarray.analysis.model import Say, model_of, silent
from imuarray.analysis.noise import Shown, estimated_noise, factors, shown
from imuarray.engine.estimate import Estimate
from imuarray.engine.fit import flat_parameters
from imuarray.engine.linearise import State
from imuarray.engine.parameters import gauge_masks, prior_precision
from imuarray.engine.readings import Readings
from imuarray.errors import IdentifiabilityError
from imuarray.geometry import positions_of
from imuarray.linear import scaled_inverse
from imuarray.model import ArrayModel, Noise
from imuarray.posterior import tuning
from imuarray.posterior.generic import SCALES, GenericLikelihood, log_laplace
from imuarray.posterior.likelihood import Likelihood
from imuarray.posterior.rate_density import sample_covariance
from imuarray.posterior.target import GaussianPrior, GenericTarget, TiedPrior
from imuarray.recording import Recording
from imuarray.streams import stream

GAP = 0.05  # nats in total, nearly the same at all positions: finer nodes would cost 27 times
NOT_CONVERGED = (
    "the search for the posterior's mode did not converge; chains start from where it ended"
)
WIDE = 3.0  # prior sd of the log of a noise's sd, and of the motion's: a factor of twenty
HELD = 1e-3  # of its prior's sd: the sd of a parameter that the estimate does not free
FEW, STARTS = 50, 8  # samples; searches for the mode where there are no more
WIDER = 1.05  # than the mode's curvature, for preconditioned Crank-Nicolson proposals
LENGTHS = np.geomspace(0.02, 0.99, 10)  # of those that are tried


class Posterior(NamedTuple):
    """What a sampler needs of a recording, by `posterior_of` or `posterior_beyond`."""

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
        """Whether the motion's prior is the papers'."""
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

    def generic(self, draws: int = 2) -> GenericLikelihood:
        """The likelihood of a model with effects."""
        return GenericLikelihood(
            self.model, self.readings, self.motion, draws=draws, logs=self.spread
        )


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
    unknown = _unknown(model, chosen, fitted.freedom, np.zeros(3), len(recording.time))
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


def _unknown(declared: ArrayModel, chosen: ArrayModel, freedom, own, samples: int):
    """(prior means, degrees of freedom) (5,) of the logs of `SCALES`, 0 at the model ``chosen``.

    ``own`` (3,): where the logs of the motion's size are expected.
    """
    kinds = "accelerometer", "gyroscope"
    size = [
        [np.trace(getattr(model.noise, kind)) for kind in kinds] for model in (declared, chosen)
    ]
    before = 0.5 * np.log(np.divide(*size))
    return np.append(before, own), np.append(freedom, np.full(3, 3.0 * samples))


def posterior_beyond(recording: Recording, found: Estimate) -> Posterior:
    """The posterior under a model with effects, around where the engine has fitted it.

    Readings, their noise, and what is known of gauges are the estimate's; noise and the size of
    omega, omega_dot and s are unknown as in `posterior_of`.
    """
    one, effects = found.recorded[0], effects_of(found)
    mine = found.places[0]
    place = places_among(found, effects)[0][mine]
    precision = _known(found)
    whole = found.information[np.ix_(mine, mine)] + precision
    readings, seen = _judged(found, scaled_inverse(whole))
    sizes = seen.motion_sd
    # a compiled function has them: powers of two serve other recordings, too
    rounded = tuple(2.0 ** np.round(np.log2(sizes)))
    declared, counts = model_of(recording, effects), readings.exists.sum(axis=0)
    sds = (readings.sd[:n, kind] for kind, n in enumerate(counts))
    model = replace(
        declared, noise=Noise.of(*counts, *sds), motion_sd=rounded,
        clock=(readings.origin, readings.span), derivative_sd=_derivative_sd(declared, one.state),
    )  # fmt: skip
    prior = prior_of(recording, model)
    mode = np.concatenate([found.positions[1:].ravel(), parameters_of(found, model)])
    held = np.setdiff1d(np.arange(len(mode)), place)
    mean, root = prior.mean.copy(), np.diag(1.0 / (HELD * prior.sd))
    mean[held] = mode[held]
    root[np.ix_(place, place)] = np.linalg.cholesky(precision).T
    covariance = np.diag((HELD * prior.sd) ** 2)
    covariance[np.ix_(place, place)] = scaled_inverse(whole)
    own = np.log(sizes / rounded)
    before, freedom = _unknown(declared, model, seen.freedom.sum(axis=0), own, len(readings.time))
    motion = one.state.motion[:, :9]
    if model.needs_derivatives:
        motion = np.hstack([motion, *one.state.jerk])
    return Posterior(
        recording, model,
        TiedPrior.of(np.append(mean, before), block_diag(root, np.eye(len(SCALES)) / WIDE)),
        np.concatenate([mode, [0.0, 0.0], own]),
        block_diag(covariance, np.diag(0.5 / np.maximum(freedom, 1.0))), SCALES, motion, readings,
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


def _spread(recording: Recording, model: ArrayModel, say: Say) -> Posterior:
    """The papers' experiment: the noise is the model's, omega's density the gyroscopes' spread."""
    from imuarray.measured.positions import locate

    found = locate(recording, recording.accelerometer_noise_sd)
    if not found.converged:
        say(NOT_CONVERGED)
    prior, mode = prior_of(recording, model), found.mean[1:].ravel()
    return Posterior(recording, model, prior, mode, found.covariance, ())


def prior_of(recording: Recording, model: ArrayModel) -> GaussianPrior:
    """Of the positions r_2 ... r_A, then of the effects' parameters."""
    mean = np.concatenate([model.array.parameters, model.effect_prior_mean])
    sd = np.full(mean.size, recording.position_prior_sd)
    sd[3 * (model.array.accelerometers - 1) :] = model.effect_prior_sd
    return GaussianPrior.of(mean, sd)


def _fit(recording: Recording) -> Callable:
    """A function of the model that searches the posterior's mode, from where it was last found.

    The first time from elsewhere, too, where few samples leave local optima.
    """
    from imuarray.estimation import calibrate_gauss_newton

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


def log_papers(theta, data, nodes, weights, spread, mean, sd):
    """Log posterior density under the papers' model, to be traced by JAX; data of `traced`."""
    from imuarray.model.jax64 import jnp
    from imuarray.posterior.marginal import log_marginal, scaled

    count = data.weighted.shape[1] - 3
    evidence = -0.5 * jnp.sum(((theta - mean) / sd) ** 2)
    if theta.size > count:
        data, more = scaled(data, (spread @ theta[count:])[:4])
        evidence += more
    positions = jnp.concatenate([jnp.zeros((1, 3)), theta[:count].reshape(-1, 3)])
    return log_marginal(positions, data, nodes, weights) + evidence


@cache
def log_extended(model: ArrayModel, steps: int) -> Callable:
    """The same under a model with effects; one function for models that predict the same."""

    def log_density(theta, data, mean, root):
        prior = -0.5 * ((root @ (theta - mean)) ** 2).sum()
        return log_laplace(model, steps, theta, data) + prior

    return log_density


def traced(posterior: Posterior, rates: str = "declared", say: Say = silent):
    """(log density, data): a function of theta (P,) and of arrays, to be compiled by JAX."""
    prior = posterior.prior
    if posterior.model.effects:
        generic = posterior.generic()
        function = log_extended(posterior.model, generic.steps)
        return function, (generic.data, prior.mean, prior.root)
    from imuarray.posterior.marginal import Marginal

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
    return log_papers, (
        found.data, found.nodes, found.log_weights, posterior.spread, prior.mean, prior.sd
    )  # fmt: skip


def at_estimate(posterior: Posterior) -> Posterior:
    """The same with noise and motion's size at their estimates, for the compiled likelihood."""
    if posterior.model.effects or not posterior.scales:
        return posterior
    size, prior = len(posterior.mode) - len(posterior.scales), posterior.prior
    return posterior._replace(
        prior=GaussianPrior(prior.mean[:size], prior.sd[:size]), mode=posterior.mode[:size],
        covariance=posterior.covariance[:size, :size], scales=(),
    )  # fmt: skip


def tuned_target(posterior: Posterior, method: str, rates: str, rng, say: Say = silent):
    """(target, step length, N) of the paper's walk, or with ``"pcn"`` of proposals shaped by it.

    N and the walk's length as in section III-C; where not even the largest N brings the variance of
    log p-hat near what is aimed at, omega is drawn around the integrand's mode.
    """
    if posterior.model.effects:
        return _tuned_generic(posterior, method == "pcn", rng)
    prior, mode, likelihood = posterior.prior, posterior.mode, posterior.likelihood(rates)
    if method == "pcn":
        factor = WIDER * np.linalg.cholesky(posterior.covariance)
        target, step = tuning.tune_preconditioned(
            likelihood, prior, mode, factor, LENGTHS, rng, may_centre=True
        )
        return target, step, target.draws
    sweeps = tuning.Sweeps(posterior.recording.position_prior_sd * np.geomspace(1e-6, 0.3, 16))
    found = tuning.tune(
        likelihood, prior, posterior.model.array.relative, lambda _: mode, sweeps, lambda _: rng
    )
    if found.centred:
        say(f"variance of log p-hat {found.variances[-1]:.3g} at N = {sweeps.draws[-1]}: omega is"
            " drawn around the integrand's mode instead")  # fmt: skip
    return found.target, found.step, found.target.draws


def _tuned_generic(posterior: Posterior, pcn: bool, rng):
    """The same for a model with effects: Laplace-centred importance sampling of omega."""
    estimate, mode = posterior.generic(), posterior.mode
    shape = np.linalg.cholesky(posterior.covariance)
    target = GenericTarget(estimate, posterior.prior, shape, mode if pcn else None)
    if pcn:
        return target, tuning.longest_jump(target, mode, LENGTHS, 200, rng), estimate.draws
    steps = np.geomspace(1e-3, 1.0, 8)
    return target, tuning.tune_step(target, mode, steps, 200, rng), estimate.draws
