"""The work behind `imuarray simulate`, `calibrate` and `sample`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.commands_model import assumed, chosen_model, extender, usable
from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.model.effects import find_effects
from imuarray.provenance import code_digest, digest, stamp, write_netcdf
from imuarray.recording import read_recording, write_recording

PMMH_STEPS = {True: 200_000, False: 10_000}  # compiled, any effects
STORED = 2000
RHAT_THRESHOLD = 1.05
VARIANCE = 0.1  # wanted of log p-hat, section III-C of paper 2021
MISFIT = 1.5  # residual over declared noise from which the claimed widths are called too small


def simulate(arguments) -> None:
    """A recording of hand twisting with the config's array, noise and sampling."""
    from imuarray.config import read_config
    from imuarray.studies.bayes import simulate_twisting

    config = read_config(arguments.config)
    noise = config["noise"]["accelerometer_sd"]
    recording, truth = simulate_twisting(config, noise, arguments.effects, extender(arguments))
    write_recording(recording, arguments.out, truth, stamp(config, config["seed"]))
    if not arguments.quiet:
        samples, accelerometers = recording.specific_force.shape[:2]
        print(f"{arguments.out}: {samples} samples of {accelerometers} accelerometer triads")


def calibrate(arguments) -> None:
    """Positions and motion by maximum likelihood; see `calibration_dataset` for the output."""
    from imuarray.estimation import calibrate_bcd, calibrate_gauss_newton

    recording = usable(read_recording(arguments.recording), arguments.quiet)
    recording = assumed(recording, arguments)
    model = chosen_model(recording, arguments)
    data = recording.specific_force, recording.angular_rate
    saturated = recording.saturated_gyroscopes()
    find_effects(arguments.effects)  # an unknown one is named before anything else
    if arguments.method == "bcd":
        if model.effects:
            raise InputError(
                "--effects: expected --method gauss-newton (bcd is for the papers' model), found"
                f" bcd with {', '.join(model.effects)}"
            )
        found = calibrate_bcd(model, *data, saturated=saturated, tolerance=1e-9)
    else:
        prior = (model.array.parameters, recording.position_prior_sd) if model.effects else None
        found = calibrate_gauss_newton(
            model, *data, saturated=saturated, position_prior=prior, time=recording.time
        )
    dataset = calibration_dataset(recording, model, found, saturated)
    dataset.attrs |= {"method": arguments.method, **stamp({"recording": digest(*data)}, 0)}
    write_netcdf(dataset, arguments.out)
    if not arguments.quiet:
        _report(recording, found, dataset)
        _say_misfit(recording, found, saturated)


def calibration_dataset(recording, model, found, saturated) -> xr.Dataset:
    """``cal.nc``: positions with covariance, motion per sample, the iteration's trace."""
    from imuarray.estimation.gauss_newton import parameter_covariance

    covariance = found.covariance
    if covariance is None:
        covariance = parameter_covariance(
            model, recording.specific_force, recording.angular_rate, found, saturated
        )
    count, size = model.array.accelerometers, 3 * (model.array.accelerometers - 1)
    whole = np.zeros((count, 3, count, 3))
    whole[1:, :, 1:, :] = covariance[:size, :size].reshape(count - 1, 3, count - 1, 3)
    labels = list(recording.accelerometer_labels)
    place, motion = ("accelerometer", "axis"), found.motion.motion
    variables = {
        "position": (place, found.positions, {"units": "m", "relative_to": labels[0]}),
        "position_covariance": (
            (*place, "accelerometer_other", "axis_other"), whole, {"units": "m2"}
        ),
        "angular_rate": (("time", "axis"), motion.angular_rate, {"units": "rad s-1"}),
        "angular_acceleration": (
            ("time", "axis"), motion.angular_acceleration, {"units": "rad s-2"}
        ),
        "specific_force": (("time", "axis"), motion.specific_force, {"units": "m s-2"}),
        "motion_converged": (("time",), found.motion.converged),
        "cost": (("iteration",), found.cost),
        "position_step": (("iteration",), found.step, {"units": "m"}),
    }  # fmt: skip
    coords = {
        "time": recording.time, "accelerometer": labels, "axis": list("xyz"),
        "accelerometer_other": labels, "axis_other": list("xyz"),
    }  # fmt: skip
    dataset = xr.Dataset(variables, coords, {"converged": int(found.converged)})
    if model.effects:
        dataset["effect_parameter"] = (("parameter",), found.effect_parameters)
        dataset["effect_sd"] = (("parameter",), np.sqrt(np.diag(covariance)[size:]))
        dataset = dataset.assign_coords(parameter=effect_names(model))
    return dataset


