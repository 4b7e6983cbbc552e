"""Checks of a recording's file: names, dimensions, units, values.

Every error says what was expected, what was found and where.
"""

import math
import warnings
from collections import Counter
from typing import Any

import h5py
import numpy as np
import xarray as xr

from imuarray.errors import LARGEST, SMALLEST, IdentifiabilityError, InputError, require
from imuarray.geometry.array import require_apart, require_count
from imuarray.recording import record
from imuarray.recording.record import Recording, blocks
from imuarray.recording.settings import SETTINGS

# A file of a few bytes can declare far more than any memory or disk holds; deflate makes 1032 of 1.
INFLATED = 1032


def check_sizes(file: h5py.File, where: str, whole: bool = True) -> None:
    """Refuse a file that declares an absurd size, before any of it is read.

    Unless it is read as a ``whole``, readings may be as many as the file has room for.
    """

    def visit(name: str, item: Any) -> None:
        # Python's integers: the declared sizes may overflow 64 bits
        shape = tuple(int(n) for n in getattr(item, "shape", None) or ())
        stays = not whole and name in record.SAMPLED and len(shape) > 1
        room = INFLATED * item.id.get_storage_size() if stays else 0
        small, expected = math.prod(shape) <= max(record.MAX_VALUES, room), record.MAX_VALUES
        require(small, f"{where}: {name}", f"at most {expected} values", f"shape {shape}")

    file.visititems(visit)


def check_structure(dataset: xr.Dataset, where: str) -> None:
    """Variables, dimensions, labels' type and attributes; units and values are for later."""
    for name in (*record.QUANTITIES, *record.KINDS, "axis"):
        _check_present(dataset, name, where)
    for name in record.QUANTITIES:
        kind = dataset[name].dtype
        require(kind.kind in "fiu", f"{where}: {name}", "real numbers", f"type {kind}")
    for name in record.KINDS:
        text = all(isinstance(label, str | bytes) for label in dataset[name].values.tolist())
        found = f"type {dataset[name].dtype}"
        require(text, f"{where}: {name}", "text as labels", found)
    axes = list(labels_of(dataset["axis"]))
    found = axes if len(axes) <= 6 else f"{len(axes)} of them"
    require(axes == list(record.AXES), f"{where}: axis", f"the labels {list(record.AXES)}", found)
    for name, unit in (record.NUMBERS | record.OPTIONAL_NUMBERS).items():
        if name in record.NUMBERS or name in dataset.attrs:
            _check_number(dataset.attrs, name, unit, where)
    corrected = record.CORRECTION if set(record.CORRECTION) & set(dataset) else ()  # all or none
    for name, check in _CHECKS.items():
        if name in dataset or name in corrected:
            _check_present(dataset, name, where)
            check(dataset, name, f"{where}: {name}")


def labels_of(coordinate: xr.DataArray) -> tuple[str, ...]:
    """Labels as text; NetCDF's character arrays arrive as bytes."""
    values = coordinate.values.tolist()
    return tuple(v.decode(errors="replace") if isinstance(v, bytes) else v for v in values)


def check_alignment(dataset: xr.Dataset, recording: Recording, where: str) -> None:
    """Clocks and rates of the recording's IMUs."""
    count = len(recording.accelerometer_labels)
    for name, shape in {**dict.fromkeys(record.CLOCKS, (count,)), "rate": (count, 2)}.items():
        there = name in dataset and dataset[name].shape == shape
        require(there, where, f"{name} of each of {count} IMUs", "none")
        place = f"{where}: {name}"
        finite = (np.abs(_numbers(dataset[name], place)) <= LARGEST).all()
        require(finite, place, "finite numbers", "others")


def check_values(recording: Recording, where: str) -> None:
    """Numbers, order in time, labels and geometry of a well-formed recording."""
    require(len(recording.time), f"{where}: time", "at least 1 sample", 0)
    if not recording.gyroscope_labels:
        raise IdentifiabilityError(f"{where}: expected at least 1 gyroscope triad, found 0")
    for kind in record.KINDS:
        labels = getattr(recording, f"{kind}_labels")
        require_count(len(labels), where, kind)
        for label, times in Counter(labels).items():
            found = f"{label!r} {times} times"
            require(times == 1, f"{where}: {kind}", "labels that are all different", found)
    limits = {name: getattr(recording, f"{kind}_range") for kind, name in record.KINDS.items()}
    for name in record.QUANTITIES:
        _check_finite(recording, name, limits.get(name, np.inf), where)
    _check_time(recording.time, where, declared=bool(recording.selected))
    require_apart(recording.accelerometer_position, f"{where}: accelerometer_position")


def _check_present(dataset: xr.Dataset, name: str, where: str) -> None:
    # a dimension without a coordinate would be given numbers as labels by xarray
    have = ", ".join(sorted(map(str, dataset.variables))) or "none"
    require(name in dataset.variables, where, f"a variable '{name}'", have)
    expected, found = record.DIMENSIONS.get(name, (name,)), dataset[name].dims
    right = f"dimensions {_listed(expected)}"
    require(found == expected, f"{where}: {name}", right, _listed(found))


def _listed(names: tuple) -> str:
    return f"({', '.join(map(str, names))})"


def _numbers(variable: xr.DataArray, where: str) -> np.ndarray:
    """Values as float64; InputError where they are not real numbers."""
    require(variable.dtype.kind in "fiu", where, "real numbers", f"type {variable.dtype}")
    return variable.values.astype(float)


