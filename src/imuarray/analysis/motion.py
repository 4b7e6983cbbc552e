"""The calibrated array as one sensor: what calibration is for."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from imuarray.analysis.beside import fused
from imuarray.analysis.model import assumed
from imuarray.engine.clocks import CLOCK
from imuarray.engine.fusion import COMPONENTS, fuse
from imuarray.engine.parameters import model_of
from imuarray.errors import InputError, require
from imuarray.firstorder.correct import taken_out
from imuarray.firstorder.rails import less_leak
from imuarray.model import ArrayModel
from imuarray.model.array_model import parameter_names
from imuarray.model.effects import find_effects
from imuarray.model.noise import Noise
from imuarray.motion import Motion
from imuarray.motion.state import UNITS
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording
from imuarray.recording.record import CORRECTION, KINDS, MATRICES
from imuarray.trust import effect_names, require_fit, require_labels, values_of


def apply(
    calibration: xr.Dataset, recording: Recording, accelerometer_noise: float | None = None
) -> xr.Dataset:
    """Motion of the reference triad at each sample, with covariances.

    ``calibration``: what `calibrate` gave for a recording of the same IMUs, with effects or
    without; where effects look at the time (drifts) it must be the same recording, or a part of
    it. A recording as read is corrected as the calibration's was. Where motion is rough and the
    IMUs have clocks of their own, biases and clocks are found anew. A gyroscope at its rail says on
    which side the rate is and what it is at least, no more. ``accelerometer_noise``: assumed sd in
    m/s^2, by default the calibration's.

    Returns ``angular_rate`` (time, axis) rad/s, ``angular_acceleration`` rad/s^2 and
    ``specific_force`` m/s^2, each with ``_sd`` and the part of it that is due to the calibration,
    ``_sd_from_calibration`` (NaN for a diagnosis, which does not tell it: sds are the noise's
    alone then); ``motion_covariance`` (time, component, component_other);
    ``converged``, and the flags ``gyroscope_at_rail`` and ``accelerometer_at_rail`` (time; the
    motion is NaN where an accelerometer is, and of two IMUs where an axis has no gyroscope off its
    rail). Attribute ``residual_ratio``: under effects, residual over noise of the median fast
    sample (NaN of two IMUs and where clocks are found anew). InputError says what does not fit
    together.
    """
    parts = list(motion_parts(calibration, recording, accelerometer_noise))
    return parts[0] if len(parts) == 1 else xr.concat(
        parts, "time", data_vars="minimal", coords="minimal", compat="override", join="override",
        combine_attrs="override",
    )  # fmt: skip


def motion_parts(
    calibration: xr.Dataset, recording: Recording, accelerometer_noise: float | None = None
) -> Iterator[xr.Dataset]:
    """`apply` of one part of the recording's samples after the other.

    Where samples depend on each other (two IMUs, IMUs on clocks of their own) there is one part.
    """
    recording = as_calibrated(assumed(recording, accelerometer_noise), calibration)
    require_fit(calibration, recording)
    used = [calibration[name].to_numpy() for name in sorted(map(str, calibration.data_vars))]
    data = digest(recording.specific_force, recording.angular_rate, *used)
    origin, clocks = recording.time[0], CLOCK in effect_names(calibration)
    together = len(recording.accelerometer_labels) < 3 or clocks
    for part in [recording.in_memory()] if together else recording.parts():
        dataset = _motion_of(calibration, part, accelerometer_noise, origin)
        dataset.attrs |= stamp({"recording and calibration": data}, 0)
        yield dataset


def as_calibrated(recording: Recording, calibration: xr.Dataset) -> Recording:
    """A recording as read, corrected as the (first) one of the calibration was; others as they are.

    The offsets are those of then. InputError where the sensors are others.
    """
    if recording.correction is not None or not set(CORRECTION) <= set(calibration.variables):
        return recording
    require_fit(calibration)
    require_labels(calibration, recording)
    first, recording = calibration[list(CORRECTION)].isel(recording=0), recording.in_memory()
    changed: dict[str, Any] = {
        name: calibration[name].to_numpy() if name in calibration else None for name in MATRICES
    }
    for kind in KINDS:
        inverse, offset = (first[f"{kind}_{part}"].to_numpy() for part in ("inverse", "offset"))
        changed |= taken_out(recording, kind, np.linalg.inv(inverse), inverse, offset)
    places = calibration["nominal_position"].to_numpy()
    return replace(recording, correction=first, accelerometer_position=places, **changed)


def _motion_of(calibration, recording: Recording, accelerometer_noise, origin) -> xr.Dataset:
    saturated = recording.saturated_gyroscopes()
    try:
        found, anew = motion_under(calibration, recording, saturated, accelerometer_noise, origin)
    except np.linalg.LinAlgError as error:
        raise InputError(f"expected a calibration that determines the motion: {error}") from None
    if saturated.any() and recording.correction is not None:
        rate = found.estimate.motion.angular_rate
        whole, leak = less_leak(recording, recording.correction, rate, saturated)
        spread = leak @ found.covariance[:, :3, :3] @ np.swapaxes(leak, 1, 2)
        found, anew = motion_under(calibration, whole, saturated, accelerometer_noise, origin)
        found.covariance[:, :3, :3] += np.nan_to_num(spread)
    found = _with_common_map(found, calibration, recording)
    railed = recording.at_rail("accelerometer")
    lost = railed | np.isnan(found.estimate.cost)
    if not (np.einsum("tii->ti", found.covariance)[~lost] > 0).all():  # NaN, too
        raise InputError("expected a calibration that gives the motion variances, found none")
    dataset = motion_dataset(recording, found, lost)
    if "effect_parameter" in calibration and "whole_covariance" not in calibration:
        for name in UNITS:
            dataset[f"{name}_sd_from_calibration"][:] = np.nan
    dataset["gyroscope_at_rail"] = (("time",), saturated.any(axis=(1, 2)))
    dataset["accelerometer_at_rail"] = (("time",), railed)
    own = anew or not effect_names(calibration)
    ratio = np.nan if own else _residual(recording, found.estimate, lost | saturated.any((1, 2)))
    late = _late(calibration)
    return dataset.assign_attrs(own_clocks=int(anew), late_s=late, residual_ratio=ratio)


def _residual(recording: Recording, estimate, lost) -> float:
    """Residual over noise of the fastest quarter's median sample: shocks do not count."""
    speed = np.where(lost, np.nan, np.linalg.norm(estimate.motion.angular_rate, axis=1))
    counts = len(recording.accelerometer_labels), len(recording.gyroscope_labels)
    number = 3 * sum(counts) - 3 * sum(field is not None for field in estimate.motion)
    if lost.all() or counts[0] < 3:
        return np.nan
    fast = speed > np.nanquantile(speed, 0.75)
    return float(np.sqrt(np.median(estimate.cost[fast]) / number))


