"""A recording in SI units, in memory or left in its file, and the names and units of that file.

A recording larger than memory is read part by part.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Self

import numpy as np
import xarray as xr

from imuarray.errors import InputError, require
from imuarray.geometry import Array
from imuarray.recording import units

PART = 2**15  # samples: 50 MB of 32 IMUs
MAX_VALUES = 200_000_000  # 1.6 GB as float64: what is held in memory at once
NEAR = 64  # samples between two that are read in one go
AXES = ("x", "y", "z")
# Kinds of sensors, and what they read.
KINDS = {"accelerometer": "specific_force", "gyroscope": "angular_rate"}
# Group with what a simulated recording was made from.
TRUTH = "truth"
# Group with the per-triad calibration that a corrected recording went through.
FIRST_ORDER = "first_order"
# Group with how the logs of loose IMUs were brought together.
ALIGNMENT = "alignment"
# Optional variables, all or none: how the readings were corrected, inverse @ (raw - offset).
CORRECTION = {
    f"{kind}_{name}": (kind, *dims)
    for kind in KINDS
    for name, dims in (
        ("inverse", ("axis", "axis_other")), ("offset", ("axis",)), ("offset_sd", ("axis",)),
        ("offset_walk", ()),
    )
}  # fmt: skip
DIMENSIONS = {
    "time": ("time",),
    "specific_force": ("time", "accelerometer", "axis"),
    "angular_rate": ("time", "gyroscope", "axis"),
    "accelerometer_position": ("accelerometer", "axis"),
    "stationary": ("time",),
    "specific_force_saturated": ("time", "accelerometer", "axis"),
    "angular_rate_saturated": ("time", "gyroscope", "axis"),
    "map_covariance": ("map_entry", "map_entry_other"),
    "accelerometer_axes": ("accelerometer", "axis", "axis_other"),
    **CORRECTION,
}
# Optional variables that are true or false.
FLAGS = ("stationary", "specific_force_saturated", "angular_rate_saturated")
# What each number is, by name in `units.UNITS`.
QUANTITIES = {
    "time": "time", "specific_force": "force", "angular_rate": "rate",
    "accelerometer_position": "length",
}  # fmt: skip
SI = {name: units.SI[quantity] for name, quantity in QUANTITIES.items()}
# Attributes that are positive numbers, and their units.
NUMBERS = {
    "accelerometer_noise_sd": "m s-2",
    "gyroscope_noise_sd": "rad s-1",
    "accelerometer_range": "m s-2",
    "gyroscope_range": "rad s-1",
    "position_prior_sd": "m",
}
# Attributes that need not be there.
OPTIONAL_NUMBERS = {"output_period": "s", "clock_sd": "1"}
# Optional variables without a unit.
MATRICES = ("map_covariance", "accelerometer_axes")
# Of `Recording.alignment`: a log's stamp t is t - offset - drift (t - middle) of the first's clock.
CLOCKS = ("clock_offset", "clock_offset_sd", "clock_drift", "clock_drift_sd", "clock_middle")
# Optional attributes that are text.
TEXTS = ("title", "source", "license", "selected")
# Variables with a value for each sample.
SAMPLED = ("time", "specific_force", "angular_rate", *FLAGS)
# Of a range: a rail is a count; turning counts into SI units and back may cost the last digits.
RAIL = 1 - 1e-6


class Stored:
    """An array (T, ...) in a file, of which `PART` samples or fewer at a time become an ndarray.

    A slice is read; a mask or indices (increasing) of more than a part stay in the file. As a whole
    it becomes an ndarray of at most `MAX_VALUES`, InputError for more. Without a ``scale`` the
    values are true or false.
    """

    left_in_file = True

    def __init__(self, variable: xr.Variable, scale: float | None = None, index=None):
        self.variable, self.scale, self.index = variable, scale, index
        self.shape = (len(variable) if index is None else len(index), *variable.shape[1:])
        self.dtype = np.dtype(bool if scale is None else float)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, wanted) -> np.ndarray | Self:
        if isinstance(wanted, slice):
            start, stop, step = wanted.indices(len(self))
            if step == 1:
                return self._read(start, max(start, stop))
            wanted = np.arange(start, stop, step)
        wanted = np.asarray(wanted)
        index = np.flatnonzero(wanted) if wanted.dtype == bool else wanted
        part = Stored(self.variable, self.scale, index if self.index is None else self.index[index])
        return np.asarray(part) if len(part) <= PART else part

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        return self._read(0, len(self)).astype(dtype or self.dtype, copy=False)

    def _read(self, start: int, stop: int) -> np.ndarray:
        shape = (stop - start, *self.shape[1:])
        where = self.variable.encoding.get("source", "recording")
        expected = f"at most {MAX_VALUES} values to hold in memory"
        require(math.prod(shape) <= MAX_VALUES, where, expected, f"shape {shape}")
        if self.index is None:
            return self._stretch(start, stop)
        index = self.index[start:stop]
        found = (index[piece] for piece in pieces(np.diff(index) > NEAR))
        parts = [
            self._stretch(int(part[0]), int(part[-1]) + 1)[part - part[0]]
            for part in found if part.size
        ]  # fmt: skip
        return np.concatenate([self._stretch(0, 0), *parts])

    def _stretch(self, start: int, stop: int) -> np.ndarray:
        values = self.variable[start:stop].values
        return values.astype(bool) if self.scale is None else self.scale * values.astype(float)


def blocks(values) -> Iterator[tuple[int, np.ndarray]]:
    """(first index, part) of an array (T, ...), stored or not."""
    for first in range(0, max(len(values), 1), PART):
        yield first, values[first : first + PART]


def pieces(breaks) -> list[slice]:
    """Slices of what is without a gap: ``breaks`` (N - 1,), True where one lies behind sample n."""
    ends = [0, *(np.flatnonzero(breaks) + 1).tolist(), len(breaks) + 1]
    return [slice(first, last) for first, last in pairwise(ends)]


def few(index: np.ndarray) -> np.ndarray:
    """Some of many samples' indices, spread over them."""
    return index[:: max(1, -(-len(index) // PART))]


@dataclass(frozen=True, eq=False)
class Recording:
    """Readings of the triads of one rigid array, in one array frame.

    The readings of a long one may have stayed in its file (`Stored`): `parts` are
    in memory.

    Attributes
    ----------
    time : ndarray (T,), seconds, strictly increasing
    specific_force : ndarray (T, A, 3), m/s^2
    angular_rate : ndarray (T, G, 3), rad/s
    accelerometer_position : ndarray (A, 3), metres
        Nominal; the first triad is the reference.
    accelerometer_labels, gyroscope_labels : tuples of A and of G str
    accelerometer_noise_sd : float, m/s^2
    gyroscope_noise_sd : float, rad/s
    accelerometer_range : float, m/s^2, may be infinite
    gyroscope_range : float, rad/s, may be infinite
    position_prior_sd : float, metres
    stationary : ndarray (T,) bool, or None
        Still poses.
    specific_force_saturated, angular_rate_saturated : ndarray (T, A or G, 3) bool, or None
        Readings at a rail, where a correction moved them off the range (first-order calibration).
    map_covariance : (9 A + 9 G, 9 A + 9 G), or (9 A, 9 A), or None
        Of the 3 x 3 maps, no unit, of accelerometers and gyroscopes that are left between the truth
        and the readings where these were corrected: about the identity, row by row, triad by triad.
        Without gyroscopes where nothing is known of their scale.
    accelerometer_axes : (A, 3, 3), or None
        Rotations from the accelerometers' own axes, those of their chips, to the array's.
    correction : Dataset, or None
        How the readings were corrected (first-order calibration): ``accelerometer_inverse``
        (A, 3, 3) and ``accelerometer_offset`` (A, 3) m/s^2 with ``accelerometer_offset_sd`` where
        the board moves, ``accelerometer_offset_walk`` (A,) m/s^2 per root of a second, the same of
        the gyroscopes in rad/s; readings = inverse @ (raw - offset).
    alignment : Dataset, or None
        How the logs of loose IMUs were brought together (`imuarray.alignment.Alignment.dataset`).
    output_period : float, s, NaN where not declared
        Between readings that the sensors make on clocks of their own, where the host takes the
        newest.
    clock_sd : float, no unit, NaN where the log's clock is taken to run right
        Relative sd of the steps of time: of a rate that was declared and not stamped, or what first
        order doubts of the clock.
    title, source, license : str, empty if not known
    selected : str
        How many samples of how many, where these are not all that were recorded; else empty.
    """

    time: np.ndarray
    specific_force: np.ndarray
    angular_rate: np.ndarray
    accelerometer_position: np.ndarray
    accelerometer_labels: tuple[str, ...]
    gyroscope_labels: tuple[str, ...]
    accelerometer_noise_sd: float
    gyroscope_noise_sd: float
    accelerometer_range: float
    gyroscope_range: float
    position_prior_sd: float
    stationary: np.ndarray | None = None
    specific_force_saturated: np.ndarray | None = None
    angular_rate_saturated: np.ndarray | None = None
    map_covariance: np.ndarray | None = None
    accelerometer_axes: np.ndarray | None = None
    correction: xr.Dataset | None = None
    alignment: xr.Dataset | None = None
    output_period: float = np.nan
    clock_sd: float = np.nan
    title: str = ""
    source: str = ""
    license: str = ""
    selected: str = ""

    def to_dataset(self) -> xr.Dataset:
        """The recording as the file holds it, rates in rad/s; InputError for shapes at odds."""
        types = dict.fromkeys(SI, float) | dict.fromkeys(FLAGS, bool) | dict.fromkeys(MATRICES)
        attrs = {name: {"units": SI.get(name, "1")} for name in (*SI, *MATRICES)}
        variables = {
            name: (DIMENSIONS[name], np.asarray(values, kind), attrs.get(name, {}))
            for name, kind in types.items() if (values := getattr(self, name)) is not None
        }  # fmt: skip
        if self.correction is not None:
            variables |= {name: self.correction[name].variable for name in CORRECTION}
        labels = {kind: getattr(self, f"{kind}_labels") for kind in KINDS} | {"axis": AXES}
        coordinates = {name: (name, np.array(own, object)) for name, own in labels.items()}
        coordinates = {"time": variables.pop("time"), **coordinates}
        declared = [name for name in OPTIONAL_NUMBERS if not np.isnan(getattr(self, name))]
        attributes = {name: float(getattr(self, name)) for name in (*NUMBERS, *declared)}
        attributes |= {name: getattr(self, name) for name in TEXTS if getattr(self, name)}
        try:
            return xr.Dataset(variables, coordinates, attributes)
        except ValueError as error:
            raise InputError(f"recording: expected arrays of matching shapes, {error}") from error

    @property
    def gyroscope_common_covariance(self) -> np.ndarray | None:
        """(9, 9) of the map that all gyroscopes share, their mean's; None if not known."""
        own = by_kind(self.map_covariance, len(self.accelerometer_labels)).get("gyroscope")
        if own is None:
            return None
        count = len(self.gyroscope_labels)
        return own.reshape(count, 9, count, 9).mean(axis=(0, 2))

    @property
    def gyroscope_common_scale_sd(self) -> float:
        """Sd of the scale error that all gyroscopes share, no unit; NaN if not known."""
        common = self.gyroscope_common_covariance
        return np.nan if common is None else float(np.sqrt(common[::4, ::4].sum())) / 3

    def relative_positions(self) -> np.ndarray:
        """Nominal positions relative to the reference triad, (A, 3) metres; row 0 is zero."""
        return self.accelerometer_position - self.accelerometer_position[0]

    def saturated_gyroscopes(self) -> np.ndarray:
        """Rates at the gyroscopes' rail, (T, G, 3) bool."""
        if self.angular_rate_saturated is not None:
            return self.angular_rate_saturated
        return np.abs(self.angular_rate) >= self.gyroscope_range * RAIL

    def saturated_accelerometers(self) -> np.ndarray:
        """Specific forces at the accelerometers' rail, (T, A, 3) bool."""
        if self.specific_force_saturated is not None:
            return self.specific_force_saturated
        return np.abs(self.specific_force) >= self.accelerometer_range * RAIL

    def still(self) -> np.ndarray:
        """Samples (T,) bool of still poses, none of them where these are not marked."""
        return np.zeros(len(self.time), bool) if self.stationary is None else self.stationary

    def at_rail(self, kind: str) -> np.ndarray:
        """Samples (T,) with a reading at its rail of a ``kind``, accelerometer or gyroscope."""
        method = f"saturated_{kind}s"
        return np.concatenate([getattr(p, method)().any(axis=(1, 2)) for p in self.parts()])

    def select(self, index: Any) -> Self:
        """The samples that `index` picks: a slice, a (T,) mask or an array of time indices."""
        left = self._at(index)
        if len(left.time) == len(self.time):
            return left
        whole = self.selected.partition(" of ")[2] or f"{len(self.time)} samples"
        return replace(left, selected=f"{len(left.time)} of {whole}")

    def parts(self) -> Iterator[Self]:
        """The samples in turn, `PART` at a time, in memory."""
        for first in range(0, max(len(self.time), 1), PART):
            yield self._at(slice(first, first + PART))

    def in_memory(self) -> Self:
        """The recording with its readings read; InputError where they are too many."""
        return self._at(slice(None))

    def _at(self, index: Any) -> Self:
        parts = {name: getattr(self, name) for name in SAMPLED}
        return replace(self, **{n: x[index] for n, x in parts.items() if x is not None})


def by_kind(map_covariance, accelerometers: int) -> dict[str, np.ndarray]:
    """A recording's ``map_covariance``, or None, apart: of accelerometers, and of gyroscopes."""
    if map_covariance is None:
        return {}
    split = 9 * accelerometers
    parts = {"accelerometer": slice(split), "gyroscope": slice(split, None)}
    return {kind: map_covariance[p, p] for kind, p in parts.items() if map_covariance[p].size}


def array_of(recording: Recording, gyroscopes: int | None = None) -> Array:
    """The geometry a recording declares, with its own or another number of gyroscope triads."""
    count = recording.angular_rate.shape[1] if gyroscopes is None else gyroscopes
    labels, axes = recording.accelerometer_labels, recording.accelerometer_axes
    return Array(recording.accelerometer_position, labels, count, "recording", axes=axes)
