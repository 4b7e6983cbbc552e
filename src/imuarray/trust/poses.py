"""Why a first-order calibration is not to be trusted: its residual, and the common scale."""

from typing import NamedTuple

import h5py
import numpy as np

from imuarray.firstorder.correct import FirstOrder
from imuarray.firstorder.gyroscopes import shared_chance
from imuarray.firstorder.settings import SETTINGS as FIRSTORDER
from imuarray.model.effects import KINDS
from imuarray.recording.record import FIRST_ORDER
from imuarray.trust.settings import SETTINGS


class Poses(NamedTuple):
    """Results of a first-order calibration: NaN where it has none."""

    ratio: float = 1.0  # residual of the poses over their noise
    residual: float = np.nan  # m/s^2, rms of the worst triad
    scale: float = np.nan  # of the map that all gyroscopes share
    chance: float = 1.0  # of such a mean of all axes' scales, by their own spread
    smoothed: tuple[str, ...] = ()  # kinds whose still readings follow their neighbours


def of_first_order(found: FirstOrder) -> Poses:
    """From the answer."""
    common = None if found.gyroscopes is None else found.gyroscopes.common
    scale = np.nan if common is None or isinstance(common, str) else common.scale
    fit, follow = found.triads, [getattr(found, f"{kind}_smoothing") for kind in KINDS]
    return _poses(
        fit.residual_ratio, fit.residual, fit.relied, scale, found.gyroscope_matrix, follow
    )


def of_file(path) -> Poses:
    """From a corrected recording's file, or one that was selected from it."""
    with h5py.File(path, "r") as file:
        if FIRST_ORDER not in file:
            return Poses()
        stored = file[FIRST_ORDER]
        ratio = float(np.ravel(stored.attrs.get("residual_ratio", 1.0))[0])
        common = stored["gyroscope_common"][:] if "gyroscope_common" in stored else [[np.nan]]
        maps = stored["gyroscope_matrix"][:] if "gyroscope_matrix" in stored else None
        residual, used = stored["residual"][:], stored["used"][:] != 0
        names = (f"{kind}_smoothing" for kind in KINDS)
        follow = [stored[name][:] if name in stored else np.zeros(1) for name in names]
    return _poses(ratio, residual, used, float(np.trace(common) / 3), maps, follow)


def _poses(ratio: float, residual, used, scale: float, maps, follow) -> Poses:
    """With residuals (P, A, 3) where they are ``used`` (P, A), gyroscopes' ``maps`` (G, 3, 3).

    ``follow``: of both kinds, the correlation of neighbours in the fastest noise.
    """
    pairs = zip(KINDS, follow, strict=True)
    smoothed = tuple(kind for kind, own in pairs if np.nanmedian(own) > SETTINGS.smoothed)
    squares = np.where(used[..., None], residual**2, np.nan)
    worst = np.sqrt(np.nanmax(np.nanmean(np.ascontiguousarray(squares), axis=(0, 2))))
    chance = shared_chance(maps) if scale == scale else 1.0
    return Poses(ratio, float(worst), scale, chance, smoothed)


def reasons_of_poses(*several: Poses) -> list[str]:
    """Why first-order calibrations are not to be trusted: their residual, and the common scale."""
    found = []
    ratio = max((x.ratio for x in several if not x.residual <= SETTINGS.pose_residual), default=1.0)
    if ratio > SETTINGS.pose_noise:
        found.append(
            f"the still poses fit {ratio:.2g} times worse than noise and a drift of offsets allow:"
            " the board bent or was not still, an offset jumped, a response is curved (imuarray"
            " diagnose tells), or recordings are of other boards; sds do not cover that: record"
            " again"
        )
    smoothed = sorted({kind for one in several for kind in one.smoothed})
    if smoothed:
        found.append(
            f"readings of {' and '.join(f'{kind}s' for kind in smoothed)} follow their neighbours"
            " while the board is still: they are averaged, filtered or interpolated from another"
            " rate, which makes fast motion smaller and later; log raw readings, each sensor at its"
            " own rate"
        )
    worst = max(several, key=lambda x: abs(x.scale - 1) if x.scale == x.scale else 0.0)
    scale, odd = worst.scale, worst.chance < FIRSTORDER.odd_scale
    if abs(scale - 1) > SETTINGS.common_scale or (
        odd and abs(scale - 1) > SETTINGS.common_scale_seen
    ):
        off = 100 * abs(1 / scale - 1)
        much, large = ("much", "small") if scale < 1 else ("little", "large")
        found.append(
            f"all gyroscopes together read {off:.2g} % too {much} by the moves between poses: is"
            " that their scale, or is it the time base: a clock that runs wrong, a declared rate of"
            f" the log that is not its own, rows that were lost? If so, the array comes out"
            f" {2 * off:.2g} % too {large}"
        )
    return found
