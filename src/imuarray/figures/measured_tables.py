"""Tables of measured data: first-order calibration with noise, agreement between recordings."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.figures.tables import Column

FIRST_ORDER = (
    Column("recording", "recording", "recording"),
    Column("triad", "IMU", "IMU"),
    Column(
        "residual_rms", "residual in still poses (mm/s²)", r"residual (mm/s$^2$)", "{:.2f}", 1e3
    ),
    Column("left_out", "poses left out", "left out"),
    Column("force_sd", "accelerometer noise (mm/s²)", r"acc. (mm/s$^2$)", "{:.1f}", 1e3),
    Column("force_ratio", "/ papers' σa", r"/ $\sigma_a$", "{:.2f}"),
    Column("rate_sd", "gyroscope noise (deg/s)", "gyro. (deg/s)", "{:.3f}", float(np.degrees(1.0))),
    Column("rate_ratio", "/ papers' σg", r"/ $\sigma_g$", "{:.2f}"),
    Column("rate_correlation", "gyroscopes, neighbours' correlation", "corr.", "{:+.2f}"),
)

AGREEMENT = (
    Column("samples", "T", "$T$"),
    Column("assumed", "assumed σa", r"assumed $\sigma_a$"),
    Column("accelerometer_sd", "its value (m/s²)", r"$\sigma_a$ (m/s$^2$)", "{:.2f}"),
    Column("claimed_m", "claimed sd (µm)", r"claimed ($\mu$m)", "{:.3g}", 1e6),
    Column("spread_m", "sd between recordings (µm)", r"between ($\mu$m)", "{:.3g}", 1e6),
    Column("z_rms", "rms z", "rms $z$", "{:.2f}"),
    Column("coverage_50", "50 % intervals cover (%)", r"50 \%", "{:.0f}", 100.0),
    Column("coverage_95", "95 % intervals cover (%)", r"95 \%", "{:.0f}", 100.0),
)


def first_order_table(sources: dict[str, tuple[pd.DataFrame, pd.DataFrame]]) -> pd.DataFrame:
    """A row for each recording and IMU from its residual and noise tables.

    The noise of an IMU is the root mean square over its axes, SI units.
    """
    rows = []
    for name, (residuals, noise) in sources.items():
        sizes = {
            (sensor, str(triad)): part
            for (sensor, triad), part in noise.groupby(["sensor", "triad"])
        }
        for row in residuals.itertuples():
            entry = {"recording": name, "triad": str(row.triad)}
            entry |= {"residual_rms": row.residual_rms, "left_out": row.left_out}
            for sensor, short in (("specific_force", "force"), ("angular_rate", "rate")):
                part = sizes.get((sensor, str(row.triad)))
                if part is None:
                    continue
                sd = float(np.sqrt(np.mean(part.sd**2)))
                entry |= {f"{short}_sd": sd, f"{short}_ratio": sd / part.declared.iloc[0]}
                entry[f"{short}_correlation"] = part.correlation.mean()
            rows.append(entry)
    return pd.DataFrame(rows)
