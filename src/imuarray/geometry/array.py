"""An array of triads on one rigid body: labels, nominal positions, sides."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field

import numpy as np

from imuarray.errors import IdentifiabilityError, InputError


@dataclass(frozen=True)
class Array:
    """Nominal geometry of an inertial sensor array.

    Attributes
    ----------
    positions : ndarray (A, 3), metres, array frame
        Accelerometer triads; the first is the reference.
    labels : tuple of A str
    gyroscopes : int
        Number G of gyroscope triads (all measure the same angular rate).
    package : tuple of 3 floats, metres
        Outline of one IMU package, for drawings only.
    """

    positions: np.ndarray
    labels: tuple[str, ...]
    gyroscopes: int
    name: str = "array"
    package: tuple[float, float, float] = field(default=(0.004, 0.004, 0.001))

    @property
    def accelerometers(self) -> int:
        """Number A of accelerometer triads."""
        return len(self.positions)

    @property
    def relative(self) -> np.ndarray:
        """Positions relative to the reference triad, (A, 3) metres; row 0 is zero."""
        return self.positions - self.positions[0]

    @property
    def parameters(self) -> np.ndarray:
        """theta of paper 2021: r_2 ... r_A relative to r_1, shape (3 (A - 1),), metres."""
        return self.relative[1:].ravel()


def sub_array(array: Array, triads: int) -> Array:
    """``triads`` of an array's IMUs, spread evenly over its list."""
    if triads >= array.accelerometers:
        return array
    chosen = np.linspace(0, array.accelerometers - 1, triads).round().astype(int)
    labels = tuple(array.labels[k] for k in chosen)
    return Array(array.positions[chosen], labels, triads, array.name, array.package)


def positions_of(theta) -> np.ndarray:
    """(A, 3) m relative to the reference triad, of theta (3 (A - 1),), r_2 ... r_A."""
    return np.vstack([np.zeros(3), np.reshape(theta, (-1, 3))])


def require_planar_extent(positions: np.ndarray, where: str = "array") -> None:
    """Raise IdentifiabilityError for fewer than three or collinear triads (2017, section II)."""
    if len(positions) < 3:
        raise IdentifiabilityError(
            f"{where}: expected at least 3 accelerometer triads, found {len(positions)}"
        )
    spread = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
    if spread[1] <= 1e-9 * max(spread[0], 1e-300) or spread[0] == 0.0:
        raise IdentifiabilityError(
            f"{where}: expected accelerometer triads that span a plane, found them collinear"
        )


def array_from_csv(path: str, gyroscopes: int | None = None) -> Array:
    """Read positions in metres from a CSV file with a header ``label,x,y,z``.

    Raises InputError for a missing file, a wrong header, or a field that is no finite number.
    """
    try:
        with open(path, newline="", encoding="utf-8") as handle:
            rows = [[cell.strip() for cell in row] for row in csv.reader(handle) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: expected a readable CSV file of positions: {error}") from None
    if not rows or [cell.lower() for cell in rows[0]] != ["label", "x", "y", "z"]:
        raise InputError(f"{path}: expected the header label,x,y,z, found {rows[:1]}")
    labels, values = [], []
    for number, row in enumerate(rows[1:], start=2):
        try:
            values.append([float(cell) for cell in row[1:4]])
            if len(row) != 4 or not np.all(np.isfinite(values[-1])):
                raise ValueError
        except ValueError:
            raise InputError(
                f"{path}:{number}: expected label,x,y,z in metres, found {row}"
            ) from None
        labels.append(row[0])
    return _checked(np.array(values).reshape(-1, 3), labels, gyroscopes, path)


def array_from_config(section: dict) -> Array:
    """Build the array that a config's ``array`` section names.

    ``board``: ``mimu4444`` or ``mimu4444_corners``; or ``file``: a CSV of positions;
    or ``positions``: a list of [x, y, z] in metres. ``gyroscopes`` defaults to A.
    """
    from imuarray.geometry.mimu4444 import mimu4444, mimu4444_corners

    count = section.get("gyroscopes")
    boards = {"mimu4444": mimu4444, "mimu4444_corners": mimu4444_corners}
    if "positions" in section:
        try:
            values = np.asarray(section["positions"], float)
        except (TypeError, ValueError):
            raise InputError(
                f"array.positions: expected rows of three numbers, found {section['positions']}"
            ) from None
        labels = [str(k + 1) for k in range(len(values))]
        return _checked(values, section.get("labels", labels), count, "array.positions")
    if "file" in section:
        return array_from_csv(section["file"], count)
    if section.get("board") not in boards:
        raise InputError(
            f"array: expected board ({', '.join(boards)}), file or positions, found {section}"
        )
    board = boards[section["board"]]()
    checked = _checked(board.positions, board.labels, count, board.name)
    return board if count is None else checked


def _checked(values, labels, gyroscopes, where) -> Array:
    if values.ndim != 2 or values.shape[1] != 3:
        raise InputError(f"{where}: expected rows of x, y, z, found shape {values.shape}")
    if not np.all(np.isfinite(values)):
        row = int(np.argwhere(~np.isfinite(values))[0, 0]) + 1
        raise InputError(
            f"{where}: expected finite positions, found {values[row - 1]} in row {row}"
        )
    if len(set(labels)) != len(values):
        raise InputError(f"{where}: expected {len(values)} different labels, found {list(labels)}")
    require_planar_extent(values, where)
    count = len(values) if gyroscopes is None else int(gyroscopes)
    if count < 1:
        raise IdentifiabilityError(f"{where}: expected at least 1 gyroscope triad, found {count}")
    return Array(values, tuple(str(x) for x in labels), count, name=str(where))
