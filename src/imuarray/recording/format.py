"""The NetCDF-4 file of a recording, read with validation and written."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray as xr

from imuarray.errors import InputError, expecting, require
from imuarray.provenance import is_damaged, write_netcdf_parts
from imuarray.recording import record, validate
from imuarray.recording.record import Recording, Stored
from imuarray.recording.units import factor


def from_dataset(dataset: xr.Dataset, where: str = "recording", stored: bool = False) -> Recording:
    """Turn the file's dataset into a recording; InputError, naming `where`, if it is not one.

    With ``stored`` readings of more than a part stay in the file.
    """
    validate.check_structure(dataset, where)
    stored = stored and dataset.sizes["time"] > record.PART

    def values(name: str, scale: float | None = None) -> np.ndarray | Stored:
        """In SI units, or true or false; in memory, or left in the file."""
        found = Stored(dataset[name].variable, scale)
        return found if stored and name in record.SAMPLED and dataset[name].ndim > 1 else found[:]

    given = {
        name: values(
            name, factor(quantity, dataset[name].attrs.get("units"), f"{where}: {name}: units")
        )
        for name, quantity in record.QUANTITIES.items()
    }
    given |= {name: values(name) for name in record.FLAGS if name in dataset}
    given |= {n: dataset[n].values.astype(float) for n in record.MATRICES if n in dataset}
    numbers = [n for n in record.NUMBERS | record.OPTIONAL_NUMBERS if n in dataset.attrs]
    corrected = [name for name in record.CORRECTION if name in dataset]
    recording = Recording(
        **given,
        **{f"{kind}_labels": validate.labels_of(dataset[kind]) for kind in record.KINDS},
        correction=dataset[corrected] if corrected else None,
        **{name: float(np.asarray(dataset.attrs[name]).item()) for name in numbers},
        **{name: str(dataset.attrs.get(name, "")) for name in record.TEXTS},
    )
    validate.check_values(recording, where)
    return recording


def read_recording(path: str | Path, stored: bool = False) -> Recording:
    """Read and validate a recording; angular rates come out in rad/s.

    With ``stored`` the readings of a long one stay in the file (`Stored`).

    Raises InputError, with one line that says what was expected, what was found and where, if the
    file is missing, is not NetCDF-4 or is not a recording; raises IdentifiabilityError for fewer
    than three accelerometers or collinear ones. Large gaps in time are a warning.
    """
    path = Path(path)
    with expecting(path, "a readable NetCDF-4 file"):
        recording = from_dataset(load_dataset(path, None, stored), str(path), stored)
    if not _has_group(path, record.ALIGNMENT):
        return recording
    alignment = load_dataset(path, record.ALIGNMENT)
    validate.check_alignment(alignment, recording, f"{path}: {record.ALIGNMENT}")
    return replace(recording, alignment=alignment)


def has_truth(path: str | Path) -> bool:
    """True where a recording is simulated and says from what; InputError if it can not be read."""
    return _has_group(path, record.TRUTH)


def _has_group(path: str | Path, name: str) -> bool:
    with _hdf5(path) as file:
        return isinstance(file.get(name), h5py.Group)


def read_truth(path: str | Path) -> xr.Dataset:
    """Read what a simulated recording was made from; InputError if the file has no truth."""
    expected = f"a group '{record.TRUTH}' (simulated recordings have one)"
    require(has_truth(path), str(path), expected, "none")
    return load_dataset(path, record.TRUTH)


def write_recording(
    recording: Recording, path: str | Path, truth: xr.Dataset | None = None,
    attrs: Mapping[str, Any] | None = None, groups: dict[str, xr.Dataset] | None = None,
) -> None:  # fmt: skip
    """Write a recording, in group `truth` what it was simulated from, and further `groups`.

    `attrs` (such as `provenance.stamp` gives) join the recording's own attributes, which win. The
    file reads back, or it is not written: InputError as in `read_recording`.
    """
    validate.check_structure(next(recording.parts()).to_dataset(), str(path))
    validate.check_values(recording, str(path))
    datasets = (part.to_dataset() for part in recording.parts())
    parts = (one.assign_attrs({**(attrs or {}), **one.attrs}) for one in datasets)
    known = {record.TRUTH: truth, record.ALIGNMENT: recording.alignment, **(groups or {})}
    write_netcdf_parts(
        parts, len(recording.time), path,
        {name: part for name, part in known.items() if part is not None},
    )  # fmt: skip


def _hdf5(path: str | Path) -> h5py.File:
    """Open the file as HDF5, on which NetCDF-4 rests; InputError where there is none."""
    path = Path(path)
    found = "a folder there" if path.is_dir() else "nothing there"
    require(path.is_file(), str(path), "a recording (a NetCDF-4 file)", found)
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise InputError(f"{path}: expected a NetCDF-4 file, found another: {error}") from None


def load_dataset(path: str | Path, group: str | None = None, stored: bool = False) -> xr.Dataset:
    """One group of a NetCDF-4 file in memory; InputError where it cannot be read.

    Not before the sizes that it declares have been looked at. With ``stored`` the variables of a
    long one are read when they are asked for.
    """
    path = Path(path)
    with expecting(path, "a readable NetCDF-4 file"):
        whole = not (path.is_file() and is_damaged(path))
        require(whole, str(path), "a file as it was written", "it damaged")
        with _hdf5(path) as file:
            validate.check_sizes(file, str(path), not stored)
        # "s" is a number of seconds here, not a date or a time span
        options = {"engine": "h5netcdf", "decode_times": False, "decode_timedelta": False}
        # HDF5 without named dimensions is for `validate` to refuse, not for the library to warn of
        options["phony_dims"] = "access"
        dataset = xr.open_dataset(path, group=group, cache=False, **options)
        if stored and dataset.sizes.get("time", 0) > record.PART:
            return dataset
        with dataset:
            return dataset.load()
