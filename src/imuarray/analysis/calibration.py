"""Positions and motion of a recording by maximum likelihood, as one labelled dataset."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

import numpy as np
import xarray as xr

from imuarray.analysis import methods
from imuarray.analysis.model import Say, chosen_model, silent, usable
from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.model.array_model import clock
from imuarray.model.effects import find_effects
from imuarray.model.names import parameter_names
from imuarray.motion.state import UNITS
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording


def calibrate(
    recording: Recording, method: str = "bcd", effects: Sequence[str] = (),
    diagnosis: str | PathLike | None = None, accelerometer_noise: float | None = None,
    say: Say = silent,
) -> xr.Dataset:  # fmt: skip
    """Accelerometer positions and motion by maximum likelihood (paper 2017).

    Parameters
    ----------
    recording
        Moving samples; still poses and samples with an accelerometer at its rail are left out.
    method
        ``"bcd"``: block coordinate descent, algorithm 1 of paper 2017; ``"gauss-newton"``: the
        same optimum in a few iterations, and the only one with ``effects``.
    effects
        Names of effects that extend the measurement model (docs/effects.md).
    diagnosis
        A ``diagnosis.json`` whose extended model to use instead of ``effects``.
    accelerometer_noise
        Assumed sd in m/s^2, by default what the recording declares.
    say
        Called with each remark on what was left out.

    Returns
    -------
    xarray.Dataset
        ``position`` (accelerometer, axis) m, relative to the first triad, beside
        ``nominal_position``, and ``position_covariance`` m^2; the motion at each sample:
        ``angular_rate`` rad/s, ``angular_acceleration`` rad/s^2, ``specific_force`` m/s^2,
        ``motion_converged``; the trace ``cost`` and ``position_step`` m of the iterations; with
        effects ``effect_parameter`` and ``effect_sd``. Attributes ``converged`` (0 or 1),
        ``residual_ratio`` (rms residual over the declared noise), ``method``, and the origin
        (config, seed, versions).

    Raises
    ------
    InputError
        The recording does not determine the positions, or the options do not go together.
    """
    from imuarray.estimation import calibrate_bcd, calibrate_gauss_newton

    if method not in methods.CALIBRATION:
        known = ", ".join(methods.CALIBRATION)
        raise InputError(f"method: expected any of {known}, found {method!r}")
    recording, model = chosen_model(
        usable(recording, say), effects, diagnosis, accelerometer_noise, say
    )
    find_effects(effects)  # an unknown one is named before anything else
    data = recording.specific_force, recording.angular_rate
    saturated = recording.saturated_gyroscopes()
    if method == "bcd":
        if model.effects:
            asked = "--effects" if effects else "--diagnosis"
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
    dataset.attrs |= {"method": method, **stamp({"recording": digest(*data)}, 0)}
    return dataset


def calibration_dataset(recording: Recording, model: ArrayModel, found, saturated) -> xr.Dataset:
    """What `calibrate` returns, of an estimator's result."""
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
    place = ("accelerometer", "axis")
    variables = {
        "position": (place, found.positions, {"units": "m", "relative_to": labels[0]}),
        "nominal_position": (place, model.array.relative, {"units": "m"}),
        "position_covariance": (
            (*place, "accelerometer_other", "axis_other"), whole, {"units": "m2"}
        ),
        **{
            name: (("time", "axis"), getattr(found.motion.motion, name), {"units": unit})
            for name, unit in UNITS.items()
        },
        "motion_converged": (("time",), found.motion.converged),
        "cost": (("iteration",), found.cost),
        "position_step": (("iteration",), found.step, {"units": "m"}),
    }  # fmt: skip
    coords = {
        "time": recording.time, "accelerometer": labels, "axis": list("xyz"),
        "accelerometer_other": labels, "axis_other": list("xyz"),
    }  # fmt: skip
    attrs = {
        "converged": int(found.converged),
        "residual_ratio": residual_ratio(recording, model, found, saturated),
        "position_prior_sd": recording.position_prior_sd,
    }
    dataset = xr.Dataset(variables, coords, attrs)
    if model.effects:
        dataset = dataset.merge(
            _effects(recording, model, found, covariance), combine_attrs="no_conflicts"
        )
    return dataset


def _effects(recording: Recording, model: ArrayModel, found, covariance) -> xr.Dataset:
    """The effects' parameters, and what `imuarray.apply` needs to use them."""
    imus = recording.accelerometer_labels, recording.gyroscope_labels
    size = 3 * (model.array.accelerometers - 1)
    sds = np.sqrt(np.diag(model.noise.accelerometer)), np.sqrt(np.diag(model.noise.gyroscope))
    variables = {
        "effect_parameter": (("parameter",), found.effect_parameters),
        "effect_sd": (("parameter",), np.sqrt(np.diag(covariance)[size:])),
        # of r_2 ... r_A, then the effects' parameters
        "whole_covariance": (("unknown", "unknown_other"), covariance),
        "accelerometer_sd": (("accelerometer", "axis"), sds[0].reshape(-1, 3), {"units": "m s-2"}),
        "gyroscope_sd": (("gyroscope", "axis"), sds[1].reshape(-1, 3), {"units": "rad s-1"}),
    }
    coords = {"parameter": parameter_names(model, imus), "gyroscope": list(imus[1])}
    origin, span = model.clock or (float(np.min(recording.time)), clock(recording.time)[1])
    attrs = {"effects": ",".join(model.effects), "time_origin": origin, "span": span}
    return xr.Dataset(variables, coords, attrs)


def residual_ratio(recording: Recording, model: ArrayModel, found, saturated) -> float:
    """Rms residual over the declared noise, degrees of freedom allowed for; NaN without any."""
    samples, count = recording.specific_force.shape[:2]
    values = 3 * samples * (count + recording.angular_rate.shape[1]) - int(saturated.sum())
    # with effects the positions have a prior, which is in the cost and pays for them
    freedom = values - 9 * samples - (0 if model.effects else 3 * (count - 1))
    if freedom <= 0:
        return float("nan")
    return float(np.sqrt(_misfit(recording, model, found, saturated) / freedom))


def _misfit(recording: Recording, model: ArrayModel, found, saturated) -> float:
    """Chi-square of the residuals; the estimators of the papers' model know it to a constant."""
    if model.effects:
        return float(found.cost[-1])
    force, rate = model.predict_many(found.motion.motion, found.positions)
    return model.noise.misfit(
        recording.specific_force - force, recording.angular_rate - rate, saturated
    )
