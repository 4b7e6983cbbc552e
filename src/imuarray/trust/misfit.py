"""Residuals over noise: of triads from a rigid array, and whose they are; of the still poses."""

from typing import NamedTuple

import h5py
import numpy as np
import xarray as xr

from imuarray.firstorder.correct import FirstOrder
from imuarray.firstorder.gyroscopes import shared_chance
from imuarray.firstorder.settings import SETTINGS as FIRSTORDER
from imuarray.model.effects import EFFECTS, KINDS
from imuarray.recording import Recording
from imuarray.recording.record import FIRST_ORDER
from imuarray.trust.checked import effect_names
from imuarray.trust.drawing import Places
from imuarray.trust.rigid import kept, turning
from imuarray.trust.settings import SETTINGS
from imuarray.trust.suspects import suspects
from imuarray.words import joined

LOOSE = "did it come loose, or did its accelerometer's offset jump? imuarray diagnose tells which"


def is_papers(calibration: xr.Dataset) -> bool:
    """True of the papers' model, in which nothing but noise is between the triads."""
    return calibration.attrs.get("model") == "papers"


def unfitting(
    residual: dict[str, float], moving: Recording, limit: float
) -> tuple[list[str], bool]:
    """The residual where it is too large, and whose it is; and whether that is known.

    ``limit``: of a single triad's.
    """
    whole = residual.get("", 0.0)
    triads = {name: ratio for name, ratio in residual.items() if name}
    worst = max(triads, key=triads.__getitem__, default="")
    if not (whole > SETTINGS.residual or triads.get(worst, 0.0) > limit):
        return [], False
    named = suspects(moving)
    if named:
        cause = f"{', '.join(named)}?"
    elif triads.get(worst, 0.0) > limit:
        cause = f"most at {worst}, {triads[worst]:.3g} times"
    else:
        cause = "in all alike, or only where one is at its rail; imuarray diagnose names causes"
    return [f"the residual is {whole:.3g} times the declared noise: {cause}"], bool(named)


def residuals(recording: Recording, calibration: xr.Dataset, places: Places) -> dict[str, float]:
    """Residual over declared noise, of the whole (the key is empty) and of each triad."""
    whole = {"": float(calibration.attrs["residual_ratio"])}
    if is_papers(calibration):
        return rigid(recording, places) | whole
    if "gyroscope_smooth_residual" in calibration:
        # what is faster than the samples is no fault of the calibration, and its sds allow for it
        own = {kind: calibration[f"{kind}_smooth_residual"].to_numpy() for kind in KINDS}
        smooth = _by_triad(recording, own)
        return smooth | {"": float(np.sqrt(np.mean(np.square(list(smooth.values())))))}
    sds = {k: np.sqrt(np.mean(calibration[f"{k}_sd"].to_numpy() ** 2, axis=1)) for k in KINDS}
    ratios = {k: sds[k] / getattr(recording, f"{k}_noise_sd") for k in KINDS}
    return whole | _by_triad(recording, ratios)


