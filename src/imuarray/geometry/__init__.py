"""Where the triads sit on the board."""

from imuarray.geometry.array import Array, positions_of, sub_array
from imuarray.geometry.mimu4444 import UNDERSIDE_ROTATION, mimu4444, mimu4444_corners
from imuarray.geometry.read import array_from_config, array_from_csv
