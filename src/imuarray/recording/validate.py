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

from imuarray.errors import LARGEST, SMALLEST, IdentifiabilityError, InputError
from imuarray.geometry.array import require_apart, require_count
from imuarray.recording.record import (
    AXES,
    CLOCKS,
    CORRECTION,
    DIMENSIONS,
    FLAGS,
    LABELS,
    MAX_VALUES,
    MAY_BE_INFINITE,
    NUMBERS,
    OPTIONAL_NUMBERS,
    QUANTITIES,
    SAMPLED,
    SI,
    Recording,
    blocks,
)

# A file of a few bytes can declare far more than any memory or disk holds; deflate makes 1032 of 1.
INFLATED = 1032

# A pause this many times the usual step is reported: estimators that smooth would bridge it.
GAP_FACTOR = 5.0

# Calibrated values may pass the rail by some per cent, those of a triad that was turned by up to
# sqrt 3; this is to find wrong units (57, 9.8, ...).
BEYOND_RANGE = 1.8


def check_sizes(file: h5py.File, where: str, whole: bool = True) -> None:
    """Refuse a file that declares an absurd size, before any of it is read.

    Unless it is read as a ``whole``, readings may be as many as the file has room for.
    """
    found: list[tuple[str, tuple[int, ...]]] = []

    def visit(name: str, item: Any) -> None:
        # Python's integers: the declared sizes may overflow 64 bits
        shape = tuple(int(n) for n in getattr(item, "shape", None) or ())
        stays = not whole and name in SAMPLED and len(shape) > 1
        room = INFLATED * item.id.get_storage_size() if stays else 0
        if math.prod(shape) > MAX_VALUES and not math.prod(shape) <= room:
            found.append((name, shape))

    file.visititems(visit)
    if found:
        name, shape = found[0]
        raise InputError(
            f"{where}: {name}: expected at most {MAX_VALUES} values, found shape {shape}"
        )


def check_structure(dataset: xr.Dataset, where: str) -> None:
    """Variables, dimensions, labels' type and attributes; units and values are for later."""
    for name in (*QUANTITIES, *LABELS, "axis"):
        _check_present(dataset, name, where)
    for name in QUANTITIES:
        _check_numeric(dataset[name], where)
    for name in LABELS:
        _check_text(dataset[name], where)
    _check_axis(dataset["axis"], where)
    for name in FLAGS:
        if name in dataset:
            _check_present(dataset, name, where)
            _check_boolean(dataset[name], where)
    for name, unit in NUMBERS.items():
        _check_number(dataset.attrs, name, unit, where)
    for name, unit in OPTIONAL_NUMBERS.items():
        if name in dataset.attrs:
            _check_number(dataset.attrs, name, unit, where)
    if "map_covariance" in dataset:
        _check_covariance(dataset, "map_covariance", where)
    for name in CORRECTION if set(CORRECTION) & set(dataset) else ():
        _check_correction(dataset, name, where)
    if "accelerometer_axes" in dataset:
        _check_rotations(dataset, "accelerometer_axes", where)


def check_alignment(dataset: xr.Dataset, recording: Recording, where: str) -> None:
    """Clocks and rates of the recording's IMUs."""
    count = len(recording.accelerometer_labels)
    for name, shape in {**dict.fromkeys(CLOCKS, (count,)), "rate": (count, 2)}.items():
        if name not in dataset or dataset[name].shape != shape:
            raise InputError(f"{where}: expected {name} of each of {count} IMUs, found none")
        _check_numeric(dataset[name], where)
        if not (np.abs(dataset[name].values) <= LARGEST).all():
            raise InputError(f"{where}: {name}: expected finite numbers, found others")


def check_values(recording: Recording, where: str) -> None:
    """Numbers, order in time, labels and geometry of a well-formed recording."""
    _check_counts(recording, where)
    _check_labels("accelerometer", recording.accelerometer_labels, where)
    _check_labels("gyroscope", recording.gyroscope_labels, where)
    limits = {
        "specific_force": recording.accelerometer_range, "angular_rate": recording.gyroscope_range
    }  # fmt: skip
    for name in QUANTITIES:
        _check_finite(recording, name, limits.get(name, np.inf), where)
    _check_time(recording.time, where, declared=bool(recording.selected))
    require_apart(recording.accelerometer_position, f"{where}: accelerometer_position")


