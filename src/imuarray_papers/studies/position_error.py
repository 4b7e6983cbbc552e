"""RMSE of the calibrated positions, and its settings: paper 2017, figures 4 and 5."""

from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd

from imuarray.model import ArrayModel
from imuarray_papers.estimation.bcd import block_descent
from imuarray_papers.estimation.collapsed import Collapsed
from imuarray_papers.studies.truths import in_batches, realisations, root_mean_square


def calibrate_batch(model, rng, count, case, options):
    """ML-BCD on ``count`` realisations of a `Case`; ``options`` as for `realise`.

    Returns mean squared position errors (count, marks) in m^2, iterations (count,) and the
    kernel's status (count,): 1 converged, 0 limit, negative not identifiable (NaN errors).
    """
    _, truth, *readings = realisations(
        model, rng, count, case.samples, case.motion, options["position_sd"], options["rail"]
    )
    marks, found = np.asarray(options["marks"], np.int64), []
    for place, *one in zip(truth, *readings, strict=True):
        data, positions = Collapsed.of(model, *one), model.array.relative.copy()
        status, cost, _, snapshots = block_descent(
            data, positions, options["tolerance"], max(options["marks"]), marks
        )
        squares = np.mean((snapshots - place)[:, 1:] ** 2, axis=(1, 2))
        found.append((squares if status >= 0 else np.nan * squares, len(cost), status))
    return [np.array(part) for part in zip(*found, strict=True)]


class Case(NamedTuple):
    """A setting whose RMSE is wanted: a point of figure 4 or 5."""

    names: tuple  # of its random stream
    samples: int
    motion: tuple[float, float, float]  # |omega| rad/s, |omega_dot| rad/s^2, |s| m/s^2


class Errors(NamedTuple):
    """Realisations (R) of some cases (C), with errors after M numbers of iterations."""

    squares: np.ndarray  # (C, R, M) mean squared position errors, m^2, NaN: not identifiable
    iterations: np.ndarray  # (C, R)
    status: np.ndarray  # (C, R), the kernel's: 1 converged, 0 limit, negative not identifiable


def realise(
    model: ArrayModel, seed, cases, options, threads=1, quiet=True, part=0, parts=1
) -> Errors:
    """One of ``parts`` shares of all cases' realisations; a realisation does not depend on them.

    ``options``: realisations, marks (iterations), position_sd (m), rail (rad/s), tolerance (m).
    """

    def of(case):
        def batch(rng, size):
            return calibrate_batch(model, rng, size, case, options)

        given = options["realisations"], threads, quiet, part, parts
        return in_batches(batch, seed, case.names, *given)

    return Errors(*map(np.stack, zip(*map(of, cases), strict=True)))


def joined(shares) -> Errors:
    """All shares of `realise` in their order."""
    return Errors(*(np.concatenate(one, axis=1) for one in zip(*shares, strict=True)))


def table_of(name: str, cases, errors: Errors, marks) -> pd.DataFrame:
    """RMSE for each case and number of iterations of a `study`.

    Of "samples" over N and iterations (figure 4), else for |omega|, |omega_dot|, |s| (figure 5).
    """
    rows = []
    for case, squares, iterations, status in zip(cases, *errors, strict=True):
        good = status >= 0
        for column, mark in enumerate(marks):
            rmse, error = root_mean_square(squares[good, column])
            rows.append({
                "angular_rate_dps": np.degrees(case.motion[0]),
                "angular_acceleration_dps2": np.degrees(case.motion[1]),
                "specific_force_mps2": case.motion[2], "samples": case.samples,
                "iterations": mark, "rmse_m": rmse, "rmse_se_m": error,
                "realisations": int(good.sum()), "not_identifiable": int((~good).sum()),
                "converged_share": float(np.mean(status == 1)),
                "median_iterations": float(np.median(iterations[good])),
            })  # fmt: skip
    table = pd.DataFrame(rows)
    if name == "samples":
        return table.loc[:, "samples":]
    return table.drop(columns=["not_identifiable", "median_iterations"])


FORCES = (0.0, 1.0, 10.0, 100.0)  # m/s^2; section IV: |s| does not matter


def magnitudes(paper: dict) -> tuple[float, float, float]:
    """|omega| rad/s, |omega_dot| rad/s^2, |s| m/s^2 of figure 4."""
    rate = np.radians(paper["angular_rate_dps"])
    return rate, np.radians(paper["angular_acceleration_dps2"]), paper["specific_force"]


def study(settings: dict, name: str) -> tuple[list[Case], dict]:
    """Cases and options of the study: samples, motion or force.

    Figure 4, figure 5, and figure 5's remark that the specific force does not matter.
    """
    paper = settings["paper2017"]
    own = magnitudes(paper)
    if name == "samples":
        points = {count: (count, own) for count in paper["fig4_samples"]}
        marks = sorted(paper["fig4_iterations"])
    elif name == "motion":  # whose rule is given figure 5's settings alone
        pairs = product(paper["fig5_accelerations_dps2"], paper["fig5_rates_dps"])
        motions = [(np.radians(rate), np.radians(change), own[2]) for change, rate in pairs]
        marks = [paper["fig5_iterations"]]
    else:
        motions, marks = [(*own[:2], force) for force in FORCES], [max(paper["fig4_iterations"])]
    if name != "samples":
        points = dict(enumerate((paper["fig5_samples"], motion) for motion in motions))
    return [Case(("position", name, key), *point) for key, point in points.items()], {
        "realisations": settings["scale"]["realisations"],
        "marks": marks,
        "position_sd": paper["position_sd"],
        "rail": np.radians(paper["gyroscope_range_dps"]),
        "tolerance": paper["tolerance"],
    }
