"""The Bayesian studies of paper 2021: data, targets and chains from a configuration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from imuarray.config import model_from
from imuarray.estimation import calibrate_bcd
from imuarray.estimation.selection import disjoint, neighbours
from imuarray.geometry import Array
from imuarray.model import ArrayModel
from imuarray.motion import hand_twisting, normal_motion
from imuarray.posterior.likelihood import Likelihood
from imuarray.posterior.rate_density import rate_distribution
from imuarray.posterior.target import CompiledTarget, GaussianPrior
from imuarray.recording import Recording
from imuarray.simulation import simulate_recording, simulate_samples
from imuarray.streams import stream


def simulate_dataset(settings: dict, samples: int):
    """T = ``samples`` of the 2021 setting: (recording, truth); section IV-A.

    The recording's nominal positions are the prior mean, off the truth as configured.
    """
    paper, model = settings["paper2021"], model_from(settings)
    seed = settings["seed"]
    motion = normal_motion(
        stream(seed, "motion", samples),
        (samples,),
        np.radians(paper["angular_rate_sd_dps"]),
        np.radians(paper["angular_acceleration_sd_dps2"]),
        paper["specific_force_sd"],
    )
    nominal = prior_mean(model.array, paper["prior_mean_error"], stream(seed, "prior mean"))
    return simulate_samples(
        model, motion, model.array.positions, nominal, stream(seed, "noise", samples),
        position_prior_sd=paper["prior_sd"], title=f"paper 2021, section IV-A, T = {samples}",
    )  # fmt: skip


def prior_mean(array: Array, error_sd: float, rng) -> np.ndarray:
    """Nominal positions (A, 3) m, each but the reference off by a normal error."""
    errors = error_sd * rng.standard_normal(array.positions.shape)
    errors[0] = 0.0
    return array.positions + errors


def simulate_twisting(
    settings: dict, accelerometer_sd: float, effects=(),
    extended: Callable[[ArrayModel], ArrayModel] | None = None,
):  # fmt: skip
    """A recording of the board twisted by hand, as section IV-C describes the experiment.

    Stands in for measured data until there are some. ``accelerometer_sd`` (m/s^2) is the
    noise that is really there; effects get parameters drawn from their priors.
    ``extended`` gives the model effects and noise of its own, whose starting values are the truth.
    """
    paper, experiment, seed = settings["paper2021"], settings["experiment"], settings["seed"]
    model = model_from(settings, accelerometer_sd, effects)
    sizes = model.effect_prior_sd
    parameters = sizes * stream(seed, "effects").standard_normal(sizes.shape)
    if extended is not None:
        model = extended(model)
        parameters = model.effect_start
    motion = hand_twisting(
        stream(seed, "twisting"),
        np.radians(paper["angular_rate_sd_dps"]) / 2,
        paper["specific_force_sd"],
        experiment["bandwidth"],
    )
    truth = prior_mean(model.array, paper["prior_mean_error"], stream(seed, "mounting"))
    return simulate_recording(
        model, motion, truth, model.array.positions,
        stream(seed, "twisting noise", f"{accelerometer_sd:g}"),
        experiment["sampling_rate"], experiment["duration"],
        gyroscope_range=np.radians(settings["paper2017"]["gyroscope_range_dps"]),
        position_prior_sd=paper["prior_sd"], title="simulated hand twisting",
        parameters=parameters,
    )  # fmt: skip


def select_disjoint(recording: Recording, counts) -> dict[int, np.ndarray]:
    """Disjoint sets of informative samples, one for each T in ``counts``.

    A sample is used when nothing saturates in it or next to it and it rotates faster than
    the median; the sets are spread evenly over the recording.
    """
    near = neighbours(recording.saturated_gyroscopes().any(axis=(1, 2)))
    speed = np.linalg.norm(recording.angular_rate.mean(axis=1), axis=1)
    return disjoint(np.flatnonzero(~near & (speed >= np.median(speed))), counts)


def target_for(
    settings: dict, recording: Recording, draws: int, accelerometer_sd=None, spread=False
):
    """The compiled target of a recording; its nominal positions are the prior mean.

    ``accelerometer_sd`` is what the likelihood assumes; ``spread`` takes p(omega | y_g)
    from (30a)/(30b) instead of the declared noise.
    """
    model = model_from(settings, accelerometer_sd)
    distribution = rate_distribution(recording) if spread else None
    likelihood = Likelihood.of(
        model, recording.specific_force, recording.angular_rate, rate_distribution=distribution
    )
    nominal = recording.relative_positions()
    prior = GaussianPrior.of(nominal[1:].ravel(), recording.position_prior_sd)
    return CompiledTarget(likelihood, prior, draws)


def mode_of(settings: dict, recording: Recording, accelerometer_sd=None) -> np.ndarray:
    """A high-probability theta to start the step-length sweep from: ML-BCD, kept near the prior.

    (3 (A - 1),) metres. Where few samples leave ML without bounds the prior mean serves.
    """
    model = model_from(settings, accelerometer_sd)
    start = recording.relative_positions()
    found = calibrate_bcd(
        model, recording.specific_force, recording.angular_rate, start=start, limit=1000,
        tolerance=1e-9,
    ).positions  # fmt: skip
    wild = np.max(np.abs(found - start)) > 3 * recording.position_prior_sd
    return (start if wild else found)[1:].ravel()


def starts_for(settings: dict, recording: Recording, names) -> np.ndarray:
    """Two different starts (2, 3 (A - 1)) m around the prior mean."""
    rng = stream(settings["seed"], *names, "starts")
    mean = recording.relative_positions()[1:].ravel()
    return mean + settings["paper2021"]["start_sd"] * rng.standard_normal((2, mean.size))


def tuned_experiment(settings: dict, recording: Recording, names, threads: int = 1):
    """(target, sigma_q, record) of section IV-B: sigma_a enlarged, (30a)/(30b), III-C.

    Where not even the largest N of the sweep brings the variance of log p-hat near its target,
    as in measured data, omega is drawn around the integrand's mode instead (`centred`);
    ``record`` says which, and the variance with p(omega | y_g) at the largest N.
    """
    from imuarray.posterior import tuning

    paper, scale, seed = settings["paper2021"], settings["scale"], settings["seed"]
    assumed = settings["experiment"]["accelerometer_sd"]
    likelihood = target_for(settings, recording, 1, assumed, spread=True).likelihood
    counts, mode = paper["sweep_draws"], None

    def sweep(likelihood, positions):
        return tuning.variance_sweep(
            likelihood, positions, counts, scale["variance_realisations"] // 4,
            stream(seed, *names, "variance"), threads,
        )  # fmt: skip

    variances = sweep(likelihood, recording.relative_positions())
    record = {
        "draws_from": "p(omega | y_g)",
        "variance_at_most_draws": float(variances[-1]), "most_draws": int(counts[-1]),
    }  # fmt: skip
    if variances.min() > 2 * paper["variance_target"]:
        from imuarray.measured.positions import locate

        mode = locate(recording, assumed).mean
        record["draws_from"] = "integrand's mode"
        likelihood = likelihood.centred(mode)
        variances = sweep(likelihood, mode)
    draws = tuning.choose_draws(counts, variances, paper["variance_target"])
    target = replace(target_for(settings, recording, draws, assumed, spread=True),
                     likelihood=likelihood)  # fmt: skip
    sweep = paper["sweep_steps"]
    # the enlarged noise widens the posterior, so the same sweep ten times longer
    steps = 10 * np.geomspace(*(sweep[key] for key in ("first", "last", "count")))
    rates = tuning.acceptance_sweep(
        target,
        mode_of(settings, recording, assumed) if mode is None else mode[1:].ravel(),
        steps,
        scale["acceptance_steps"],
        stream(seed, *names, "acceptance"),
        threads,
    )
    return target, tuning.choose_step(steps, rates, paper["acceptance_target"]), record
