"""Positions of a board and parameters of its sensors from recordings, as one labelled dataset."""

import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.analysis import methods
from imuarray.analysis.calibration_dataset import engine_dataset, papers_dataset, with_readings
from imuarray.analysis.fitting import fitted
from imuarray.analysis.leak import less_leak_by_others
from imuarray.analysis.model import Say, assumed, model_of, require_together, silent, usable
from imuarray.errors import InputError, require_one_of
from imuarray.model.effects import DATA_EFFECTS
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording
from imuarray.recording import record as stored
from imuarray.recording.channels import require_apart, require_live


def calibrate(
    recording: Recording | Sequence[Recording], model: str | PathLike = "sensors",
    method: str | None = None, effects: Sequence[str] = (),
    accelerometer_noise: float | None = None, say: Say = silent,
) -> xr.Dataset:  # fmt: skip
    """Accelerometer positions, sensor parameters and motion (docs/models.md).

    Parameters
    ----------
    recording
        Moving samples, still poses are left out; or several recordings of one board, whose
        positions are the same and whose biases and clocks are each its own.
    model
        ``"sensors"``: the standard sensor model, each part kept where it gains on held-out time,
        with noise estimated for each triad; ``"papers"``: that of paper 2017, by ``method``, with
        the declared noise; or the path of a ``diagnosis.json``: what a diagnosis found.
    method
        Of the papers' model. ``"gauss-newton"`` (default): the most likely positions in a few
        iterations, of any number of samples; ``"bcd"``: the same by block coordinate descent,
        algorithm 1 of paper 2017, all samples in memory.
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
        ``model``, ``parts`` (json), and the origin (config, seed, versions).

    Raises
    ------
    InputError
        The recording does not determine the positions, has constant or copied channels, or is
        given twice, or the options do not go together.
    """
    recordings = [recording] if isinstance(recording, Recording) else list(recording)
    for one in recordings:
        require_live(one)
    require_apart(recordings)
    if method is not None:
        require_one_of("method", method, methods.CALIBRATION)
    require_together(model, recordings, effects, accelerometer_noise)
    if effects and str(model).endswith(".json"):
        raise InputError("--effects: expected none with a diagnosis.json, found some")
    if method is not None and model != "papers":
        raise InputError(f"--method {method}: expected it with --model papers, found {model}")
    if model == "papers":
        dataset = _papers(recordings[0], method or methods.CALIBRATION[0], accelerometer_noise, say)
    else:
        whole = [less_leak_by_others(one) for one in recordings]
        dataset = _engine(whole, str(model), tuple(effects), say)
    if not all(np.isfinite(dataset[f"position{name}"]).all() for name in ("", "_covariance")):
        raise InputError("recording: expected one that determines the positions, found no solution")
    dataset = with_readings(dataset, recordings)
    data = [part for one in recordings for part in (one.specific_force, one.angular_rate)]
    dataset.attrs |= {"model": str(model), **stamp({"recording": digest(*data)}, 0)}
    return dataset


def _papers(recording: Recording, method: str, accelerometer_noise, say: Say) -> xr.Dataset:
    """By maximum likelihood with the declared noise (paper 2017)."""
    from imuarray.estimation.bcd import calibrate_bcd
    from imuarray.estimation.gauss_newton import calibrate_gauss_newton
    from imuarray.estimation.streamed import calibrate_parts

    recording = assumed(usable(recording, say), accelerometer_noise)
    model = model_of(recording)
    if method == "gauss-newton" and len(recording.time) > stored.PART:
        found = calibrate_parts(model, lambda: map(_readings, recording.parts()))
    else:
        force, rate, saturated = _readings(recording.in_memory())
        if method == "bcd":
            found = calibrate_bcd(model, force, rate, saturated=saturated, tolerance=1e-9)
        else:
            found = calibrate_gauss_newton(model, force, rate, saturated=saturated)
    dataset = papers_dataset(recording, model, found)
    dataset.attrs["method"] = method
    return dataset


def _readings(part: Recording):
    return part.specific_force, part.angular_rate, part.saturated_gyroscopes()


def _engine(recordings, model: str, effects, say: Say) -> xr.Dataset:
    """Robust least squares (`imuarray.engine`): a ladder, given effects, or a diagnosis'."""
    from imuarray.diagnosis.extension import read_extension

    found, rungs = fitted(recordings, model, effects, say)
    dataset = engine_dataset(recordings, found)
    dataset.attrs["parts"] = json.dumps([rung._asdict() for rung in rungs])
    if model.endswith(".json"):
        mended = read_extension(Path(model)).before
        dataset.attrs["mended"] = " ".join(n for n in mended if not DATA_EFFECTS[n].left_out)
    return dataset