def _late(calibration: xr.Dataset) -> float:
    """By how much (s) the motion is late for its stamps, by the clock of most IMUs.

    What is common to the delays of all IMUs is nowhere seen: their mean is taken for zero. With
    clocks of their own, the delays are the offsets of these; else accelerometers' own lags are.
    """
    clocks = values_of(calibration, "sensor_clock offset").values()
    lags = values_of(calibration, "accelerometer_filter lag").values()
    delays = values_of(calibration, "sensor_delay ").values() or [-x for x in clocks] or lags
    return float(np.median([*delays])) if delays else 0.0


def _with_common_map(found, calibration: xr.Dataset, recording: Recording):
    """The angular rate as uncertain as the map is that all gyroscopes share.

    Its errors are the same at all samples. Where the calibration has estimated the gyroscopes'
    maps, their common scale alone is left.
    """
    rate = np.asarray(found.estimate.motion.angular_rate)
    effects = find_effects(effect_names(calibration))
    if any(item.resizes and item.kinds == [1] for item in effects):
        scale_sd = np.nan_to_num(calibration.attrs.get("gyroscope_common_scale_sd", np.nan))
        own = scale_sd**2 * rate[:, :, None] * rate[:, None]
    elif recording.gyroscope_common_covariance is None:
        return found
    else:
        spread = recording.gyroscope_common_covariance.reshape(3, 3, 3, 3)
        own = np.einsum("tj,ijkl,tl->tik", rate, spread, rate)
    more = np.zeros((len(rate), 9, 9))
    more[:, :3, :3] = own
    return found._replace(
        covariance=found.covariance + more, from_calibration=found.from_calibration + more
    )


