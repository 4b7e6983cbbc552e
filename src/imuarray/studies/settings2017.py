"""Paper 2017's settings from a configuration, in SI units."""

import numpy as np

from imuarray.studies import position_error
from imuarray.studies.position_error import Case

FORCES = (0.0, 1.0, 10.0, 100.0)  # m/s^2; section IV: |s| does not matter
TABLES = {
    "samples": position_error.against_samples,
    "motion": position_error.against_motion,
    "force": position_error.against_motion,
}


def magnitudes(paper: dict) -> tuple[float, float, float]:
    """|omega| rad/s, |omega_dot| rad/s^2, |s| m/s^2 of figure 4."""
    rate = np.radians(paper["angular_rate_dps"])
    return rate, np.radians(paper["angular_acceleration_dps2"]), paper["specific_force"]


def study(settings: dict, name: str) -> tuple[list[Case], dict]:
    """Cases and options of `imuarray.studies.position_error`: samples, motion or force.

    Figure 4, figure 5, and figure 5's remark that the specific force does not matter.
    """
    paper = settings["paper2017"]
    own = magnitudes(paper)
    if name == "samples":
        cases = [Case(("position", name, n), n, own) for n in paper["fig4_samples"]]
        return cases, _options(settings, paper["fig4_iterations"])
    if name == "motion":
        marks = [paper["fig5_iterations"]]
        motions = [
            (np.radians(rate), np.radians(acceleration), own[2])
            for acceleration in paper["fig5_accelerations_dps2"]
            for rate in paper["fig5_rates_dps"]
        ]
    else:
        marks, motions = [max(paper["fig4_iterations"])], [(*own[:2], force) for force in FORCES]
    cases = [
        Case(("position", name, number), paper["fig5_samples"], motion)
        for number, motion in enumerate(motions)
    ]
    return cases, _options(settings, marks)


def _options(settings: dict, marks) -> dict:
    paper = settings["paper2017"]
    return {
        "realisations": settings["scale"]["realisations"],
        "marks": sorted(marks),
        "position_sd": paper["position_sd"],
        "rail": np.radians(paper["gyroscope_range_dps"]),
        "tolerance": paper["tolerance"],
    }
