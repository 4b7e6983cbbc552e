"""Positions of a board, parameters of its sensors and motion from recordings, as one dataset."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.analysis import methods
from imuarray.analysis.known import again, used
from imuarray.analysis.model import Say, assumed, require_together, silent, usable
from imuarray.engine.dataset import (
    engine_dataset,
    motion_variables,
    noise_variables,
    positions_dataset,
    with_readings,
)
from imuarray.engine.estimate import Estimate
from imuarray.engine.forward import EffectGroup, groups_of, select_forward, with_effects
from imuarray.engine.parameters import model_of
from imuarray.errors import InputError, one_line
from imuarray.estimation.newton import calibrate_gauss_newton, parameter_covariance
from imuarray.firstorder.rails import less_leak_by_others
from imuarray.model import ArrayModel
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording, load_dataset
from imuarray.recording.channels import require_apart, require_live


def calibrate(
    recording: Recording | Sequence[Recording], model: str | PathLike = "sensors",
    effects: Sequence[str] = (), accelerometer_noise: float | None = None,
    say: Say = silent,
) -> xr.Dataset:  # fmt: skip
    """Accelerometer positions, sensor parameters and motion (docs/models.md).

    Parameters
    ----------
    recording
        Moving samples, still poses are left out; or several recordings of one board, whose
        positions are the same and whose biases and clocks are each its own.
    model
        ``"sensors"``: the standard sensor model, each part kept where it gains on held-out time,
        with noise estimated for each triad; ``"papers"``: that of paper 2017, with the declared
        noise, any number of samples; or the path of a calibration: its effects and sensors,
        estimated again.
    effects
        Names of effects (docs/effects.md) to have in the model instead of those of ``model``.
    accelerometer_noise
        Of the papers' model: assumed sd in m/s^2, by default what the recording declares.
    say
        Called with each remark on the work's course.

    Returns
    -------
    xarray.Dataset
        ``position`` (accelerometer, axis) m, relative to the first triad, beside
        ``nominal_position``, and ``position_covariance`` m^2, the larger of the formal one and a
        jackknife's over blocks of time (``position_sd_formal``, ``position_sd_jackknife``, m); the
        motion at each sample: ``angular_rate`` rad/s, ``angular_acceleration`` rad/s^2,
        ``specific_force`` m/s^2; along one recording what `imuarray.engine.course` says;
        ``step``, the iterations' largest step in sds;
        ``accelerometer_sd`` m/s^2, ``gyroscope_sd`` rad/s; with effects ``effect_parameter`` and
        ``effect_sd``, whose coordinate ``scope`` is "imu" or "recording", and of several recordings
        ``own_parameter``, ``own_sd`` (recording, own), the latter ones of each; how each recording
        was corrected before (`Recording.correction`, recording first). Attributes
        ``converged`` (0 or 1), ``residual_ratio`` (rms residual over the declared noise),
        ``model``, ``parts`` (json), ``accelerometer_maps_hold`` (chance that the maps of first
        order are those of this motion) and ``accelerometer_maps_farthest`` (the IMUs that are
        least so), the same of gyroscopes, ``size_growth`` and ``size_growth_sd`` (relative, of the
        array from the beginning of the motion to its end), and the origin (config, seed, versions).

    Raises
    ------
    InputError
        The recording does not determine the positions, has constant or copied channels, or is
        given twice, or the options do not go together.
    """
    recordings = [recording] if isinstance(recording, Recording) else list(recording)
    require_together(model, recordings, effects, accelerometer_noise)
    if model == "papers":
        return calibrate_papers(recordings[0], accelerometer_noise, say)
    for one in recordings:
        require_live(one)
    require_apart(recordings)
    whole = [less_leak_by_others(one) for one in recordings]
    found, groups = fitted(whole, str(model), effects, say)
    assert found is not None  # for it is wanted in any case
    dataset = engine_dataset(whole, found)
    dataset.attrs["parts"] = json.dumps([group._asdict() for group in groups])
    return finished(dataset, recordings, str(model))


def calibrate_papers(
    recording: Recording, accelerometer_noise: float | None = None, say: Say = silent,
    search=calibrate_gauss_newton,
) -> xr.Dataset:  # fmt: skip
    """`calibrate` by maximum likelihood with the declared noise (paper 2017).

    ``search``: another search of the arguments of `calibrate_gauss_newton`.
    """
    given, recording = recording, assumed(usable(recording, say), accelerometer_noise)
    model = model_of(recording)
    whole, saturated = recording.in_memory(), recording.saturated_gyroscopes()
    found = search(model, whole.specific_force, whole.angular_rate, saturated=saturated)
    covariance = found.covariance
    if covariance is None:
        covariance = parameter_covariance(model, found, saturated)
    dataset = positions_dataset(recording, found.positions, covariance)
    variables = motion_variables(found.motion.motion[:3]) | noise_variables(model.noise)
    variables |= {
        "motion_converged": (("time",), found.motion.converged),
        "cost": (("iteration",), found.cost),
        "position_step": (("iteration",), found.step, {"units": "m"}),
    }
    dataset = dataset.assign(variables).assign_coords(time=recording.time)
    dataset.attrs |= {"converged": int(found.converged), "samples": len(recording.time)}
    dataset.attrs["residual_ratio"] = residual_ratio(recording, model, found)
    return finished(dataset, [given], "papers")


def residual_ratio(recording: Recording, model: ArrayModel, found) -> float:
    """Rms residual over the declared noise, degrees of freedom allowed for; NaN without any."""
    samples, count = recording.specific_force.shape[:2]
    freedom, misfit, start = 3 * samples * (count + recording.angular_rate.shape[1]), 0.0, 0
    freedom -= 9 * samples + 3 * (count - 1)
    for part in recording.parts():
        motion = found.motion.motion.select(slice(start, start + len(part.time)))
        force, rate = model.predict_many(motion, found.positions)
        saturated = part.saturated_gyroscopes()
        off = part.specific_force - force, part.angular_rate - rate
        misfit += model.noise.misfit(*off, saturated)
        freedom, start = freedom - int(saturated.sum()), start + len(part.time)
    return float(np.sqrt(misfit / freedom)) if freedom > 0 else float("nan")


@contextmanager
def _near_the_model() -> Iterator[None]:
    """A search that diverges is bad input, in one line."""
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise InputError(
            "recording: expected readings near those of the model, found a search that diverges"
            f" ({one_line(error)}); are they corrected (imuarray first-order), and units, axes and"
            " times as declared?"
        ) from error


@_near_the_model()
def fitted(
    recordings: Sequence[Recording], model: str, effects: Sequence[str], say: Say,
    bare: bool = True,
) -> tuple[Estimate | None, list[EffectGroup]]:  # fmt: skip
    """(estimate, groups tried) under a calibration's model, ``effects``, or the sensor model.

    ``bare``: whether an estimate is wanted where no group of the sensor model gains, or can be
    tried; else it is None there. InputError where no model of the kind is near the readings.
    """
    if methods.is_file(model):
        try:
            return again(recordings[0], load_dataset(Path(model)), say), []
        except InputError as error:
            raise InputError(f"--model {model}: {error}") from None
    readings = [used(one, say) for one in recordings]
    if effects:
        return with_effects(readings, effects), []
    if not bare and not groups_of(readings):
        return None, []
    found, groups = select_forward(readings, bare=bare)
    for group in groups:
        verdict = "kept" if group.kept else "left out"
        say(f"{group.name}: {verdict}, {group.gain:.3g} ({group.error:.2g}) nats on held-out time")
    return found if bare or any(group.kept for group in groups) else None, groups


def finished(dataset: xr.Dataset, recordings, model: str) -> xr.Dataset:
    """With what the recordings say of themselves, and the origin."""
    if not all(np.isfinite(dataset[f"position{name}"]).all() for name in ("", "_covariance")):
        raise InputError("recording: expected one that determines the positions, found no solution")
    dataset = with_readings(dataset, recordings)
    data = [part for one in recordings for part in (one.specific_force, one.angular_rate)]
    dataset.attrs |= {"model": model, **stamp({"recording": digest(*data)}, 0)}
    return dataset
