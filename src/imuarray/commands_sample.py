"""The work behind `imuarray sample`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from imuarray.commands_model import assumed, chosen_model, usable
from imuarray.errors import InputError
from imuarray.geometry import positions_of
from imuarray.model.names import parameter_names
from imuarray.posterior import (
    Chains,
    CompiledTarget,
    GaussianPrior,
    GenericTarget,
    Likelihood,
    run_chains,
    tuning,
)
from imuarray.posterior.generic import GenericLikelihood
from imuarray.provenance import code_digest, digest, stamp
from imuarray.recording import read_recording
from imuarray.streams import stream
from imuarray.studies.bayes import sample_covariance

PMMH_STEPS = {True: 200_000, False: 10_000}  # compiled, any effects
NUTS_STEPS, NUTS_WARMUP = 1000, 300
APART = 2.0  # posterior sds by which the starts differ where effects are free
STORED = 2000
RHAT_THRESHOLD = 1.05
GAP = 1e-3  # nats in total
VARIANCE = 0.1  # wanted of log p-hat, section III-C of paper 2021


def sample(arguments) -> None:
    """Two chains of the positions' posterior, by PmMH or NUTS."""
    from imuarray.posterior.store import write_chains
    from imuarray.posterior.summary import summarise

    recording = usable(read_recording(arguments.recording), arguments.quiet)
    recording = assumed(recording, arguments)
    model = chosen_model(recording, arguments)
    names = parameter_names(model, (recording.accelerometer_labels, recording.gyroscope_labels))
    if model.effects and arguments.rates == "spread":
        raise InputError("--rates spread: expected no --effects with it, found some")
    made = (_nuts if arguments.method == "nuts" else _pmmh)(recording, model, arguments)
    labels = recording.accelerometer_labels[1:]
    verdict, table, _ = summarise(made.chains, labels, RHAT_THRESHOLD)
    attrs = stamp({"recording": made.key, **made.settings}, arguments.seed)
    attrs |= {name: verdict[name] for name in ("burn_in_draws", "rhat_max", "ess_min")}
    write_chains(arguments.out, made.chains, labels, made.prior, attrs, names)
    if made.checkpoint is not None:
        Path(made.checkpoint).unlink(missing_ok=True)
    if not arguments.quiet:
        _report(verdict, table)
        if made.chains.divergent:
            print(f"{made.chains.divergent} transitions diverged: a part of the posterior may be"
                  " missed")  # fmt: skip


class Made(NamedTuple):
    """Chains, and what made them."""

    chains: Chains
    prior: GaussianPrior
    key: str  # digest of everything that they depend on
    settings: dict
    checkpoint: Path | None = None


def _report(verdict, table) -> None:
    print("triad axis   mean mm   sd um")
    for row in table.itertuples():
        numbers = f"{1e3 * row.mean_m:9.4f} {1e6 * row.sd_m:7.2g}"
        print(f"{row.accelerometer:>5} {row.axis:>4} {numbers}")
    state = "converged" if verdict["converged"] else "NOT converged: take more --steps"
    print(f"{state}: R-hat {verdict['rhat_max']:.3f}, smallest ESS {verdict['ess_min']:.0f},"
          f" burn-in {verdict['burn_in_steps']} of {verdict['steps']} steps")  # fmt: skip


def _key(recording, model, prior, arguments, *rest) -> str:
    return digest(
        recording.specific_force, recording.angular_rate, recording.accelerometer_position,
        model.noise.accelerometer, model.noise.gyroscope, prior.mean, prior.sd,
        *rest, arguments.seed, list(model.effects), arguments.rates, code_digest(),
    )  # fmt: skip