def unsteady(calibration: xr.Dataset, corrected: bool, recordings: int = 1) -> list[str]:
    """IMUs on whose position parts of the recording disagree: loose, or with jumped offsets.

    Where all do, it is the reference; if they are not ``corrected``, their scales do it as well.
    """
    if "position_sd_jackknife" not in calibration:
        return []
    squares = (
        np.sum(calibration[f"position_sd_{name}"].to_numpy()[1:] ** 2, axis=1)
        for name in ("jackknife", "formal")
    )
    ratio = np.sqrt(np.divide(*squares))
    usual = np.sort(ratio)[(len(ratio) - 1) // 2]
    labels = calibration["accelerometer"].to_numpy()
    found = labels[1:][ratio > max(SETTINGS.unsteady, SETTINGS.unsteady_alone * usual)]
    if not len(found) and corrected and usual > SETTINGS.unsteady:
        found = labels[:1] if len(ratio) > 1 else labels
    if not len(found):
        return []
    times = f"{ratio.max():.2g} times what noise explains"
    by = f"disagree on the place of IMU {joined(found)}, by {times}: "
    if recordings > 1:
        return [
            f"the recordings {by}was it glued anew, or is one recording of another board? Calibrate"
            " each alone, and compare their positions"
        ]
    return [f"parts of the recording {by}{LOOSE}"]


def changed(calibration: xr.Dataset) -> list[str]:
    """Triads, of three or more, that do not fit the others in a part of smooth motion.

    In many stretches between two instants and in none outside them: single bad readings are
    elsewhere. Where no filter is estimated: of a slow one's, powers of frequency leave fast motion.
    """
    found: list[str] = []
    effects = [EFFECTS[name] for name in effect_names(calibration) if name in EFFECTS]
    slow = any(effect.smooth and effect.sampling for effect in effects)
    for kind in () if slow else KINDS:
        if f"{kind}_residual" not in calibration or f"{kind}_smooth_residual" in calibration:
            continue
        rms = calibration[f"{kind}_residual"].to_numpy()
        far = rms > SETTINGS.residual * np.maximum(np.median(rms, axis=1, keepdims=True), 1.0)
        for k, share in enumerate(far.mean(axis=0)):
            places = np.flatnonzero(far[:, k])
            part = SETTINGS.changed < share < 1 - SETTINGS.changed
            if not part or len(places) < SETTINGS.changed_within * (np.ptp(places) + 1):
                continue
            when, label = calibration["stretch"].to_numpy()[places], calibration[kind].values[k]
            found.append(
                f"{kind} {label} does not fit the others in {100 * share:.0f} % of the motion,"
                f" between {when[0]:.3g} and {when[-1]:.3g} s, and does in the rest: did its scale"
                " change, did it come loose, or does it err where the motion is fast?"
            )
    return found


def rigid(recording: Recording, places: Places, spread: bool = False) -> dict[str, float]:
    """Residuals by triad for a rigid array without any errors, by plain least squares.

    ``spread``: of the accelerometers alone.
    """
    moving = kept(recording)
    if len(moving.time) < SETTINGS.few_samples:
        return {}
    force, rates = moving.specific_force, moving.angular_rate
    rate, counts = rates.mean(axis=1), (force.shape[1], rates.shape[1])
    off = {KINDS[0]: force - turning(force, rate, places.found).at(places.found)}
    free = {KINDS[0]: max(3 * counts[0] - 6, 1) / (3 * counts[0])}
    if counts[1] > 1 and not spread:
        off[KINDS[1]], free[KINDS[1]] = rates - rate[:, None], 1 - 1 / counts[1]
    squares = {
        kind: np.mean((values / getattr(recording, f"{kind}_noise_sd")) ** 2, axis=(0, 2))
        for kind, values in off.items()
    }
    whole = sum(map(np.sum, squares.values())) / sum(free[k] * len(squares[k]) for k in free)
    ratios = {kind: np.sqrt(values / free[kind]) for kind, values in squares.items()}
    return {"": float(np.sqrt(whole))} | _by_triad(recording, ratios)


def _by_triad(recording: Recording, ratios: dict[str, np.ndarray]) -> dict[str, float]:
    """Ratios (K,) of each kind by the sensors' names."""
    return {
        f"{kind} {label}": float(value)
        for kind, values in ratios.items()
        for label, value in zip(getattr(recording, f"{kind}_labels"), values, strict=True)
    }


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
    own = {f"{kind}_smoothing": rest.smoothing for kind, rest in found.at_rest.items()}
    own |= {"residual": found.triads.residual, "used": found.triads.relied}
    if not (common is None or isinstance(common, str)):
        own |= {"gyroscope_common": common.map, "gyroscope_matrix": found.maps["gyroscope"]}
    return _poses(own, found.triads.residual_ratio)


def of_file(path) -> Poses:
    """From a corrected recording's file, or one that was selected from it."""
    with h5py.File(path, "r") as file:
        if FIRST_ORDER not in file:
            return Poses()
        stored = file[FIRST_ORDER]
        return _poses(stored, float(np.ravel(stored.attrs.get("residual_ratio", 1.0))[0]))


def _poses(stored, ratio: float) -> Poses:
    """From arrays by their names in a file: ``residual`` (P, A, 3) where ``used`` (P, A), maps.

    And of both kinds the correlation of neighbours in the fastest noise, ``_smoothing``.
    """
    names = {kind: f"{kind}_smoothing" for kind in KINDS}
    follow = {kind: np.nanmedian(stored[name][:]) for kind, name in names.items() if name in stored}
    smoothed = tuple(kind for kind, own in follow.items() if own > SETTINGS.smoothed)
    squares = np.where(stored["used"][:][..., None] != 0, stored["residual"][:] ** 2, np.nan)
    worst = np.sqrt(np.nanmax(np.nanmean(np.ascontiguousarray(squares), axis=(0, 2))))
    if "gyroscope_common" not in stored:
        return Poses(ratio, float(worst), smoothed=smoothed)
    scale, maps = np.trace(stored["gyroscope_common"][:]) / 3, stored["gyroscope_matrix"][:]
    return Poses(ratio, float(worst), float(scale), shared_chance(maps), smoothed)


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
