"""Why what first order found is not to be trusted: from its answer, or from the file it wrote."""

from typing import NamedTuple

import h5py
import numpy as np

from imuarray.firstorder.correct import FirstOrder
from imuarray.recording.record import FIRST_ORDER

POSES = 3.0  # times the noise of a pose's mean; real boards have up to 1.9
BENT = 0.01  # m/s^2, a residual that matters: 0.1 % of gravity
SCALED = 0.03  # of all gyroscopes' common scale: three of its prior's sds


class Poses(NamedTuple):
    """What a first-order calibration came to: NaN where it does not say."""

    ratio: float = 1.0  # residual of the poses over their noise
    residual: float = np.nan  # m/s^2, rms of the worst triad
    scale: float = np.nan  # of the map that all gyroscopes share


def of_first_order(found: FirstOrder) -> Poses:
    """From the answer."""
    common = None if found.gyroscopes is None else found.gyroscopes.common
    scale = np.nan if common is None or isinstance(common, str) else common.scale
    fit = found.triads
    return Poses(fit.residual_ratio, _worst(fit.residual, fit.relied), scale)


def of_file(path) -> Poses:
    """From a corrected recording's file, or one that was selected from it."""
    with h5py.File(path, "r") as file:
        if FIRST_ORDER not in file:
            return Poses()
        stored = file[FIRST_ORDER]
        ratio = float(np.ravel(stored.attrs.get("residual_ratio", 1.0))[0])
        residual = _worst(stored["residual"][:], stored["used"][:] != 0)
        common = stored["gyroscope_common"][:] if "gyroscope_common" in stored else [[np.nan]]
        scale = np.trace(common) / 3
    return Poses(ratio, residual, float(scale))


def _worst(residual, used) -> float:
    """Rms of the worst triad, of residuals (P, A, 3) where they are ``used`` (P, A)."""
    squares = np.where(used[..., None], residual**2, np.nan)
    return float(np.sqrt(np.nanmax(np.nanmean(np.ascontiguousarray(squares), axis=(0, 2)))))


def reasons_of_poses(*several: Poses) -> list[str]:
    """Why first-order calibrations are not to be trusted: their residual, and the common scale."""
    found = []
    ratio = max((x.ratio for x in several if not x.residual <= BENT), default=1.0)
    if ratio > POSES:
        found.append(
            f"the still poses fit {ratio:.2g} times worse than noise and a drift of offsets allow:"
            " the board bent or was not still, an offset jumped, a response is curved (imuarray"
            " diagnose tells), or recordings are of other boards; sds do not cover that: record"
            " again"
        )
    scale = max((x.scale for x in several), key=lambda x: abs(x - 1) if x == x else 0.0)
    if abs(scale - 1) > SCALED:
        off = 100 * abs(1 / scale - 1)
        much, large = ("much", "small") if scale < 1 else ("little", "large")
        found.append(
            f"all gyroscopes together read {off:.2g} % too {much} by the moves between poses: is"
            f" that their scale, or are the steps of time (a rate that is declared, not measured)?"
            f" If it is time, the array comes out {2 * off:.2g} % too {large}"
        )
    return found
