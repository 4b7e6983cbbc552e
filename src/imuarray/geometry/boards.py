"""Arrays by name, from a file or a configuration, checked.

The MIMU4444 board of both papers: 16 IMUs on the top side, 16 on the underside.

The text of paper 2021 fixes this much of the numbering: odd IMUs are on the top
side, even ones on the underside beneath them, and IMU 1 is drawn in the lower left
corner of the top side. The published recordings put IMU 1 at (-9.45, +9.45) mm and
turn the underside around what is y = -x in their coordinates, where the paper says
y = x: the two agree when the paper's drawing has its y axis pointing down, and so
are our drawings and our numbering (down the y axis, then along x). The order of the
inner IMUs is our convention; no result depends on it.
"""

import csv
from dataclasses import replace

import numpy as np

from imuarray.errors import IdentifiabilityError, InputError, require
from imuarray.geometry.array import Array, require_count, require_planar_extent

PITCH = 6.3e-3  # m, between package centres in the plane
THICKNESS = 2.0e-3  # m, between top and underside
# Takes a vector from an underside IMU's own axes to the array frame (180 degrees around
# the line y = -x, drawn as y = x with the y axis down).
UNDERSIDE_ROTATION = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def mimu4444() -> Array:
    """The 32-IMU board: 4 x 4 positions at 6.3 mm pitch, top and underside 2 mm apart."""
    steps = (np.arange(4) - 1.5) * PITCH
    rows = [[x, y, side * THICKNESS / 2] for x in steps for y in -steps for side in (1, -1)]
    return Array(np.array(rows), tuple(str(k) for k in range(1, 33)), 32, "mimu4444")


def mimu4444_corners() -> Array:
    """The eight corner IMUs, in the order of the published recordings."""
    edge = 1.5 * PITCH
    corners = [(-edge, edge), (-edge, -edge), (edge, edge), (edge, -edge)]
    rows = [[x, y, side * THICKNESS / 2] for x, y in corners for side in (1, -1)]
    return Array(np.array(rows), tuple(str(k) for k in range(1, 9)), 8, "mimu4444_corners")


BOARDS = {"mimu4444": mimu4444, "mimu4444_corners": mimu4444_corners}


def array_from_csv(path: str, gyroscopes: int | None = None) -> Array:
    """Read positions in metres from a CSV file with a header ``label,x,y,z``.

    Raises InputError for a missing file, a wrong header, or a field that is no finite number.
    """
    try:
        with open(path, newline="", encoding="utf-8") as handle:
            rows = [[cell.strip() for cell in row] for row in csv.reader(handle) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: expected a readable CSV file of positions: {error}") from None
    head = [cell.lower() for cell in rows[0]] if rows else []
    require(head == ["label", "x", "y", "z"], path, "the header label,x,y,z", rows[:1])
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
    count = section.get("gyroscopes")
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
    known = section.get("board") in BOARDS
    require(known, "array", f"board ({', '.join(BOARDS)}), file or positions", section)
    board = BOARDS[section["board"]]()
    checked = _checked(board.positions, board.labels, count, board.name)
    return replace(board, gyroscopes=checked.gyroscopes)


def _checked(values, labels, gyroscopes, where) -> Array:
    threes = values.ndim == 2 and values.shape[1] == 3
    require(threes, where, "rows of x, y, z", f"shape {values.shape}")
    for number, row in enumerate(values, 1):
        require(np.isfinite(row).all(), where, "finite positions", f"{row} in row {number}")
    different = len(set(labels)) == len(values)
    require(different, where, f"{len(values)} different labels", list(labels))
    require_planar_extent(values, where)
    count = len(values) if gyroscopes is None else int(gyroscopes)
    require_count(len(values), where, "accelerometer")
    require_count(count, where, "gyroscope")
    if count < 1:
        raise IdentifiabilityError(f"{where}: expected at least 1 gyroscope triad, found {count}")
    return Array(values, tuple(str(x) for x in labels), count, name=str(where))