def _pmmh(recording, model, arguments) -> Made:
    """PmMH tuned as in section III-C of paper 2021; continues a checkpoint."""
    if not arguments.quiet:
        print("tuning N and the step length ...", flush=True)
    target, mode, step, draws = _tuned(recording, model, arguments)
    steps = arguments.steps or PMMH_STEPS[not model.effects]
    thin = max(1, steps // STORED)
    key = _key(recording, model, target.prior, arguments, draws, step, steps)
    checkpoint = arguments.out.with_name(f".{arguments.out.name}.{key[:16]}.npz")
    for other in arguments.out.parent.glob(f".{arguments.out.name}.*.npz"):
        if other != checkpoint and not arguments.quiet:
            print(f"{other}: a checkpoint of other data, settings or code, not continued")
    rng = _stream(arguments.seed, "starts")
    spread = target.prior.sd / 3
    starts = np.array([mode, mode + 0.0])
    starts += spread * rng.standard_normal(starts.shape)
    chains = run_chains(
        target, starts, step, max(4, steps // thin), thin, arguments.seed,
        checkpoint=checkpoint, key=key, quiet=arguments.quiet,
    )  # fmt: skip
    return Made(chains, target.prior, key, {"draws_per_sample": draws}, checkpoint)


def _nuts(recording, model, arguments) -> Made:
    """NUTS on the marginal likelihood, whitened at the mode."""
    from imuarray.posterior.nuts import run_nuts

    if not arguments.quiet:
        print("finding the mode ...", flush=True)
    log_density, prior, mode, covariance = density_of(recording, model, arguments.rates)
    rng = _stream(arguments.seed, "starts")
    chains = np.zeros((2, mode.size))
    if model.effects:  # clocks and shifts have modes of their own far away
        starts = rng.multivariate_normal(mode, APART**2 * covariance, size=len(chains))
    else:
        starts = prior.mean + prior.sd * rng.standard_normal(chains.shape)
    steps = arguments.steps or NUTS_STEPS
    found = run_nuts(
        log_density, mode, covariance, starts, NUTS_WARMUP, steps, arguments.seed,
        quiet=arguments.quiet,
    )  # fmt: skip
    return Made(found, prior, _key(recording, model, prior, arguments, steps, "nuts"),
                {"divergent": found.divergent})  # fmt: skip


def density_of(recording, model, rates: str = "declared"):
    """(log density, prior, mode (P,), covariance (P, P)) of a recording's posterior.

    The log density is a function of p (P,) = (r_2 ... r_A, effect parameters), to be traced and
    differentiated by JAX. ``rates`` as `imuarray sample --rates` has it.
    """
    from imuarray.posterior.marginal import Marginal

    prior = prior_of(recording, model)
    if model.effects:
        mode, found = _map_estimate(recording, model)
        likelihood = _generic(recording, model, found)
        covariance = found.covariance
    else:
        estimator = _likelihood(recording, model, rates == "spread")
        mode, covariance = _mode(recording, model, rates == "spread")
        likelihood = Marginal.of(estimator, positions_of(mode))
        if likelihood.gap > GAP:
            print(f"gyroscopes that see little of the motion: the likelihood is good to"
                  f" {likelihood.gap:.1g} nats only", file=sys.stderr)  # fmt: skip

    def log_density(p):
        # traced: no call out of it
        return likelihood.log_density(p) - 0.5 * (((p - prior.mean) / prior.sd) ** 2).sum()

    return log_density, prior, mode, covariance


def prior_of(recording, model) -> GaussianPrior:
    """Of the positions r_2 ... r_A, then of the effects' parameters."""
    mean = np.concatenate([model.array.parameters, model.effect_prior_mean])
    sd = np.full(mean.size, recording.position_prior_sd)
    sd[3 * (model.array.accelerometers - 1) :] = model.effect_prior_sd
    return GaussianPrior.of(mean, sd)


def _stream(seed, name):
    return stream(seed, "sample", name)


def _likelihood(recording, model, spread: bool) -> Likelihood:
    """(26a) for the papers' model."""
    return Likelihood.of(
        model, recording.specific_force, recording.angular_rate, recording.saturated_gyroscopes(),
        rate_distribution=sample_covariance(recording.angular_rate) if spread else None,
    )  # fmt: skip


def _tuned(recording, model, arguments):
    """(target, start near the mode, step length, N), tuned as in section III-C."""
    if model.effects:
        return _tuned_generic(recording, model, arguments)
    spread = arguments.rates == "spread"
    likelihood = _likelihood(recording, model, spread)
    prior = prior_of(recording, model)
    counts, rng = tuning.COUNTS, _stream(arguments.seed, "tuning")
    variances = tuning.variance_sweep(likelihood, model.array.relative, counts, 200, rng)
    mode, _ = _mode(recording, model, spread)
    if variances.min() > 2 * VARIANCE:
        if not arguments.quiet:
            print(f"variance of log p-hat {variances[-1]:.3g} at N = {counts[-1]}: omega is drawn"
                  " around the integrand's mode instead")  # fmt: skip
        centre = positions_of(mode)
        likelihood = likelihood.centred(centre)
        variances = tuning.variance_sweep(likelihood, centre, counts, 200, rng)
    draws = tuning.choose_draws(counts, variances, VARIANCE)
    target = CompiledTarget(likelihood, prior, draws)
    steps = recording.position_prior_sd * np.geomspace(1e-6, 0.3, 16)
    rates = tuning.acceptance_sweep(target, mode, steps, 1000, rng)
    return target, mode, tuning.choose_step(steps, rates), draws


def _mode(recording, model, spread: bool):
    """MAP (r_2 ... r_A) and the covariance there: the chains' starts spread around it."""
    from imuarray.measured.positions import locate

    if spread:
        found = locate(recording, recording.accelerometer_noise_sd)
        return found.mean[1:].ravel(), found.covariance
    mode, found = _map_estimate(recording, model)
    return mode, found.covariance


def _map_estimate(recording, model):
    from imuarray.estimation import calibrate_gauss_newton

    found = calibrate_gauss_newton(
        model, recording.specific_force, recording.angular_rate,
        saturated=recording.saturated_gyroscopes(),
        position_prior=(model.array.parameters, recording.position_prior_sd),
        time=recording.time,
    )  # fmt: skip
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


def _tuned_generic(recording, model, arguments):
    """The same for a model with effects: Laplace-centred importance sampling of omega."""
    mode, found = _map_estimate(recording, model)
    estimate = _generic(recording, model, found)
    target = GenericTarget(
        estimate, prior_of(recording, model), np.linalg.cholesky(found.covariance)
    )
    steps = np.geomspace(1e-3, 1.0, 8)
    rng = _stream(arguments.seed, "tuning")
    rates = tuning.acceptance_sweep(target, mode, steps, 200, rng)
    return target, mode, tuning.choose_step(steps, rates), estimate.draws