def _check_number(attributes: dict, name: str, unit: str, where: str) -> None:
    bounds = f"between {SMALLEST:g} and {LARGEST:g}"
    expected = f"the attribute '{name}' to be a number {bounds} in {unit}"
    require(name in attributes, where, expected, "none")
    value = np.asarray(attributes[name])
    single = value.dtype.kind in "fiu" and value.size == 1
    require(single, where, expected, repr(attributes[name]))
    number = float(value.item())
    # a simulated sensor need not have a rail; NaN is not right
    right = SMALLEST <= number <= LARGEST or (number == np.inf and name.endswith("_range"))
    require(right, where, expected, number)


def is_rotation(matrices) -> np.ndarray:
    """True of matrices (..., 3, 3) that are rotations, to six digits."""
    unit = np.abs(matrices @ np.swapaxes(matrices, -1, -2) - np.eye(3)).max(axis=(-2, -1)) < 1e-6
    return unit & (np.linalg.det(matrices) > 0)


def _check_boolean(dataset: xr.Dataset, name: str, where: str) -> None:
    variable = dataset[name]
    parts = (part.values for _, part in blocks(variable))
    right = variable.dtype.kind in "biu" and all(np.isin(part, (0, 1)).all() for part in parts)
    found = f"type {variable.dtype} with other values"
    require(right, where, "true or false (1 or 0)", found)


def _check_covariance(dataset: xr.Dataset, name: str, where: str) -> None:
    values = _numbers(dataset[name], where)
    first, second = (9 * dataset.sizes[kind] for kind in record.KINDS)
    square = values.shape in ((first, first), (first + second, first + second))
    finite = square and (np.abs(values) <= LARGEST).all()
    found = f"{' x '.join(map(str, values.shape))}, or others"
    require(finite, where, f"{first} or {first + second} squared finite numbers", found)
    least, *_, most = np.linalg.eigvalsh((values + values.T) / 2)
    even = np.allclose(values, values.T, rtol=0, atol=1e-9 * most)
    require(even and least >= -1e-9 * most, where, "a covariance", "none")


def _check_rotations(dataset: xr.Dataset, name: str, where: str) -> None:
    values = _numbers(dataset[name], where)
    square = values.shape[1:] == (3, 3) and (np.abs(values) <= 2).all()
    require(square and is_rotation(values).all(), where, "rotations, 3 x 3 each", "others")


def _check_correction(dataset: xr.Dataset, name: str, where: str) -> None:
    values = _numbers(dataset[name], where)
    unknown = np.isnan(values) & name.endswith("_sd")  # of a single pose
    axes = values.ndim == 1 or values.shape[-1] == 3
    right = axes and (unknown | (np.abs(values) <= LARGEST)).all()
    require(right, where, "finite numbers for each axis", "others")


# Of variables that need not be there.
_CHECKS = {
    **dict.fromkeys(record.FLAGS, _check_boolean), "map_covariance": _check_covariance,
    **dict.fromkeys(record.CORRECTION, _check_correction), "accelerometer_axes": _check_rotations,
}  # fmt: skip


def _check_finite(recording: Recording, name: str, limit: float, where: str) -> None:
    """Finite numbers; and within a declared range."""
    values, most = getattr(recording, name), min(LARGEST, SETTINGS.beyond_range * limit)
    if all((np.abs(part) <= most).all() for _, part in blocks(values)):  # NaN is not
        return
    strange = sum(int(np.sum(~(np.abs(part) <= LARGEST))) for _, part in blocks(values))
    most = LARGEST if strange else most
    marks = ((first, part, ~(np.abs(part) <= most)) for first, part in blocks(values))
    first, part, wrong = next(mark for mark in marks if mark[2].any())
    index = tuple(np.argwhere(wrong)[0].tolist())
    place = _place(recording, name, (first + index[0], *index[1:]))
    if strange:
        raise InputError(
            f"{where}: {name}: expected finite numbers, at most {LARGEST:g}, found {part[index]}"
            f" at {place} ({strange} of {math.prod(values.shape)} values)"
        )
    raise InputError(
        f"{where}: {name}: expected values within the declared range of {limit:g} "
        f"{record.SI[name]}, found {part[index]:g} at {place}; is the units attribute right?"
    )


def _place(recording: Recording, name: str, index: tuple[int, ...]) -> str:
    """Where an index of a variable is, in the words of the file."""
    words = []
    for dimension, i in zip(record.DIMENSIONS[name], index, strict=True):
        if dimension == "time":
            words.append(f"time index {i}")
        elif dimension == "axis":
            words.append(f"axis {record.AXES[i]}")
        else:
            words.append(f"{dimension} {getattr(recording, dimension + '_labels')[i]!r}")
    return ", ".join(words)


def _check_time(time: np.ndarray, where: str, declared: bool = False) -> None:
    """Strictly increasing, or InputError; even, or ``declared`` by the file, or a warning."""
    steps = np.diff(time)
    if (steps <= 0).any():
        i = int(np.argmax(steps <= 0))
        raise InputError(
            f"{where}: time: expected strictly increasing values, found {time[i]} s and then "
            f"{time[i + 1]} s at index {i + 1}"
        )
    if len(steps) == 0 or declared:
        return
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > SETTINGS.gap * usual)
    if len(gaps):
        warnings.warn(
            f"{where}: time: {len(gaps)} gap(s) longer than {SETTINGS.gap:g} times the usual step "
            f"of {usual:g} s; the first, {steps[gaps[0]]:g} s, comes after index {gaps[0]}",
            stacklevel=2,
        )
