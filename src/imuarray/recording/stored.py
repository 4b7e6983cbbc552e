"""Readings that stay in their file: a recording larger than memory is read part by part."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from imuarray.errors import InputError

PART = 2**15  # samples: 50 MB of 32 IMUs
MAX_VALUES = 200_000_000  # 1.6 GB as float64: what is held in memory at once
NEAR = 64  # samples between two that are read in one go


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

    def __getitem__(self, wanted) -> np.ndarray | Stored:
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
        if math.prod(shape) > MAX_VALUES:
            where = self.variable.encoding.get("source", "recording")
            raise InputError(
                f"{where}: expected at most {MAX_VALUES} values to hold in memory, found shape"
                f" {shape}"
            )
        if self.index is None:
            return self._stretch(start, stop)
        index = self.index[start:stop]
        ends = np.flatnonzero(np.diff(index) > NEAR) + 1
        parts = [
            self._stretch(int(part[0]), int(part[-1]) + 1)[part - part[0]]
            for part in np.split(index, ends) if part.size
        ]  # fmt: skip
        return np.concatenate([self._stretch(0, 0), *parts])

    def _stretch(self, start: int, stop: int) -> np.ndarray:
        values = self.variable[start:stop].values
        return values.astype(bool) if self.scale is None else self.scale * values.astype(float)


def blocks(values) -> Iterator[tuple[int, np.ndarray]]:
    """(first index, part) of an array (T, ...), stored or not."""
    for first in range(0, max(len(values), 1), PART):
        yield first, values[first : first + PART]


def few(index: np.ndarray) -> np.ndarray:
    """Of many samples' indices a part, spread over them."""
    return index[:: max(1, -(-len(index) // PART))]