def effect_names(model: ArrayModel) -> list[str]:
    """A name for each flat effect parameter: id[i, j] unit."""
    names = []
    for item, shape in zip(model.chain, model.shapes, strict=True):
        names += [f"{item.id}[{', '.join(map(str, i))}] {item.unit}" for i in np.ndindex(*shape)]
    return names


def _report(recording, found, dataset) -> None:
    sds = np.sqrt(np.einsum("kaka->ka", dataset["position_covariance"].to_numpy()))
    state = "converged" if found.converged else "NOT converged"
    print(f"{state} after {len(found.cost)} iterations, {len(recording.time)} samples")
    print("triad   x mm      y mm      z mm    (sd um)")
    for label, row, sd in zip(recording.accelerometer_labels, found.positions, sds, strict=True):
        values = "  ".join(f"{1e3 * value:8.4f}" for value in row)
        print(f"{label:>5} {values}    {', '.join(f'{1e6 * value:.2g}' for value in sd)}")


def _say_misfit(recording, found, saturated) -> None:
    """One line where the residual is not what the declared noise explains."""
    samples, count = recording.specific_force.shape[:2]
    values = 3 * samples * (count + recording.angular_rate.shape[1]) - int(saturated.sum())
    freedom = values - 9 * samples - 3 * (count - 1)
    ratio = float(np.sqrt(found.cost[-1] / freedom)) if freedom > 0 else 1.0
    if ratio > MISFIT:
        print(f"residual {ratio:.3g} times the declared noise: the model misses something, and the"
              " sds above are too small, by that or more")  # fmt: skip


