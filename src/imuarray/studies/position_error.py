"""RMSE of the calibrated positions: paper 2017, figures 4 and 5."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.estimation.bcd import descend
from imuarray.estimation.collapsed import Collapsed, tables
from imuarray.model import ArrayModel
from imuarray.motion import sphere_motion
from imuarray.simulation import measure
from imuarray.studies.batches import batch_stream, batches, root_mean_square, run_batches


def calibrate_batch(model, rng, count, samples, motion, position_sd, rail, limit, tolerance, marks):
    """ML-BCD on ``count`` realisations of ``samples`` samples.

    Returns mean squared position errors (count, marks) in m^2, iterations (count,) and the
    kernel's status (count,): 1 converged, 0 limit, negative not identifiable (NaN errors).
    """
    array = model.array
    errors = position_sd * rng.standard_normal((count, array.accelerometers, 3))
    truth = array.relative + errors - errors[:, :1]
    moves = sphere_motion(rng, (count, samples), *motion)
    force, rate, saturated = measure(model, moves, truth, rng, gyroscope_range=rail)
    squares = np.full((count, len(marks)), np.nan)
    iterations, status = np.zeros(count, int), np.zeros(count, int)
    marks = np.asarray(marks, np.int64)
    for i in range(count):
        data = Collapsed.of(model, force[i], rate[i], saturated[i])
        positions = array.relative.copy()
        snapshots = np.empty((len(marks), *positions.shape))
        iterations[i], status[i] = descend(
            data.specific_force, data.energy, data.moments, data.mean,
            data.gyroscope_information, data.weights, *tables(), positions,
            tolerance, 0.0, limit, marks, snapshots, np.empty(limit), np.empty(limit),
        )  # fmt: skip
        if status[i] >= 0:
            squares[i] = np.mean((snapshots - truth[i])[:, 1:] ** 2, axis=(1, 2))
    return squares, iterations, status


def _point(model, seed, names, options, samples, motion, threads, quiet):
    """All realisations of one setting, in batches: squares, iterations, status."""

    def job(batch):
        number, size = batch
        rng = batch_stream(seed, *names, number)
        return calibrate_batch(
            model, rng, size, samples, motion, options["position_sd"], options["rail"],
            max(options["marks"]), options["tolerance"], options["marks"],
        )  # fmt: skip

    parts = run_batches(
        job, batches(options["realisations"]), threads, quiet, "/".join(map(str, names))
    )
    return [np.concatenate(part) for part in zip(*parts, strict=True)]


def rmse_against_samples(
    model: ArrayModel, seed, sample_counts, motion, options, threads=1, quiet=True
) -> pd.DataFrame:
    """Figure 4: RMSE over N and iterations; one row for each pair.

    ``motion``: magnitudes |omega| rad/s, |omega_dot| rad/s^2, |s| m/s^2. ``options``:
    realisations, marks (iterations), position_sd (m), rail (rad/s), tolerance (m).
    """
    rows = []
    for samples in sample_counts:
        squares, iterations, status = _point(
            model, seed, ("position", "samples", samples), options, samples, motion, threads, quiet
        )
        good = status >= 0
        for column, mark in enumerate(options["marks"]):
            rmse, error = root_mean_square(squares[good, column])
            rows.append(
                {
                    "samples": samples,
                    "iterations": mark,
                    "rmse_m": rmse,
                    "rmse_se_m": error,
                    "realisations": int(good.sum()),
                    "not_identifiable": int((~good).sum()),
                    "converged_share": float(np.mean(status == 1)),
                    "median_iterations": float(np.median(iterations[good])),
                }  # fmt: skip
            )
    return pd.DataFrame(rows)


def rmse_against_motion(
    model: ArrayModel, seed, study, samples, motions, options, threads=1, quiet=True
) -> pd.DataFrame:
    """Figure 5: RMSE for each (|omega|, |omega_dot|, |s|) in ``motions`` (SI units).

    ``study`` names the random streams, so that two studies never share them."""
    rows = []
    for number, motion in enumerate(motions):
        squares, _, status = _point(
            model, seed, ("position", study, number), options, samples, motion, threads, quiet
        )
        good = status >= 0
        rmse, error = root_mean_square(squares[good, -1])
        rows.append(
            {
                "angular_rate_dps": np.degrees(motion[0]),
                "angular_acceleration_dps2": np.degrees(motion[1]),
                "specific_force_mps2": motion[2],
                "samples": samples,
                "iterations": options["marks"][-1],
                "rmse_m": rmse,
                "rmse_se_m": error,
                "realisations": int(good.sum()),
                "converged_share": float(np.mean(status == 1)),
            }  # fmt: skip
        )
    return pd.DataFrame(rows)
