"""Angular rate from the accelerometers alone: the sentence on 10 um in paper 2017's conclusion."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.estimation import estimate_motion
from imuarray.motion import sphere_motion
from imuarray.simulation import measure
from imuarray.streams import stream
from imuarray.studies.batches import root_mean_square


def _squares(model, rng, count, motion_sizes, position_sd):
    """Mean squared errors (count,) of omega and of omega_dot with every gyroscope left out."""
    array = model.array
    errors = position_sd * rng.standard_normal((count, array.accelerometers, 3))
    truth = array.relative + errors - errors[:, :1]
    motion = sphere_motion(rng, (count, 1), *motion_sizes)
    force, rate, _ = measure(model, motion, truth, rng)
    # left out they still start the iteration, which decides the sign of omega
    lost = np.ones(rate[:, 0].shape, bool)
    found = estimate_motion(model, force[:, 0], rate[:, 0], saturated=lost).motion
    pairs = ((found.angular_rate, motion[0]), (found.angular_acceleration, motion[1]))
    return [np.mean((estimate - true[:, 0]) ** 2, axis=1) for estimate, true in pairs]


def accelerometers_only(
    model, seed, rates, angular_acceleration, specific_force, position_sds, count
) -> pd.DataFrame:
    """RMSE against |omega| (rad/s) and position error sd (m), and the gyroscopes' average."""
    average = np.sqrt(model.noise.gyroscope[0, 0] / model.array.gyroscopes)
    rows = []
    for position_sd in position_sds:
        for number, rate in enumerate(rates):
            rng = stream(seed, "accelerometers only", f"{position_sd:g}", number)
            sizes = (rate, angular_acceleration, specific_force)
            squares, acceleration = _squares(model, rng, count, sizes, position_sd)
            rmse, error = root_mean_square(squares)
            rows.append(
                {
                    "angular_rate_dps": np.degrees(rate),
                    "position_sd_m": position_sd,
                    "rmse_dps": np.degrees(rmse),
                    "rmse_se_dps": np.degrees(error),
                    "gyroscopes_average_dps": np.degrees(average),
                    "acceleration_rmse_dps2": np.degrees(root_mean_square(acceleration)[0]),
                    "realisations": count,
                }  # fmt: skip
            )
    return pd.DataFrame(rows)
