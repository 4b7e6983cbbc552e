"""The whole first-order calibration of a recording, and the recording it corrects."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.linalg import block_diag

from imuarray.errors import InputError, require, require_one_of
from imuarray.firstorder.gyroscopes import Gyroscopes, calibrate_gyroscopes
from imuarray.firstorder.outliers import fit_triads
from imuarray.firstorder.pose_noise import walked_mean
from imuarray.firstorder.rails import rails_shown
from imuarray.firstorder.settings import SETTINGS
from imuarray.firstorder.still import (
    Still,
    averaged_sd,
    lag_correlation,
    reading_sd,
    smoothing,
    steps_sd,
)
from imuarray.firstorder.triads import TriadFit
from imuarray.firstorder.turns import nearest_orthogonal, shared_turn
from imuarray.recording import Recording
from imuarray.recording.channels import repeated, require_apart
from imuarray.recording.record import CORRECTION, KINDS, NUMBERS
from imuarray.recording.settings import SETTINGS as RECORDING
from imuarray.recording.units import GRAVITY
from imuarray.threads import one_thread

GYROSCOPES = ("calibrate", "offset")


class AtRest(NamedTuple):
    """Offsets and noise of K triads of a kind, by still poses, in SI units.

    Attributes
    ----------
    offset, offset_sd : (K, 3)
        Where the board moves; the gyroscopes' sd is from the spread among poses, which holds drift
        and whatever depends on gravity.
    walk : (K,) per root of a second, sd of an offset's walk; 0 where none shows
    noise : (K, 3), of one reading within a second
    correlation : (K, 3), of neighbouring readings
    smoothing : (K, 3), the same of their fastest noise
    """

    offset: np.ndarray
    offset_sd: np.ndarray
    walk: np.ndarray
    noise: np.ndarray
    correlation: np.ndarray
    smoothing: np.ndarray


@dataclass(frozen=True)
class FirstOrder:
    """Per triad calibration from the still poses of one recording, or of several of one board.

    Attributes
    ----------
    poses : list of slice
    triads : TriadFit, accelerometers, with this recording's poses
    at_rest : dict of `AtRest`, of each kind of sensor
    gravity : float, m/s^2, the assumed magnitude
    gyroscopes : Gyroscopes, their maps; None where only their offsets were asked for
    left_out : numbers, from 1, of the other recordings left out: poses in two orientations at most
    """

    poses: list[slice]
    triads: TriadFit
    at_rest: dict[str, AtRest]
    gravity: float
    gyroscopes: Gyroscopes | None = None
    left_out: tuple[int, ...] = ()

    @property
    def still_samples(self) -> int:
        """In all of the poses."""
        return sum(pose.stop - pose.start for pose in self.poses)

    @property
    def maps(self) -> dict[str, np.ndarray]:
        """(K, 3, 3) of each kind: reading = map @ (specific force or angular rate) + offset.

        The gyroscopes' are identities where no more than their offsets were asked for.
        """
        if self.gyroscopes is not None:
            turning = self.gyroscopes.matrix
        else:
            turning = np.broadcast_to(np.eye(3), (len(self.at_rest["gyroscope"].offset), 3, 3))
        return {"accelerometer": self.triads.matrix, "gyroscope": turning}

    @property
    def drawing_turn(self) -> np.ndarray:
        """From the first IMU's axes to those that most of the others share, (3, 3).

        The identity but where it is the first that is turned, by more than a mount is off.
        """
        return shared_turn(nearest_orthogonal(self.triads.matrix))

    def left(self) -> np.ndarray:
        """Covariance (9 A + 9 G, 9 A + 9 G) of the maps left in the corrected readings.

        (9 A, 9 A) for gyroscopes without a common map: nothing is known of their scale.
        """
        matrices, own = self.triads.matrix, self.gyroscopes
        spread = self.triads.fitted.spread(slice(matrices.size))[: matrices.size]
        if not np.isnan(self.common_scale_sd):
            spread = np.block([[spread, own.beside.T], [own.beside, own.covariance]])
            matrices = np.concatenate([matrices, own.matrix])
        # errors of the matrices, as those of what is left when they are taken out
        back = block_diag(*(np.kron(one, np.eye(3)) for one in np.linalg.inv(matrices)))
        return back @ spread @ back.T

    @property
    def common_scale_sd(self) -> float:
        """Sd of the scale that all gyroscopes share; NaN where it was not determined."""
        return np.nan if self.gyroscopes is None else self.gyroscopes.common_scale_sd


def calibrate_first_order(
    recording: Recording, gravity: float = GRAVITY, gyroscopes: str = GYROSCOPES[0],
    shortest_pose: float = SETTINGS.shortest, others: Sequence[Recording] = (),
) -> FirstOrder:  # fmt: skip
    """First-order model of every triad from still poses and the moves between them.

    Parameters
    ----------
    gravity : m/s^2
    gyroscopes : "calibrate" for their maps, "offset" for no more than their offsets (paper 2021)
    shortest_pose : s, that a still pose lasts at least
    others : further recordings of the same board at the same place, whose poses (in three
        orientations at least) and moves, too, say what the maps are; offsets are their own

    InputError or IdentifiabilityError where there are no poses, too few or too similar ones, and
    where axes are mirrored, rates have another unit, or channels or samples are copied.
    """
    every = _all_still([recording, *others], gyroscopes, shortest_pose)
    left_out = tuple(k for k, one in enumerate(every[1:], 1) if not one.tells)
    every = [one for k, one in enumerate(every) if k not in left_out]
    return replace(_calibrated(every, gravity, gyroscopes)[0], left_out=left_out)


def calibrate_together(
    recordings: Sequence[Recording], gravity: float = GRAVITY, gyroscopes: str = GYROSCOPES[0],
    shortest_pose: float = SETTINGS.shortest,
) -> list[FirstOrder]:  # fmt: skip
    """`calibrate_first_order` of each of several recordings beside all others, at once."""
    return _calibrated(_all_still(recordings, gyroscopes, shortest_pose), gravity, gyroscopes)


def _all_still(recordings: Sequence[Recording], gyroscopes: str, shortest: float) -> list[Still]:
    require_one_of("gyroscopes", gyroscopes, GYROSCOPES)
    boards = {(*one.accelerometer_labels, *one.gyroscope_labels) for one in recordings}
    require(len(boards) <= 1, "recordings", "one board", "sensors of other labels")
    require_apart(recordings)
    return [Still.of(one, shortest) for one in recordings]


@one_thread()  # of matrices this small, more of them only spin
def _calibrated(every: Sequence[Still], gravity: float, gyroscopes: str) -> list[FirstOrder]:
    """First order of each recording, by the poses of all."""
    if len(every) > 1 and not all(one.tells for one in every):
        raise InputError(
            "recording: expected still poses in three orientations or more beside those of others,"
            f" as its offsets are its own, found {min(len(one.poses) for one in every)} poses in"
            " fewer"
        )
    triads, maps = _triads(every, gravity), None
    if gyroscopes == "calibrate":
        try:
            maps, triads = calibrate_gyroscopes(every, triads)
        except InputError:  # a failed sensor looks like one of another scale
            failed = [words for one in every for words in repeated(one.recording)]
            if failed:
                raise InputError(failed[0]) from None
            raise
    found, first = [], 0
    for number, one in enumerate(every):
        poses = range(first, first := first + len(one.poses))
        own = None if maps is None else maps.between(poses)
        found.append(_of_recording(one, triads.of(number), gravity, own))
    return found


def _triads(every: Sequence[Still], gravity: float) -> TriadFit:
    """Fit of the poses of all recordings, one recording after the other."""
    mean = np.concatenate([one.means("accelerometer") for one in every])
    sd = [
        np.maximum(
            one.noise("accelerometer", averaged_sd) / np.sqrt(one.counts)[:, None, None],
            steps_sd(one.pieces("accelerometer")),
        )
        for one in every
    ]
    recording = np.repeat(np.arange(len(every)), [len(one.poses) for one in every])
    labels = every[0].recording.accelerometer_labels
    time = np.concatenate([one.after_moving for one in every])
    return fit_triads(mean, np.concatenate(sd), gravity, labels, recording, time)


def _of_recording(still: Still, triads: TriadFit, gravity: float, gyroscopes) -> FirstOrder:
    """With one recording's own offsets and noise, by its still poses."""
    noise = np.maximum(still.noise("gyroscope", averaged_sd), 1e-9)
    sd = noise / np.sqrt(still.counts)[:, None, None]
    offsets = {
        "accelerometer": (triads.offset, triads.parts_sd()["offset"], triads.walk),
        "gyroscope": walked_mean(still.means("gyroscope"), sd, still.after_moving),
    }
    at_rest = {}
    for kind, offset in offsets.items():
        noise, pieces = still.noise(kind, reading_sd), still.pieces(kind)
        at_rest[kind] = AtRest(*offset, noise, lag_correlation(pieces), smoothing(pieces))
    return FirstOrder(still.poses, triads, at_rest, gravity, gyroscopes)


