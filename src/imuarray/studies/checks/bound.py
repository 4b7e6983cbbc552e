"""The Cramer-Rao bound of the positions, motion unknown (left open in paper 2017)."""

import numpy as np
import pandas as pd

from imuarray.estimation.information import information_at
from imuarray.motion import sphere_motion
from imuarray.streams import stream
from imuarray.studies.batches import root_mean_square

REPEATS = 20  # motions averaged over; the bound varies little between them


def bound_table(model, seed, cases) -> pd.DataFrame:
    """RMSE bound for each (samples, |omega|, |omega_dot|, |s|) in ``cases`` (SI units)."""
    rows = []
    for number, (samples, *sizes) in enumerate(cases):
        rng = stream(seed, "position bound", number)
        squares = []  # mean variance over coordinates for each of the motions
        for _ in range(REPEATS):
            motion = sphere_motion(rng, (samples,), *sizes)
            values = np.linalg.eigvalsh(information_at(model, motion, model.array.relative))
            squares.append(np.mean(1.0 / np.maximum(values, 1e-14 * values[-1])))
        bound, error = root_mean_square(squares)
        rows.append(
            {
                "samples": samples,
                "angular_rate_dps": np.degrees(sizes[0]),
                "angular_acceleration_dps2": np.degrees(sizes[1]),
                "bound_m": bound,
                "bound_se_m": error,
            }  # fmt: skip
        )
    return pd.DataFrame(rows)
