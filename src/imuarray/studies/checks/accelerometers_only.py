"""Angular rate from the accelerometers alone: the sentence on 10 um in paper 2017's conclusion."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.streams import stream
from imuarray.studies.batches import root_mean_square
from imuarray.studies.rate_error import square_errors


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
            squares, _, acceleration, *_ = square_errors(
                model, rng, count, sizes, position_sd, np.inf, gyroscopes=False
            )
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
