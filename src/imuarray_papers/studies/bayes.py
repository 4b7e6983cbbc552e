"""The Bayesian studies of paper 2021: data, targets and chains from a configuration."""

from pathlib import Path

import numpy as np
from scipy.ndimage import binary_dilation

from imuarray.analysis.selection import disjoint
from imuarray.geometry import Array
from imuarray.motion import hand_twisting, normal_motion
from imuarray.posterior.chains import chain_tree
from imuarray.posterior.prior import GaussianPrior
from imuarray.provenance import code_digest, digest, stamp, write_netcdf
from imuarray.recording import Recording
from imuarray.simulation.recordings import simulate_recording, simulate_samples
from imuarray.streams import stream
from imuarray_papers.config import model_from, motion_sds
from imuarray_papers.estimation.bcd import calibrate_bcd
from imuarray_papers.measured.positions import locate
from imuarray_papers.posterior import tuning
from imuarray_papers.posterior.likelihood import CompiledTarget, Likelihood
from imuarray_papers.posterior.pmmh import run_chains, spread_starts
from imuarray_papers.posterior.proposals import rate_distribution


def simulate_dataset(settings: dict, samples: int):
    """T = ``samples`` of the 2021 setting: (recording, truth); section IV-A.

    The recording's nominal positions are the prior mean, off the truth as configured.
    """
    paper, model = settings["paper2021"], model_from(settings)
    seed = settings["seed"]
    motion = normal_motion(stream(seed, "motion", samples), (samples,), *motion_sds(settings))
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


def simulate_twisting(settings: dict, accelerometer_sd: float):
    """A recording of the board twisted by hand, as section IV-C describes the experiment.

    ``accelerometer_sd`` (m/s^2) is the noise that is really there.
    """
    paper, experiment, seed = settings["paper2021"], settings["experiment"], settings["seed"]
    model = model_from(settings, accelerometer_sd)
    motion = hand_twisting(
        stream(seed, "twisting"), np.radians(paper["angular_rate_sd_dps"]) / 2,
        paper["specific_force_sd"], experiment["bandwidth"],
    )  # fmt: skip
    truth = prior_mean(model.array, paper["prior_mean_error"], stream(seed, "mounting"))
    return simulate_recording(
        model, motion, truth, model.array.positions,
        stream(seed, "twisting noise", f"{accelerometer_sd:g}"),
        experiment["sampling_rate"], experiment["duration"],
        gyroscope_range=np.radians(settings["paper2017"]["gyroscope_range_dps"]),
        position_prior_sd=paper["prior_sd"], title="simulated hand twisting",
    )  # fmt: skip


def select_disjoint(recording: Recording, counts) -> dict[int, np.ndarray]:
    """Disjoint sets of informative samples, one for each T in ``counts``.

    A sample is used when nothing saturates in it or next to it and it rotates faster than
    the median; the sets are spread evenly over the recording.
    """
    near = binary_dilation(recording.at_rail("gyroscope"))
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


def tuned_experiment(settings: dict, recording: Recording, names, threads: int = 1):
    """(target, sigma_q, record) of section IV-B: sigma_a enlarged, (30a)/(30b), III-C.

    ``record`` says where omega is drawn from, and the variance with p(omega | y_g) at the largest N
    of the sweep.
    """
    paper, scale, seed = settings["paper2021"], settings["scale"], settings["seed"]
    assumed = settings["experiment"]["accelerometer_sd"]
    target = target_for(settings, recording, 1, assumed, spread=True)

    def mode(centred):
        if centred:
            return locate(recording, assumed).mean[1:].ravel()
        return mode_of(settings, recording, assumed)

    swept = paper["sweep_steps"]
    sweeps = tuning.Sweeps(
        # the enlarged noise widens the posterior, so the same sweep ten times longer
        10 * np.geomspace(*(swept[key] for key in ("first", "last", "count"))),
        paper["sweep_draws"], scale["variance_realisations"] // 4, scale["acceptance_steps"],
        paper["variance_target"], paper["acceptance_target"],
    )  # fmt: skip
    found = tuning.tune(
        target.likelihood, target.prior, recording.relative_positions(), mode, sweeps,
        lambda name: stream(seed, *names, name), threads,
    )  # fmt: skip
    record = {
        "draws_from": "integrand's mode" if found.centred else "p(omega | y_g)",
        "variance_at_most_draws": float(found.variances[-1]),
        "most_draws": int(sweeps.draws[-1]),
    }
    return found.target, found.step, record


def sample_paired(settings, recording, target, step, transitions, names, path, attrs, threads):
    """Two chains of ``transitions`` steps; the checkpoint is keyed by config, data and code."""
    draws = settings["scale"]["draws"]
    key = digest(
        settings, recording.specific_force, recording.angular_rate, step, target.draws,
        code_digest(),
    )  # fmt: skip
    path, seed = Path(path), settings["seed"]
    checkpoint = path.with_name(f".{path.name}.{key[:16]}.npz")  # hidden, beside what is written
    starts = spread_starts(
        target.prior.mean, settings["paper2021"]["start_sd"], stream(seed, *names, "starts")
    )
    chains = run_chains(
        target, starts, step, draws, transitions // draws, seed, names,
        checkpoint=checkpoint, key=key, threads=threads,
    )  # fmt: skip
    labels = recording.accelerometer_labels[1:]
    write_netcdf(chain_tree(chains, labels, target.prior, stamp(settings, seed) | attrs), path)
    checkpoint.unlink(missing_ok=True)
