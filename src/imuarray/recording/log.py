"""What one IMU logged by itself, on its own clock and in its own axes."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Log:
    """Readings of one IMU as its logger stamped them; a blank reading is not there.

    Attributes
    ----------
    label : str
    accelerometer_time : ndarray (N,), seconds on the logger's clock, strictly increasing
    specific_force : ndarray (N, 3), m/s^2, in the chip's own axes
    gyroscope_time : ndarray (M,), seconds on the same clock, strictly increasing
        The two kinds may have different rates.
    angular_rate : ndarray (M, 3), rad/s, in the chip's own axes
    position : ndarray (3,), metres, nominal, in the array frame
    axes : ndarray (3, 3), or None
        Rotation from the chip's axes to the array's; None where nobody knows it.
    accelerometer_noise_sd, accelerometer_range : float, m/s^2
    gyroscope_noise_sd, gyroscope_range : float, rad/s
    epoch : float, the stamp in s from which the times are counted
    """

    label: str
    accelerometer_time: np.ndarray
    specific_force: np.ndarray
    gyroscope_time: np.ndarray
    angular_rate: np.ndarray
    position: np.ndarray
    axes: np.ndarray | None
    accelerometer_noise_sd: float
    accelerometer_range: float
    gyroscope_noise_sd: float
    gyroscope_range: float
    epoch: float = 0.0
