"""Where the triads sit on the board."""

from imuarray.geometry.array import Array, positions_of, sub_array
from imuarray.geometry.boards import (
    UNDERSIDE_ROTATION,
    array_from_config,
    array_from_csv,
    mimu4444,
    mimu4444_corners,
)