def _check_present(dataset: xr.Dataset, name: str, where: str) -> None:
    # a dimension without a coordinate would be given numbers as labels by xarray
    if name not in dataset.variables:
        have = ", ".join(sorted(map(str, dataset.variables))) or "none"
        raise InputError(f"{where}: expected a variable '{name}', found {have}")
    expected = DIMENSIONS.get(name) or CORRECTION.get(name, (name,))
    if dataset[name].dims != expected:
        raise InputError(
            f"{where}: {name}: expected dimensions {_listed(expected)}, "
            f"found {_listed(dataset[name].dims)}"
        )


def _listed(names: tuple) -> str:
    return f"({', '.join(map(str, names))})"


def _check_numeric(variable: xr.DataArray, where: str) -> None:
    if variable.dtype.kind not in "fiu":
        raise InputError(
            f"{where}: {variable.name}: expected real numbers, found type {variable.dtype}"
        )


def _check_text(coordinate: xr.DataArray, where: str) -> None:
    if not all(isinstance(label, str | bytes) for label in coordinate.values.tolist()):
        raise InputError(
            f"{where}: {coordinate.name}: expected text as labels, found type {coordinate.dtype}"
        )


def _check_axis(coordinate: xr.DataArray, where: str) -> None:
    values = coordinate.values.tolist()
    found = [v.decode(errors="replace") if isinstance(v, bytes) else v for v in values]
    if found != list(AXES):
        shown = found if len(found) <= 6 else f"{len(found)} of them"
        raise InputError(f"{where}: axis: expected the labels {list(AXES)}, found {shown}")


def _check_boolean(variable: xr.DataArray, where: str) -> None:
    parts = (part.values for _, part in blocks(variable))
    if variable.dtype.kind not in "biu" or not all(np.isin(part, (0, 1)).all() for part in parts):
        raise InputError(
            f"{where}: {variable.name}: expected true or false (1 or 0), "
            f"found type {variable.dtype} with other values"
        )


def _check_number(attributes: dict, name: str, unit: str, where: str) -> None:
    bounds = f"between {SMALLEST:g} and {LARGEST:g}"
    expected = f"expected the attribute '{name}' to be a number {bounds} in {unit}"
    if name not in attributes:
        raise InputError(f"{where}: {expected}, found none")
    value = np.asarray(attributes[name])
    if value.dtype.kind not in "fiu" or value.size != 1:
        raise InputError(f"{where}: {expected}, found {attributes[name]!r}")
    number = float(value.item())
    if np.isinf(number) and number > 0 and name in MAY_BE_INFINITE:
        return
    # written so that NaN fails
    if not SMALLEST <= number <= LARGEST:
        raise InputError(f"{where}: {expected}, found {number}")


def _check_covariance(dataset: xr.Dataset, name: str, where: str) -> None:
    _check_present(dataset, name, where)
    _check_numeric(dataset[name], where)
    values = dataset[name].values.astype(float)
    first, second = (9 * dataset.sizes[kind] for kind in LABELS)
    square = values.shape in ((first, first), (first + second, first + second))
    if not square or not (np.abs(values) <= LARGEST).all():
        raise InputError(
            f"{where}: {name}: expected {first} or {first + second} squared finite numbers, found"
            f" {' x '.join(map(str, values.shape))}, or others"
        )
    least, *_, most = np.linalg.eigvalsh((values + values.T) / 2)
    even = np.allclose(values, values.T, rtol=0, atol=1e-9 * most)
    if not (even and least >= -1e-9 * most):
        raise InputError(f"{where}: {name}: expected a covariance, found none")


