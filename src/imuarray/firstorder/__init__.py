"""First-order calibration of each triad from still poses, as paper 2021 does it (section IV-B)."""

from imuarray.firstorder.allan import allan_deviation
from imuarray.firstorder.correct import FirstOrder, calibrate_first_order, correct
from imuarray.firstorder.still import still_poses
from imuarray.firstorder.triads import TriadFit, fit_triads

__all__ = [
    "FirstOrder",
    "TriadFit",
    "allan_deviation",
    "calibrate_first_order",
    "correct",
    "fit_triads",
    "still_poses",
]
