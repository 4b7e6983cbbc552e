"""Recordings from loggers' files, and what the commands have written, back in memory."""

from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.errors import InputError
from imuarray.recording import Recording, load_dataset


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

    return read_board(
        Path(path), Path(positions), underside, accelerometer_noise_sd=accelerometer_noise,
        gyroscope_noise_sd=gyroscope_noise, position_prior_sd=position_prior,
        output_rate=output_rate,
    )[0]  # fmt: skip


def read_calibration(path: str | PathLike) -> xr.Dataset:
    """What `imuarray calibrate` has written; InputError for another file."""
    found = load_dataset(Path(path))
    if "position_covariance" not in found:
        raise InputError(f"{path}: expected a calibration, found no position_covariance")
    return found


def read_posterior(path: str | PathLike) -> xr.DataTree:
    """What `imuarray sample` has written; InputError for another file."""
    from imuarray.posterior.chains import read_chains
    from imuarray.provenance import is_damaged

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: expected a posterior (a NetCDF-4 file), found none")
    if is_damaged(path):
        raise InputError(f"{path}: expected a file as it was written, found it damaged")
    try:
        return read_chains(path)[1]
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: expected a posterior, found another file: {error}") from None
