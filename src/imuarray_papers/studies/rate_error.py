"""RMSE of the estimated motion when positions are wrong: paper 2017, figure 3."""

from itertools import product

import numpy as np
import pandas as pd

from imuarray.model import ArrayModel
from imuarray.streams import stream
from imuarray_papers.estimation.collapsed import estimate_motion
from imuarray_papers.studies.truths import in_batches, realisations, root_mean_square


def square_errors(model, rng, count, motion, position_sd, rail, gyroscopes: bool = True):
    """Squared errors of ``count`` realisations, each with its own true positions.

    The estimator assumes the nominal positions. Returns (count,) means over axes for the
    array's omega, the gyroscopes' average, the array's omega_dot and s, and convergence. Without
    ``gyroscopes`` these only start the search, which decides the sign of omega.
    """
    moves, _, *readings = realisations(model, rng, count, 1, motion, position_sd, rail)
    force, rate, saturated = (part[:, 0] for part in readings)
    lost = saturated if gyroscopes else np.ones(rate.shape, bool)
    found = estimate_motion(model, force, rate, saturated=lost)
    true = [field[:, 0] for field in moves]
    pairs = (
        (found.motion.angular_rate, true[0]), (rate.mean(axis=1), true[0]),
        (found.motion.angular_acceleration, true[1]), (found.motion.specific_force, true[2]),
    )  # fmt: skip
    squares = [np.mean((estimate - value) ** 2, axis=1) for estimate, value in pairs]
    return (*squares, found.converged)


def rmse_against_rate(
    model: ArrayModel, seed, rates, angular_acceleration, specific_force, position_sds,
    realisations, rail, threads=1,
) -> pd.DataFrame:  # fmt: skip
    """Figure 3: RMSE of the motion for each |omega| (rad/s) and position error sd (m)."""
    rows = []
    for position_sd, (number, rate) in product(position_sds, enumerate(rates)):
        sizes = (rate, angular_acceleration, specific_force)

        def batch(rng, size, sizes=sizes, sd=position_sd):
            return square_errors(model, rng, size, sizes, sd, rail)

        names = ("rate", f"{position_sd:g}", number)
        array, gyroscopes, acceleration, force, converged = in_batches(
            batch, seed, names, realisations, threads
        )
        row = {"angular_rate_dps": np.degrees(rate), "position_sd_m": position_sd}
        for name, squares in (("array", array), ("gyroscopes", gyroscopes)):
            rmse, error = root_mean_square(squares)
            row[f"{name}_rmse_dps"], row[f"{name}_rmse_se_dps"] = np.degrees([rmse, error])
        row["acceleration_rmse_dps2"] = np.degrees(root_mean_square(acceleration)[0])
        row["specific_force_rmse_mps2"] = root_mean_square(force)[0]
        row["converged_share"] = float(converged.mean())
        row["realisations"] = realisations
        rows.append(row)
    return pd.DataFrame(rows)


def accelerometers_only(
    model, seed, rates, angular_acceleration, specific_force, position_sds, count
) -> pd.DataFrame:
    """RMSE of omega from the accelerometers alone, and the gyroscopes' average (conclusion).

    Against |omega| (rad/s) and position error sd (m).
    """
    average = np.sqrt(model.noise.gyroscope[0, 0] / model.array.gyroscopes)
    rows = []
    for position_sd, (number, rate) in product(position_sds, enumerate(rates)):
        rng = stream(seed, "accelerometers only", f"{position_sd:g}", number)
        sizes = (rate, angular_acceleration, specific_force)
        squares, _, acceleration, *_ = square_errors(
            model, rng, count, sizes, position_sd, np.inf, gyroscopes=False
        )
        rmse, error = root_mean_square(squares)
        rows.append({
            "angular_rate_dps": np.degrees(rate), "position_sd_m": position_sd,
            "rmse_dps": np.degrees(rmse), "rmse_se_dps": np.degrees(error),
            "gyroscopes_average_dps": np.degrees(average),
            "acceleration_rmse_dps2": np.degrees(root_mean_square(acceleration)[0]),
            "realisations": count,
        })  # fmt: skip
    return pd.DataFrame(rows)
