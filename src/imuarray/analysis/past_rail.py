"""How well an array measures an angular rate beyond its gyroscopes' rail (2017, figure 3).

On a measured recording nobody knows the rate past the gyroscopes' rail. So a lower rail is made
up: readings beyond it are withheld from the estimate and compared with it.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.analysis.motion import motion_under
from imuarray.engine.fusion import fuse
from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.recording import Recording, array_of

BINS = (250, 350, 500, 700, 1000, 1400, 2000)  # deg/s; the first is the rail that is made up
PER_BIN = 150  # samples
ASSUMED = 0.79  # m/s^2, the accelerometers' noise in paper 2021's experiment


def past_rail(
    recording: Recording, diagnosed: xr.Dataset, base, bins=BINS, per_bin: int = PER_BIN,
    elsewhere=None,
) -> pd.DataFrame:  # fmt: skip
    """Errors of withheld gyroscope readings, as several models predict them.

    Parameters
    ----------
    recording
        Whole and corrected; samples at a true rail are not used.
    diagnosed
        What `diagnosed` gives of the recording's diagnosis.
    base : (A, 3) m
        Positions by the papers' model, relative to the first triad.
    bins
        Edges in deg/s of the withheld axis' rate; the first is the rail.
    elsewhere : ((A, 3) m, s) or None
        Positions as ``base`` and the gyroscopes' lead (`lead_of`) from another recording of the
        board, which has seen nothing of this one.

    Returns
    -------
    DataFrame
        A row per model (``clipped``, ``nominal``, ``calibrated``, ``delayed``: the same with the
        gyroscopes' lead, ``transferred``: with both from ``elsewhere``, ``extended``) and bin of
        the withheld axis' rate: mid ``rate_dps``, ``readings`` (of all gyroscopes, which share an
        error), ``rmse_dps``, ``median_dps`` of the absolute error, ``above_100`` the share beyond
        100 deg/s, and for ``extended`` what noise alone claims: ``sd_dps`` (median),
        ``rms_sd_dps`` and ``within_95``.

    InputError where no sample is beyond the rail.
    """
    chosen = _choose(recording, np.radians(bins), per_bin)
    lowest = np.radians(bins[0])
    withheld = (np.abs(chosen.angular_rate) >= lowest).any(axis=1, keepdims=True)
    withheld = np.broadcast_to(withheld, chosen.angular_rate.shape)
    clipped = replace(chosen, angular_rate=np.clip(chosen.angular_rate, -lowest, lowest))
    errors, sds = {"clipped": clipped.angular_rate - chosen.angular_rate}, {}
    ways = {
        "nominal": (recording.relative_positions(), 0.0),
        "calibrated": (base, 0.0),
        "delayed": (base, lead_of(diagnosed)),
    }
    if elsewhere is not None:
        ways["transferred"] = elsewhere
    for name, (positions, lead) in ways.items():
        errors[name] = _predicted(clipped, withheld, positions, lead) - chosen.angular_rate
    model, found = motion_under(diagnosed, clipped, withheld)
    predicted = _readings(model, diagnosed, found, chosen.time)
    errors["extended"] = predicted - chosen.angular_rate
    variance = np.einsum("tii->ti", found.covariance)[:, None, :3]
    noise = np.diag(model.noise.gyroscope).reshape(1, -1, 3)
    sds["extended"] = np.sqrt(variance + noise)
    rates = np.abs(chosen.angular_rate.mean(axis=1, keepdims=True))
    rates = np.broadcast_to(rates, withheld.shape)
    return _table(errors, sds, withheld, np.degrees(rates), bins)


def _predicted(clipped: Recording, withheld, positions, lead: float) -> np.ndarray:
    """Gyroscopes' readings (T, 1, 3) rad/s by the papers' model, ``lead`` s after the motion."""
    model = ArrayModel.isotropic(array_of(clipped), ASSUMED, clipped.gyroscope_noise_sd)
    motion = fuse(
        model, clipped.specific_force, clipped.angular_rate,
        (positions - positions[0])[1:].ravel(), None, withheld,
    ).estimate.motion  # fmt: skip
    return (motion.angular_rate + lead * motion.angular_acceleration)[:, None]


def lead_of(diagnosed: xr.Dataset) -> float:
    """By how much (s) the gyroscopes are ahead of the accelerometers, 0 where nobody found it."""
    names = [str(name) for name in diagnosed["parameter"].to_numpy()]
    lags = [name.startswith("gyroscope_delay ") for name in names]
    return float(diagnosed["effect_parameter"].to_numpy()[lags].mean()) if any(lags) else 0.0


def _choose(recording: Recording, edges, per_bin: int) -> Recording:
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
    return recording.select(index)


def _readings(model: ArrayModel, diagnosed: xr.Dataset, found, time) -> np.ndarray:
    """What the gyroscopes read at the motion found, (T, G, 3) rad/s."""
    since = time - diagnosed.attrs["time_origin"]
    predicted = model.predict_many(
        found.estimate.motion, diagnosed["position"].to_numpy(),
        diagnosed["effect_parameter"].to_numpy(), since, span=diagnosed.attrs["span"],
    )  # fmt: skip
    return np.asarray(predicted.angular_rate)


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
