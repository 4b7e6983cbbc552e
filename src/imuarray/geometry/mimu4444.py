"""The MIMU4444 board of both papers: 16 IMUs on the top side, 16 on the underside.

The text of paper 2021 fixes this much of the numbering: odd IMUs are on the top
side, even ones on the underside beneath them, and IMU 1 is drawn in the lower left
corner of the top side. The published recordings put IMU 1 at (-9.45, +9.45) mm and
turn the underside around what is y = -x in their coordinates, where the paper says
y = x: the two agree when the paper's drawing has its y axis pointing down, and so
are our drawings and our numbering (down the y axis, then along x). The order of the
inner IMUs is our convention; no result depends on it.
"""

import numpy as np

from imuarray.geometry.array import Array

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
