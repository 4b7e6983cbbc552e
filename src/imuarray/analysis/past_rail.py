"""How well an array measures an angular rate beyond its gyroscopes' rail (2017, figure 3).

On a measured recording nobody knows the rate past the gyroscopes' rail. So a lower rail is made
up: readings beyond it are withheld from all estimates and compared with them.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.analysis.known import fused
from imuarray.engine.fusion import fuse
from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.recording import Recording, array_of

BINS = (250, 350, 500, 700, 1000, 1400, 2000)  # deg/s; the first is the rail that is made up
PER_BIN = 150  # samples
ASSUMED = 0.79  # m/s^2, the accelerometers' noise in paper 2021's experiment


def past_rail(
    recording: Recording, calibration: xr.Dataset, bins=BINS, per_bin: int = PER_BIN
) -> pd.DataFrame:
    """Errors of withheld gyroscope readings, as several models predict them.

    Parameters
    ----------
    recording
        Whole and corrected; samples at a true rail are not used.
    calibration
        Of the board, from other recordings. The recording's biases, clocks, noise and motion are
        fitted without the withheld readings.
    bins
        Edges in deg/s of the withheld axis' rate; the first is the rail.

    Returns
    -------
    DataFrame
        A row per model (``clipped``; the papers' with ``nominal`` or ``calibrated`` positions and,
        ``delayed``, the gyroscopes' lead (`lead_of`); ``board``, the whole calibration) and bin of
        the withheld axis' rate: mid ``rate_dps``, ``readings`` (of all gyroscopes, which share an
        error), ``rmse_dps``, ``median_dps`` of the absolute error, ``above_100`` the share beyond
        100 deg/s, and for ``board`` what it claims: ``sd_dps`` (median), ``rms_sd_dps`` and
        ``within_95``.

    InputError where no sample is beyond the rail.
    """
    lowest = np.radians(bins[0])
    index = _choose(recording, np.radians(bins), per_bin)
    chosen = recording.select(index)
    withheld = (np.abs(chosen.angular_rate) >= lowest).any(axis=1, keepdims=True)
    withheld = np.broadcast_to(withheld, chosen.angular_rate.shape)
    hidden = _hidden(recording, index, withheld, lowest)
    clipped = hidden.select(index)
    found = {"clipped": clipped.angular_rate}
    positions, lead = calibration["position"].to_numpy(), lead_of(calibration)
    ways = {
        "nominal": (recording.relative_positions(), 0.0), "calibrated": (positions, 0.0),
        "delayed": (positions, lead),
    }  # fmt: skip
    for name, way in ways.items():
        found[name] = _predicted(clipped, withheld, *way)
    whole = fused(hidden, calibration, np.isin(recording.time, chosen.time))
    values, sd = (part[:, : withheld.shape[1], 3:] for part in whole.predictions())
    errors = {name: value - chosen.angular_rate for name, value in found.items()}
    errors["board"] = values - chosen.angular_rate
    rates = np.abs(chosen.angular_rate.mean(axis=1, keepdims=True))
    rates = np.broadcast_to(rates, withheld.shape)
    return _table(errors, {"board": sd}, withheld, np.degrees(rates), bins)


def _hidden(recording: Recording, index, withheld, rail: float) -> Recording:
    """The recording with the ``withheld`` readings (T, G, 3) of some samples at a rail.

    Of these their sides are left, and that the rate is as large as the rail.
    """
    rate, rails = recording.angular_rate.copy(), recording.saturated_gyroscopes().copy()
    rate[index] = np.where(withheld, np.copysign(rail, rate[index]), rate[index])
    rails[index] |= withheld
    return replace(recording, angular_rate=rate, angular_rate_saturated=rails)


def _predicted(clipped: Recording, withheld, positions, lead: float) -> np.ndarray:
    """Gyroscopes' readings (T, 1, 3) rad/s by the papers' model, ``lead`` s after the motion."""
    model = ArrayModel.isotropic(array_of(clipped), ASSUMED, clipped.gyroscope_noise_sd)
    motion = fuse(
        model, clipped.specific_force, clipped.angular_rate,
        (positions - positions[0])[1:].ravel(), None, withheld,
    ).estimate.motion  # fmt: skip
    return (motion.angular_rate + lead * motion.angular_acceleration)[:, None]


def lead_of(calibration: xr.Dataset) -> float:
    """By how much (s) the gyroscopes are ahead of the accelerometers, 0 where nobody found it."""
    names = [str(name) for name in calibration["parameter"].to_numpy()]
    lags = [name.startswith("gyroscope_delay ") for name in names]
    return float(calibration["effect_parameter"].to_numpy()[lags].mean()) if any(lags) else 0.0


def _choose(recording: Recording, edges, per_bin: int) -> np.ndarray:
    """Samples off all true rails, spread evenly over time in each bin of their fastest axis."""
    fastest = np.abs(recording.angular_rate.mean(axis=1)).max(axis=1)
    lost = recording.saturated_gyroscopes()
    off = ~lost.any(axis=(1, 2)) & ~recording.saturated_accelerometers().any(axis=(1, 2))
    chosen = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        index = np.flatnonzero(off & (fastest >= low) & (fastest < high))
        chosen.append(index[:: max(1, len(index) // per_bin)][:per_bin])
    index = np.sort(np.concatenate(chosen))
    if not len(index):
        raise InputError(
            f"recording: expected samples beyond {np.degrees(edges[0]):g} deg/s, found none"
        )
    return index


def _table(errors, sds, withheld, rates, bins) -> pd.DataFrame:
    rows = []
    for name, error in errors.items():
        size = np.degrees(np.abs(error))
        for low, high in zip(bins[:-1], bins[1:], strict=True):
            here = withheld & (rates >= low) & (rates < high)
            if not here.any():
                continue
            row = {
                "model": name, "rate_dps": float(np.sqrt(low * high)), "readings": int(here.sum()),
                "above_100": np.mean(size[here] > 100.0),
                "rmse_dps": np.sqrt(np.mean(size[here] ** 2)), "median_dps": np.median(size[here]),
            }  # fmt: skip
            if name in sds:
                claimed = np.degrees(sds[name])
                row["sd_dps"] = np.median(claimed[here])
                row["rms_sd_dps"] = np.sqrt(np.mean(claimed[here] ** 2))
                row["within_95"] = np.mean(size[here] < 1.96 * claimed[here])
            rows.append(row)
    return pd.DataFrame(rows)
