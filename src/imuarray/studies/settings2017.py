"""Paper 2017's settings from a configuration, in SI units."""

import numpy as np


def magnitudes(paper: dict) -> tuple[float, float, float]:
    """|omega| rad/s, |omega_dot| rad/s^2, |s| m/s^2 of figure 4."""
    rate = np.radians(paper["angular_rate_dps"])
    return rate, np.radians(paper["angular_acceleration_dps2"]), paper["specific_force"]


def options(settings: dict, marks) -> dict:
    """Options of `imuarray.studies.position_error` with RMSE noted at iterations ``marks``."""
    paper = settings["paper2017"]
    return {
        "realisations": settings["scale"]["realisations"],
        "marks": sorted(marks),
        "position_sd": paper["position_sd"],
        "rail": np.radians(paper["gyroscope_range_dps"]),
        "tolerance": paper["tolerance"],
    }