def sample(arguments) -> None:
    """Two PmMH chains, tuned as in section III-C of paper 2021; continues a checkpoint."""
    from imuarray.posterior import run_chains
    from imuarray.posterior.store import write_chains
    from imuarray.posterior.summary import summarise

    recording = usable(read_recording(arguments.recording), arguments.quiet)
    recording = assumed(recording, arguments)
    model = chosen_model(recording, arguments)
    if model.effects and arguments.rates == "spread":
        raise InputError("--rates spread: expected no --effects with it, found some")
    if not arguments.quiet:
        print("tuning N and the step length ...", flush=True)
    target, mode, step, draws = _tuned(recording, model, arguments)
    steps = arguments.steps or PMMH_STEPS[not model.effects]
    thin = max(1, steps // STORED)
    key = digest(
        recording.specific_force, recording.angular_rate, recording.accelerometer_position,
        model.noise.accelerometer, model.noise.gyroscope, target.prior.mean, target.prior.sd,
        draws, step, steps, arguments.seed, list(model.effects), arguments.rates, code_digest(),
    )  # fmt: skip
    checkpoint = arguments.out.with_name(f".{arguments.out.name}.{key[:16]}.npz")
    for other in arguments.out.parent.glob(f".{arguments.out.name}.*.npz"):
        if other != checkpoint:
            print(f"{other}: a checkpoint of other data, settings or code, not continued")
    rng = _stream(arguments.seed, "starts")
    spread = target.prior.sd / 3
    starts = np.array([mode, mode + 0.0])
    starts += spread * rng.standard_normal(starts.shape)
    chains = run_chains(
        target, starts, step, max(4, steps // thin), thin, arguments.seed,
        checkpoint=checkpoint, key=key, quiet=arguments.quiet,
    )  # fmt: skip
    labels = recording.accelerometer_labels[1:]
    verdict, table, _ = summarise(chains, labels, RHAT_THRESHOLD)
    attrs = stamp({"recording": key, "draws_per_sample": draws}, arguments.seed)
    attrs |= {name: verdict[name] for name in ("burn_in_draws", "rhat_max", "ess_min")}
    write_chains(arguments.out, chains, labels, target.prior, attrs, effect_names(model))
    Path(checkpoint).unlink(missing_ok=True)
    if not arguments.quiet:
        print("triad axis   mean mm   sd um")
        for row in table.itertuples():
            numbers = f"{1e3 * row.mean_m:9.4f} {1e6 * row.sd_m:7.2g}"
            print(f"{row.accelerometer:>5} {row.axis:>4} {numbers}")
        state = "converged" if verdict["converged"] else "NOT converged: take more --steps"
        print(f"{state}: R-hat {verdict['rhat_max']:.3f}, smallest ESS {verdict['ess_min']:.0f},"
              f" burn-in {verdict['burn_in_steps']} of {verdict['steps']} steps")  # fmt: skip


def _stream(seed, name):
    from imuarray.streams import stream

    return stream(seed, "sample", name)


def _tuned(recording, model, arguments):
    """(target, start near the mode, step length, N), tuned as in section III-C."""
    from imuarray.posterior import CompiledTarget, GaussianPrior, Likelihood, tuning
    from imuarray.studies.bayes import sample_covariance

    nominal, prior_sd = model.array.parameters, recording.position_prior_sd
    if model.effects:
        return _tuned_generic(recording, model, arguments)
    spread = arguments.rates == "spread"
    likelihood = Likelihood.of(
        model, recording.specific_force, recording.angular_rate, recording.saturated_gyroscopes(),
        rate_distribution=sample_covariance(recording.angular_rate) if spread else None,
    )  # fmt: skip
    prior = GaussianPrior.of(nominal, prior_sd)
    counts, rng = [1, 2, 5, 10, 20, 50, 100], _stream(arguments.seed, "tuning")
    variances = tuning.variance_sweep(likelihood, model.array.relative, counts, 200, rng)
    mode = _mode(recording, model, spread)
    if variances.min() > 2 * VARIANCE:
        if not arguments.quiet:
            print(f"variance of log p-hat {variances[-1]:.3g} at N = {counts[-1]}: omega is drawn"
                  " around the integrand's mode instead")  # fmt: skip
        centre = np.vstack([np.zeros(3), mode.reshape(-1, 3)])
        likelihood = likelihood.centred(centre)
        variances = tuning.variance_sweep(likelihood, centre, counts, 200, rng)
    draws = tuning.choose_draws(counts, variances, VARIANCE)
    target = CompiledTarget(likelihood, prior, draws)
    steps = prior_sd * np.geomspace(1e-6, 0.3, 16)
    rates = tuning.acceptance_sweep(target, mode, steps, 1000, rng)
    return target, mode, tuning.choose_step(steps, rates), draws


def _mode(recording, model, spread: bool) -> np.ndarray:
    """MAP (r_2 ... r_A): the chains' starts spread around it."""
    from imuarray.measured.positions import locate

    if spread:
        return locate(recording, recording.accelerometer_noise_sd).mean[1:].ravel()
    return _map_estimate(recording, model)[0]


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


def _tuned_generic(recording, model, arguments):
    """The same for a model with effects: Laplace-centred importance sampling of omega."""
    from imuarray.estimation.blocks import pack_motion
    from imuarray.posterior import GaussianPrior, GenericTarget, tuning
    from imuarray.posterior.generic import GenericLikelihood

    mode, found = _map_estimate(recording, model)
    start = pack_motion(model, found.motion.motion)
    estimate = GenericLikelihood(
        model.with_motion(found.motion.motion), recording.specific_force,
        recording.angular_rate, start, draws=2, saturated=recording.saturated_gyroscopes(),
        time=recording.time,
    )  # fmt: skip
    size = 3 * (model.array.accelerometers - 1)
    mean = np.concatenate([model.array.parameters, model.effect_prior_mean])
    prior_sd = np.full(mean.size, recording.position_prior_sd)
    prior_sd[size:] = model.effect_prior_sd
    target = GenericTarget(
        estimate, GaussianPrior.of(mean, prior_sd), np.linalg.cholesky(found.covariance)
    )
    steps = np.geomspace(1e-3, 1.0, 8)
    rng = _stream(arguments.seed, "tuning")
    rates = tuning.acceptance_sweep(target, mode, steps, 200, rng)
    return target, mode, tuning.choose_step(steps, rates), estimate.draws
