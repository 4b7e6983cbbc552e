"""Maximum likelihood: motion given positions, and positions with the motion."""

from imuarray.estimation.bcd import Calibration, calibrate_bcd
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.gauss_newton import calibrate_gauss_newton
from imuarray.estimation.motion_ml import MotionEstimate, estimate_motion

__all__ = [
    "Calibration",
    "Collapsed",
    "MotionEstimate",
    "calibrate_bcd",
    "calibrate_gauss_newton",
    "estimate_motion",
]
