"""Noisy measurements of a motion by an array, and whole recordings of them with their truth."""

import numpy as np
import xarray as xr

from imuarray.errors import require
from imuarray.model import ArrayModel
from imuarray.model.array_model import parameter_names
from imuarray.motion import Motion
from imuarray.motion.state import HIGHER_UNITS, UNITS
from imuarray.recording import Recording
from imuarray.recording.record import MAX_VALUES


def clip(values, rail):
    """Values at the rail where the sensor would saturate, and which did (bool)."""
    if not np.isfinite(rail):
        return values, np.zeros(values.shape, bool)
    saturated = np.abs(values) >= rail
    return np.clip(values, -rail, rail), saturated


def measure(
    model: ArrayModel, motion: Motion, positions, rng, parameters=(), gyroscope_range=np.inf,
    time=None,
):  # fmt: skip
    """y_a, y_g and which gyroscope axes saturated, for motion fields (..., T, 3).

    Parameters
    ----------
    positions : (A, 3) m relative to the reference, or (realisations, A, 3) with motion
        fields (realisations, T, 3)
    parameters : (P,) effect parameters
    gyroscope_range : float, rad/s
    time : (T,) s, which drifts, shifts and clocks look at

    Returns
    -------
    specific_force (..., T, A, 3) m/s^2, angular_rate (..., T, G, 3) rad/s, saturated (same)
    """
    ideal = model.predict_many(motion, positions, parameters, time)
    shape = np.shape(motion.angular_rate)[:-1]
    force_noise, rate_noise = model.noise.draw(rng, shape)
    rate, saturated = clip(ideal.angular_rate + rate_noise, gyroscope_range)
    return ideal.specific_force + force_noise, rate, saturated


def _truth(model: ArrayModel, motion: Motion, positions, parameters) -> xr.Dataset:
    axes = ("time", "axis")
    data = {name: (axes, getattr(motion, name)) for name in Motion._fields}
    data["position"] = (("accelerometer", "axis"), positions)
    data["effect_parameter"] = (("parameter",), np.asarray(parameters, float))
    truth = xr.Dataset(data, {"parameter": parameter_names(model)} if model.effects else None)
    for name, unit in {**UNITS, **HIGHER_UNITS, "position": "m"}.items():
        truth[name].attrs["units"] = unit
    return truth


def simulate_samples(
    model: ArrayModel, motion: Motion, positions, nominal, rng, time=None, parameters=(),
    accelerometer_range=np.inf, gyroscope_range=np.inf, position_prior_sd=3e-3, title="",
):  # fmt: skip
    """A `Recording` and its truth (`xarray.Dataset`) for given motion, fields (T, 3).

    ``positions`` are the true ones, ``nominal`` (A, 3) those the recording declares (the
    prior mean), both in metres; ``time`` (T,) s defaults to one sample a second.
    """
    relative = positions - positions[0]
    samples = len(motion.angular_rate)
    time = np.arange(samples, dtype=float) if time is None else np.asarray(time, float)
    force, rate, _ = measure(model, motion, relative, rng, parameters, gyroscope_range, time)
    force, _ = clip(force, accelerometer_range)
    recording = Recording(
        time=time, specific_force=force, angular_rate=rate, accelerometer_position=nominal,
        accelerometer_labels=model.array.labels,
        gyroscope_labels=tuple(str(k + 1) for k in range(model.array.gyroscopes)),
        accelerometer_noise_sd=float(np.sqrt(model.noise.accelerometer[0, 0])),
        gyroscope_noise_sd=float(np.sqrt(model.noise.gyroscope[0, 0])),
        accelerometer_range=accelerometer_range, gyroscope_range=gyroscope_range,
        accelerometer_axes=model.array.axes, position_prior_sd=position_prior_sd, title=title,
        source="simulated by imuarray",
    )  # fmt: skip
    return recording, _truth(model, motion, relative, parameters)


def simulate_recording(
    model: ArrayModel, motion, positions, nominal, rng, sampling_rate: float, duration: float,
    **options,
):  # fmt: skip
    """A recording of a `SmoothMotion` at ``sampling_rate`` Hz for ``duration`` seconds.

    Its time begins at zero, or where the model's clock does. InputError for no sample, or for more
    values than a recording may have.
    """
    sensors = max(model.array.accelerometers, model.array.gyroscopes)
    most = MAX_VALUES // (3 * sensors)
    samples = sampling_rate * duration
    found = f"{duration:g} s at {sampling_rate:g} Hz"
    possible = 0.5 < samples <= most
    require(possible, "simulate", f"1 to {most} samples of {sensors} triads", found)
    time = np.arange(int(round(samples))) / sampling_rate
    begin = 0.0 if model.clock is None else model.clock[0]
    return simulate_samples(
        model, motion.at(time), positions, nominal, rng, time=begin + time, **options
    )
