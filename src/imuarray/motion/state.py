"""The motion of the array at one or many instants."""

from typing import NamedTuple

import numpy as np

# Of the fields of `Motion`, in datasets: those that measurements determine, and the higher ones.
UNITS = {"angular_rate": "rad s-1", "angular_acceleration": "rad s-2", "specific_force": "m s-2"}
HIGHER_UNITS = {"angular_jerk": "rad s-3", "force_rate": "m s-3"}


class Motion(NamedTuple):
    """Motion of the array's reference triad in the array frame (paper 2021, eq. 4).

    Every field has shape (..., 3). The last two are needed only by effects that look
    a little forward or back in time (delays, clocks); they are zero where unknown.
    """

    angular_rate: np.ndarray  # omega, rad/s
    angular_acceleration: np.ndarray  # omega dot, rad/s^2
    specific_force: np.ndarray  # s, m/s^2
    angular_jerk: np.ndarray  # omega double dot, rad/s^3
    force_rate: np.ndarray  # s dot, m/s^3

    @classmethod
    def of(cls, angular_rate, angular_acceleration, specific_force) -> "Motion":
        """A motion whose higher derivatives are not known (zero)."""
        nothing = np.zeros_like(np.asarray(angular_rate, float))
        return cls(angular_rate, angular_acceleration, specific_force, nothing, nothing)

    def select(self, index) -> "Motion":
        """The samples that ``index`` picks along the first axis."""
        return Motion(*(np.asarray(field)[index] for field in self))
