"""Recordings before they are calibrated, from files or simulated, and results read back."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.analysis.selection import select_dynamic
from imuarray.errors import InputError, require, require_integer
from imuarray.firstorder.correct import calibrate_first_order, correct
from imuarray.geometry import Array
from imuarray.model import ArrayModel
from imuarray.motion import hand_twisting
from imuarray.posterior.chains import read_chains
from imuarray.provenance import is_damaged
from imuarray.recording import Recording, load_dataset
from imuarray.recording.units import GRAVITY
from imuarray.streams import stream


def read_mimu(
    path: str | PathLike, positions: str | PathLike, underside: str | None = None,
    accelerometer_noise: float = 0.04, gyroscope_noise: float = float(np.radians(0.06)),
    position_prior: float = 3e-3, output_rate: float = 1000.0,
) -> Recording:  # fmt: skip
    """Packets of a MIMU board; damaged ones are left out.

    ``positions``: CSV of nominal positions in m; ``underside``: labels of the IMUs turned over,
    separated by commas, by default the even-numbered ones; noise sds in m/s^2 and rad/s, the
    positions' prior sd in m; ``output_rate`` Hz, at which a sensor makes readings of which the host
    takes the newest. InputError says what does not fit.
    """
    from imuarray.recording.mimu_recording import read_board

    noise = accelerometer_noise, gyroscope_noise
    files = Path(path), Path(positions)
    return read_board(*files, underside, *noise, position_prior, output_rate)[0]


def read_calibration(path: str | PathLike) -> xr.Dataset:
    """A calibration from the file that `imuarray calibrate` has written; InputError for another."""
    found = load_dataset(Path(path))
    require("position_covariance" in found, str(path), "a calibration", "no position_covariance")
    return found


def read_posterior(path: str | PathLike) -> xr.DataTree:
    """A posterior from the file that `imuarray sample` has written; InputError for another."""
    path = Path(path)
    require(path.is_file(), str(path), "a posterior (a NetCDF-4 file)", "none")
    require(not is_damaged(path), str(path), "a file as it was written", "it damaged")
    try:
        return read_chains(path)[1]
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: expected a posterior, found another file: {error}") from None


def simulate(
    array: Array, duration: float = 10.0, sampling_rate: float = 100.0, seed: int = 0,
    effects: Sequence[str] = (), accelerometer_noise: float = 0.04,
    gyroscope_noise: float = float(np.radians(0.06)), position_error: float = 1e-3,
    angular_rate: float = float(np.radians(250)), specific_force: float = 20.0,
    bandwidth: float = 5.0, gyroscope_range: float = float(np.radians(2000)),
) -> tuple[Recording, xr.Dataset]:  # fmt: skip
    """(recording, truth) of an array twisted by hand.

    Parameters
    ----------
    array
        The board: `mimu4444()`, or an `Array` of your own.
    duration
        In s.
    sampling_rate
        In Hz.
    seed
        Of motion, positions, effects and noise, each with a stream of its own.
    effects
        Added to the data, parameters drawn from their priors (docs/effects.md).
    accelerometer_noise
        Sd of one reading, m/s^2.
    gyroscope_noise
        Sd of one reading, rad/s.
    position_error
        Sd (m) of the nominal positions that the recording declares about the true ones.
    angular_rate
        Of the motion, sd per axis, rad/s.
    specific_force
        Of the motion, sd per axis, m/s^2.
    bandwidth
        Of the motion, Hz.
    gyroscope_range
        The rail, rad/s.
    """
    from imuarray.simulation.recordings import simulate_recording

    positive, found = duration > 0 and sampling_rate > 0, f"{duration:g} s and {sampling_rate:g} Hz"
    require(positive, "simulate", "a positive duration and sampling rate", found)
    model = ArrayModel.isotropic(array, accelerometer_noise, gyroscope_noise, effects)
    motion = hand_twisting(stream(seed, "twisting"), angular_rate, specific_force, bandwidth)
    sizes = model.effect_prior_sd
    errors = position_error * stream(seed, "mounting").standard_normal(array.positions.shape)
    errors[0] = 0.0
    return simulate_recording(
        model, motion, array.positions, array.positions + errors, stream(seed, "noise"),
        sampling_rate, duration, gyroscope_range=gyroscope_range,
        position_prior_sd=position_error, title="simulated hand twisting",
        parameters=sizes * stream(seed, "effects").standard_normal(sizes.shape),
    )  # fmt: skip


def first_order(
    recording: Recording, gravity: float = GRAVITY, gyroscopes: str = "calibrate",
    shortest_pose: float = 3.0, others: Sequence[Recording] = (),
) -> Recording:  # fmt: skip
    """The recording with each triad's offset, scale, misalignment and turn corrected.

    Accelerometers from still poses, gyroscopes from the moves between them.

    Parameters
    ----------
    recording
        With still poses before, between or after motion.
    gravity
        In m/s^2.
    gyroscopes
        "calibrate", or "offset" for no more than their offsets, as paper 2021.
    shortest_pose
        That a still pose lasts at least, s.
    others
        Further recordings of the board, made at the same place: maps, and so the array's frame and
        size, are from the poses and moves of all; offsets are this recording's own.

    InputError without enough still poses, and for mirrored axes.
    """
    found = calibrate_first_order(recording, gravity, gyroscopes, shortest_pose, others)
    return correct(recording, found)


def select(recording: Recording, samples: int | None = None) -> Recording:
    """The moving, unsaturated, informative samples, or ``samples`` of them, spread evenly.

    InputError where there are fewer, or ``samples`` is not a positive integer.
    """
    if samples is not None:
        require_integer("samples", samples)
    return recording.select(select_dynamic(recording).spread(samples))