def _check_rotations(dataset: xr.Dataset, name: str, where: str) -> None:
    _check_present(dataset, name, where)
    _check_numeric(dataset[name], where)
    values = dataset[name].values.astype(float)
    square = values.shape[1:] == (3, 3) and (np.abs(values) <= 2).all()
    if not square or not is_rotation(values).all():
        raise InputError(f"{where}: {name}: expected rotations, 3 x 3 each, found others")


def _check_correction(dataset: xr.Dataset, name: str, where: str) -> None:
    _check_present(dataset, name, where)
    _check_numeric(dataset[name], where)
    values = dataset[name].values.astype(float)
    unknown = np.isnan(values) & name.endswith("_sd")  # of a single pose
    axes = values.ndim == 1 or values.shape[-1] == 3
    if not axes or not (unknown | (np.abs(values) <= LARGEST)).all():
        raise InputError(f"{where}: {name}: expected finite numbers for each axis, found others")


def is_rotation(matrices) -> np.ndarray:
    """True of matrices (..., 3, 3) that are rotations, to six digits."""
    unit = np.abs(matrices @ np.swapaxes(matrices, -1, -2) - np.eye(3)).max(axis=(-2, -1)) < 1e-6
    return unit & (np.linalg.det(matrices) > 0)


def _check_counts(recording: Recording, where: str) -> None:
    if len(recording.time) == 0:
        raise InputError(f"{where}: time: expected at least 1 sample, found 0")
    if len(recording.gyroscope_labels) == 0:
        raise IdentifiabilityError(f"{where}: expected at least 1 gyroscope triad, found 0")
    require_count(len(recording.accelerometer_labels), where, "accelerometer")
    require_count(len(recording.gyroscope_labels), where, "gyroscope")


def _check_labels(kind: str, labels: tuple[str, ...], where: str) -> None:
    repeated = [label for label, count in Counter(labels).items() if count > 1]
    if repeated:
        raise InputError(
            f"{where}: {kind}: expected labels that are all different, "
            f"found {repeated[0]!r} {labels.count(repeated[0])} times"
        )


def _check_finite(recording: Recording, name: str, limit: float, where: str) -> None:
    """Finite numbers; and within a declared range."""
    values = getattr(recording, name)
    sizes = ((first, np.abs(part)) for first, part in blocks(values))
    marks = [
        (first, int(np.sum(~(size <= LARGEST))), int(np.sum(size > BEYOND_RANGE * limit)))
        for first, size in sizes
    ]  # NaN is not finite, too
    strange, beyond = sum(mark[1] for mark in marks), sum(mark[2] for mark in marks)
    if not strange and not beyond:
        return
    start = next(mark[0] for mark in marks if mark[1 if strange else 2])
    part = next(part for first, part in blocks(values) if first == start)
    size = np.abs(part)
    index = _first(~(size <= LARGEST) if strange else size > BEYOND_RANGE * limit)
    place = _place(recording, name, (start + index[0], *index[1:]))
    if strange:
        raise InputError(
            f"{where}: {name}: expected finite numbers, at most {LARGEST:g}, found {part[index]}"
            f" at {place} ({strange} of {math.prod(values.shape)} values)"
        )
    raise InputError(
        f"{where}: {name}: expected values within the declared range of {limit:g} "
        f"{SI[name]}, found {part[index]:g} at {place}; is the units attribute right?"
    )


def _first(mask: np.ndarray) -> tuple[int, ...]:
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(mask)), mask.shape))


def _place(recording: Recording, name: str, index: tuple[int, ...]) -> str:
    """Where an index of a variable is, in the words of the file."""
    words = []
    for dimension, i in zip(DIMENSIONS[name], index, strict=True):
        if dimension == "time":
            words.append(f"time index {i}")
        elif dimension == "axis":
            words.append(f"axis {AXES[i]}")
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
    gaps = np.flatnonzero(steps > GAP_FACTOR * usual)
    if len(gaps):
        warnings.warn(
            f"{where}: time: {len(gaps)} gap(s) longer than {GAP_FACTOR:g} times the usual step "
            f"of {usual:g} s; the first, {steps[gaps[0]]:g} s, comes after index {gaps[0]}",
            stacklevel=2,
        )