def motion_under(
    calibration: xr.Dataset, recording: Recording, saturated,
    accelerometer_noise: float | None, origin: float,
):  # fmt: skip
    """(`Fused`, whether clocks are its own) under a calibration's model, its noise as calibrated.

    ``saturated`` (T, G, 3) bool: gyroscope axes to be left out; ``origin`` (s): of the recording.
    """
    positions, attrs = calibration["position"].to_numpy(), calibration.attrs
    parameters = (positions - positions[0])[1:].ravel()
    since, span = recording.time - origin, None
    block = calibration["position_covariance"].to_numpy()[1:, :, 1:, :]
    covariance: np.ndarray | None = block.reshape((parameters.size,) * 2)
    extended = "effect_parameter" in calibration
    model = model_of(recording, effect_names(calibration) if extended else ())
    if extended:
        _require_parameters(calibration, recording, model)
        parameters = np.append(parameters, calibration["effect_parameter"].to_numpy())
        whole = calibration.get("whole_covariance")
        covariance = None if whole is None else whole.to_numpy()
        since, span = recording.time - attrs["time_origin"], attrs["span"]
    sds = [calibration[f"{kind}_sd"].to_numpy()[:, 0] for kind in KINDS]
    if accelerometer_noise is not None:
        sds[0] = np.full(len(sds[0]), accelerometer_noise)
    noise = Noise.of(model.array.accelerometers, model.array.gyroscopes, *sds)
    model = replace(model, noise=noise)
    found = fuse(
        model, recording.specific_force, recording.angular_rate, parameters, covariance,
        saturated, since, span,
    )  # fmt: skip
    return _with_own_clocks(found, calibration, recording, covariance)


def _with_own_clocks(found, calibration: xr.Dataset, recording: Recording, covariance):
    """`Fused` with rough motion anew, by the recording's own biases and clocks; whether it is."""
    if CLOCK not in effect_names(calibration) or covariance is None:
        return found, False
    moving = ~recording.still()
    rough = fused(recording, calibration, moving)
    if rough.readings.clock_deviation is None:
        return found, False
    whole, shared = rough.covariances(covariance)
    motion = [np.array(field) for field in found.estimate.motion[:3]]
    for number, field in enumerate(motion):
        field[moving] = rough.state.motion[:, 3 * number : 3 * number + 3]
    parts = (found.covariance, whole), (found.from_calibration, shared)
    for target, part in (*parts, (found.estimate.converged, rough.converged)):
        target[moving] = part
    estimate = replace(found.estimate, motion=Motion.of(*motion))
    return found._replace(estimate=estimate), True


def _require_parameters(calibration: xr.Dataset, recording: Recording, model: ArrayModel) -> None:
    labels = recording.accelerometer_labels, recording.gyroscope_labels
    expected = parameter_names(model, labels)
    found = [str(name) for name in calibration["parameter"].to_numpy()]
    wanted = f"{len(expected)} parameters of {', '.join(model.effects)}"
    other = f"{len(found)}, or others: the effects are not those of the calibration"
    require(found == expected, "", wanted, other)


def motion_dataset(recording: Recording, found, lost) -> xr.Dataset:
    """Motion of the reference triad, its sds and covariances; NaN where ``lost``."""
    covariance = np.where(lost[:, None, None], np.nan, found.covariance)
    sds = np.sqrt(np.einsum("tii->ti", covariance)).reshape(-1, 3, 3)
    variables: dict[str, tuple] = {
        "motion_covariance": (("time", "component", "component_other"), covariance),
        "converged": (("time",), found.estimate.converged & ~lost),
    }
    for number, (name, unit) in enumerate(UNITS.items()):
        values = np.where(lost[:, None], np.nan, getattr(found.estimate.motion, name))
        variables[name] = ("time", "axis"), values, {"units": unit}
        variables[f"{name}_sd"] = ("time", "axis"), sds[:, number], {"units": unit}
    shared = np.einsum("tii->ti", found.from_calibration).reshape(-1, 3, 3)
    for number, (name, unit) in enumerate(UNITS.items()):
        part = np.sqrt(np.where(lost[:, None], np.nan, shared[:, number]))
        variables[f"{name}_sd_from_calibration"] = ("time", "axis"), part, {"units": unit}
    coords = {"time": ("time", recording.time, {"units": "s"}), "axis": list("xyz"),
              "component": list(COMPONENTS), "component_other": list(COMPONENTS)}  # fmt: skip
    title = f"motion of triad {recording.accelerometer_labels[0]}, in the array's frame"
    return xr.Dataset(variables, coords, {"title": title})
