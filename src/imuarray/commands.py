"""The work behind `imuarray simulate` and `calibrate`."""

from __future__ import annotations

import numpy as np
import xarray as xr

from imuarray.commands_model import assumed, chosen_model, extender, usable
from imuarray.errors import InputError
from imuarray.model.effects import find_effects
from imuarray.model.names import parameter_names
from imuarray.provenance import digest, stamp, write_netcdf
from imuarray.recording import read_recording, write_recording

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
            asked = "--effects" if arguments.effects else "--diagnosis"
            raise InputError(
                f"{asked}: expected --method gauss-newton (bcd is for the papers' model), found"
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
        if model.effects:
            _say_effects(dataset)
        _say_informative(recording, found, dataset)
        _say_misfit(recording, model, found, saturated)


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
        imus = recording.accelerometer_labels, recording.gyroscope_labels
        dataset["effect_parameter"] = (("parameter",), found.effect_parameters)
        dataset["effect_sd"] = (("parameter",), np.sqrt(np.diag(covariance)[size:]))
        dataset = dataset.assign_coords(parameter=parameter_names(model, imus))
    return dataset


def _report(recording, found, dataset) -> None:
    sds = np.sqrt(np.einsum("kaka->ka", dataset["position_covariance"].to_numpy()))
    state = "converged" if found.converged else "NOT converged"
    print(f"{state} after {len(found.cost)} iterations, {len(recording.time)} samples")
    print("triad   x mm      y mm      z mm    (sd um)")
    for label, row, sd in zip(recording.accelerometer_labels, found.positions, sds, strict=True):
        values = "  ".join(f"{1e3 * value:8.4f}" for value in row)
        print(f"{label:>5} {values}    {', '.join(f'{1e6 * value:.2g}' for value in sd)}")


def _say_effects(dataset) -> None:
    """The effects' parameters, in their own units (docs/effects.md)."""
    print("effect parameter: value (sd)")
    names = dataset["parameter"].to_numpy()
    columns = names, dataset["effect_parameter"].to_numpy(), dataset["effect_sd"].to_numpy()
    for name, value, sd in zip(*columns, strict=True):
        print(f"{name}: {value:.4g} ({sd:.2g})")


def _say_informative(recording, found, dataset) -> None:
    """How well the recording tells the positions, and which combinations of them worst."""
    from imuarray.estimation.informative import weak_directions

    size = 3 * (len(found.positions) - 1)
    covariance = dataset["position_covariance"].to_numpy()[1:, :, 1:, :].reshape(size, size)
    worst = weak_directions(found.positions, covariance, recording.accelerometer_labels)
    rms = np.sqrt(np.trace(covariance) / size)
    said = ", ".join(f"{item.words} ({1e6 * item.sd:.2g} um)" for item in worst)
    print(f"positions to {1e6 * rms:.2g} um rms by the Cramer-Rao bound; told worst: {said}")
    if worst[0].sd > recording.position_prior_sd:
        print(f"{worst[0].words}: told worse than the nominal positions' own"
              f" {1e3 * recording.position_prior_sd:g} mm; turn the array faster, and about all"
              " axes")  # fmt: skip


def _say_misfit(recording, model, found, saturated) -> None:
    """One line where the residual is not what the declared noise explains."""
    samples, count = recording.specific_force.shape[:2]
    values = 3 * samples * (count + recording.angular_rate.shape[1]) - int(saturated.sum())
    freedom = values - 9 * samples - 3 * (count - 1)
    ratio = float(np.sqrt(_misfit(recording, model, found, saturated) / max(freedom, 1)))
    if freedom > 0 and ratio > MISFIT:
        print(f"residual {ratio:.3g} times the declared noise: the model misses something, and the"
              " sds above are too small, by that or more")  # fmt: skip


def _misfit(recording, model, found, saturated) -> float:
    """Chi-square of the residuals; the estimators of the papers' model know it to a constant."""
    if model.effects:
        return float(found.cost[-1])
    force, rate = model.predict_many(found.motion.motion, found.positions)
    return model.noise.misfit(
        recording.specific_force - force, recording.angular_rate - rate, saturated
    )