def correct(recording: Recording, found: FirstOrder) -> Recording:
    """The recording with offsets and maps, of gyroscopes as far as they are known, taken out.

    Which readings were at a rail is kept as masks, as the corrected values no longer show it;
    the declared noise becomes the pooled noise found, the still poses become ``stationary``. All
    is in the axes of the first accelerometer, the drawing too. Where the time base is in doubt
    (`Gyroscopes.time_base_sd`), ``clock_sd`` allows for it.
    """
    readings: dict[str, Any] = {}
    for kind, maps in found.maps.items():
        own, back = found.at_rest[kind], np.linalg.inv(maps)
        noise = np.einsum("kij,kj->ki", back**2, own.noise**2)
        readings |= taken_out(recording, kind, maps, back, own.offset)
        readings[f"{kind}_noise_sd"] = float(np.sqrt(noise.mean()))
    # from the accelerometers' own axes to those of the corrected readings
    axes = np.swapaxes(nearest_orthogonal(found.triads.matrix), 1, 2)
    if recording.accelerometer_axes is not None:
        axes = axes @ recording.accelerometer_axes
    clock_sd, known = recording.clock_sd, found.gyroscopes
    declared = clock_sd >= RECORDING.clock_sd  # a smaller one is the user's own word
    if known is not None and (doubt := known.time_base_sd(declared)):
        clock_sd = np.hypot(np.nan_to_num(clock_sd), doubt)
    return replace(
        recording, **readings, map_covariance=found.left(), clock_sd=float(clock_sd),
        accelerometer_position=recording.accelerometer_position @ found.drawing_turn,
        accelerometer_axes=axes, stationary=~Still(recording, found.poses).moving,
        correction=_correction(recording, found),
    )  # fmt: skip


