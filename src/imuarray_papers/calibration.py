"""Positions of a recording by a search of the papers' model, as one labelled dataset."""

from functools import partial

import numpy as np
import xarray as xr

from imuarray.analysis.model import Notify, assumed, silent, usable
from imuarray.analysis.sensors import finished
from imuarray.engine.dataset import motion_variables, noise_variables, positions_dataset
from imuarray.engine.parameters import model_of
from imuarray.model import ArrayModel
from imuarray.recording import Recording
from imuarray_papers.estimation.bcd import calibrate_bcd
from imuarray_papers.estimation.newton import parameter_covariance

ML_BCD = partial(calibrate_bcd, tolerance=1e-9)  # to its end; it is slow


def calibrate(
    recording: Recording, accelerometer_noise: float | None = None, notify: Notify = silent,
    search=ML_BCD,
) -> xr.Dataset:  # fmt: skip
    """`imuarray.calibrate` with "papers" by ML-BCD, or another ``search`` of its arguments."""
    given, recording = recording, assumed(usable(recording, notify), accelerometer_noise)
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
