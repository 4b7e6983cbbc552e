"""Positions of a board and parameters of its sensors from recordings, as one labelled dataset."""

from collections.abc import Sequence
from os import PathLike

import xarray as xr

from imuarray.analysis.model import Notify, assumed, require_together, silent
from imuarray.analysis.sensors import calibrate_sensors
from imuarray.recording import Recording


def calibrate(
    recording: Recording | Sequence[Recording], model: str | PathLike = "sensors",
    effects: Sequence[str] = (), accelerometer_noise: float | None = None,
    notify: Notify = silent,
) -> xr.Dataset:  # fmt: skip
    """Accelerometer positions, sensor parameters and motion (docs/models.md).

    Parameters
    ----------
    recording
        Moving samples, still poses are left out; or several recordings of one board, whose
        positions are the same and whose biases and clocks are each its own.
    model
        ``"sensors"``: the standard sensor model, each part kept where it gains on held-out time,
        with noise estimated for each triad; ``"papers"``: that of paper 2017, positions and motion
        alone, with the declared noise, from all samples off the gyroscopes' rails; or the path of
        a calibration: its effects and sensors, estimated again.
    effects
        Names of effects (docs/effects.md) to have in the model instead of those of ``model``.
    accelerometer_noise
        Of the papers' model: assumed sd in m/s^2, by default what the recording declares.
    notify
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
        array from the beginning of the motion to its end), ``farthest_moved`` (the IMU whose
        position changes most between these) and ``farthest_move`` (its chi-square, of three
        degrees of freedom), and the origin (config, seed, versions).

    Raises
    ------
    InputError
        The recording does not determine the positions, has constant or copied channels, or is
        given twice, or the options do not go together.
    """
    recordings = [recording] if isinstance(recording, Recording) else list(recording)
    require_together(model, recordings, effects, accelerometer_noise)
    recordings = [assumed(one, accelerometer_noise) for one in recordings]
    return calibrate_sensors(recordings, str(model), effects, notify)