def taken_out(recording: Recording, kind: str, maps, inverse, offset) -> dict:
    """Fields of the recording without maps (K, 3, 3) and offsets (K, 3) of a kind: readings, rails.

    The range is the rail at its nearest.
    """
    name, limit = KINDS[kind], getattr(recording, f"{kind}_range")
    rails = getattr(recording, f"saturated_{kind}s")()
    return {
        name: corrected(inverse, offset, getattr(recording, name)),
        f"{name}_saturated": rails_shown(inverse, rails),
        f"{kind}_range": float((limit - np.abs(offset).max()) / np.abs(maps).max()),
    }


def corrected(inverse, offset, readings) -> np.ndarray:
    """inverse (K, 3, 3) @ (readings (T, K, 3) - offset (K, 3)), summed from x to z.

    Written out, so that whoever does the same gets the same bits.
    """
    x = readings - offset
    return (
        inverse[:, :, 0] * x[:, :, :1] + inverse[:, :, 1] * x[:, :, 1:2]
        + inverse[:, :, 2] * x[:, :, 2:]
    )  # fmt: skip


def _correction(recording: Recording, found: FirstOrder) -> xr.Dataset:
    """Contents of `Recording.correction`; after a former correction, both as one."""
    variables, before = {}, recording.correction
    for kind, (offset, sd, walk, *_) in found.at_rest.items():
        inverse = np.linalg.inv(found.maps[kind])
        if before is not None:
            first = before[f"{kind}_inverse"].to_numpy()
            offset = np.linalg.solve(first, offset[..., None])[..., 0]
            offset, inverse = before[f"{kind}_offset"].to_numpy() + offset, inverse @ first
        unit = NUMBERS[f"{kind}_noise_sd"]
        for name, values, own in (
            ("inverse", inverse, "1"), ("offset", offset, unit), ("offset_sd", sd, unit),
            ("offset_walk", walk, f"{unit} s-0.5"),
        ):  # fmt: skip
            variables[f"{kind}_{name}"] = CORRECTION[f"{kind}_{name}"], values, {"units": own}
    return xr.Dataset(variables)
