"""Distance of a recording's triads from a rigid array: residuals over noise, and whose they are."""

import numpy as np
import xarray as xr

from imuarray.analysis.checked import FEW
from imuarray.analysis.drawing import Places
from imuarray.analysis.rigid import Turning, kept, turning
from imuarray.analysis.suspects import suspects, told
from imuarray.model.effects import KINDS
from imuarray.recording import Recording

UNSTEADY = 2.5  # times what noise explains between parts of a recording; 1.3 at most of sound ones
APART = 1.5  # times that of the other IMUs: what disturbs one disturbs all a little
RESIDUAL = 3.0  # times the declared noise: widths are too small, or scaled by what is no noise


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
    if not (whole > RESIDUAL or triads.get(worst, 0.0) > limit):
        return [], False
    named = told(suspects(moving))
    if named:
        cause = f"{', '.join(named)}?"
    elif triads.get(worst, 0.0) > limit:
        cause = f"most at {worst}, {triads[worst]:.3g} times"
    else:
        cause = "in all alike, or only where one is at its rail"
    return [f"the residual is {whole:.3g} times the declared noise: {cause}"], bool(named)


def residuals(recording: Recording, calibration: xr.Dataset, places: Places) -> dict[str, float]:
    """Residual over declared noise, of the whole (the key is empty) and of each triad."""
    found = {"": float(calibration.attrs["residual_ratio"])}
    if is_papers(calibration):
        return rigid(recording, places) | found
    if "gyroscope_smooth_residual" in calibration:
        # what is faster than the samples is no fault of the calibration, and its sds allow for it
        smooth = {
            f"{kind} {label}": float(value)
            for kind in KINDS
            for label, value in zip(
                calibration[kind].values, calibration[f"{kind}_smooth_residual"].values, strict=True
            )
        }
        return smooth | {"": float(np.sqrt(np.mean(np.square(list(smooth.values())))))}
    kinds = (("accelerometer", recording.accelerometer_noise_sd),
             ("gyroscope", recording.gyroscope_noise_sd))  # fmt: skip
    for kind, declared in kinds:
        for label, sds in zip(calibration[kind].values, calibration[f"{kind}_sd"], strict=True):
            found[f"{kind} {label}"] = float(np.sqrt(np.mean(sds**2))) / declared
    return found


def unsteady(calibration: xr.Dataset, corrected: bool, recordings: int = 1) -> list[str]:
    """IMUs on whose position parts of the recording disagree: it came loose, or its offset jumped.

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
    found = labels[1:][ratio > max(UNSTEADY, APART * usual)]
    if not len(found) and corrected and usual > UNSTEADY:
        found = labels[:1] if len(ratio) > 1 else labels
    if not len(found):
        return []
    named = " and ".join(found) if len(found) < 3 else f"{', '.join(found[:-1])} and {found[-1]}"
    by = f"disagree on the place of IMU {named}, by {ratio.max():.2g} times what noise explains: "
    if recordings > 1:
        return [
            f"the recordings {by}was it glued anew, or is one recording of another board? Calibrate"
            " each alone, and compare their positions"
        ]
    return [
        f"parts of the recording {by}did it come loose, or did its accelerometer's offset jump?"
        " imuarray diagnose tells which"
    ]


def rigid(recording: Recording, places: Places, spread: bool = False) -> dict[str, float]:
    """Residuals by triad for a rigid array without any errors, by plain least squares.

    ``spread``: of the accelerometers alone.
    """
    moving = kept(recording)
    count, gyroscopes = places.found.shape[0], moving.angular_rate.shape[1]
    if len(moving.time) < FEW:
        return {}
    rate = moving.angular_rate.mean(axis=1)
    motion: Turning = turning(moving.specific_force, rate, places.found)
    off = (moving.specific_force - motion.at(places.found)) / recording.accelerometer_noise_sd
    squares = dict(zip(_names("accelerometer", recording), _mean_squares(off), strict=True))
    free = {name: max(3 * count - 6, 1) / (3 * count) for name in squares}
    if gyroscopes > 1 and not spread:
        off = (moving.angular_rate - rate[:, None]) / recording.gyroscope_noise_sd
        own = dict(zip(_names("gyroscope", recording), _mean_squares(off), strict=True))
        squares |= own
        free |= dict.fromkeys(own, 1 - 1 / gyroscopes)
    whole = sum(squares.values()) / sum(free.values())
    return {"": float(np.sqrt(whole))} | {
        name: float(np.sqrt(value / free[name])) for name, value in squares.items()
    }


def _mean_squares(values) -> np.ndarray:
    return np.mean(values**2, axis=(0, 2))


def _names(kind: str, recording: Recording) -> list[str]:
    return [f"{kind} {label}" for label in getattr(recording, f"{kind}_labels")]
