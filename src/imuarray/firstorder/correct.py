"""The whole first-order calibration of a recording, and the recording it corrects."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy.linalg import block_diag

from imuarray.errors import InputError, require, require_one_of
from imuarray.firstorder.gyroscopes import Gyroscopes, Still, calibrate_gyroscopes
from imuarray.firstorder.outliers import fit_triads
from imuarray.firstorder.pose_noise import walked_mean
from imuarray.firstorder.rails import nearest_rail, rails_shown
from imuarray.firstorder.settings import SETTINGS
from imuarray.firstorder.still import (
    averaged_sd,
    lag_correlation,
    outside_dead_band,
    reading_sd,
    smoothing,
    steps_sd,
    still_poses,
    usual_step,
)
from imuarray.firstorder.triads import TriadFit
from imuarray.firstorder.turns import nearest_orthogonal, shared_turn
from imuarray.model.effects import KINDS
from imuarray.recording import Recording
from imuarray.recording.channels import repeated, require_apart, require_live, require_once
from imuarray.recording.record import CORRECTION, NUMBERS
from imuarray.recording.settings import SETTINGS as RECORDING
from imuarray.recording.units import GRAVITY
from imuarray.threads import one_thread

GYROSCOPES = ("calibrate", "offset")


@dataclass(frozen=True)
class FirstOrder:
    """Per triad calibration from the still poses of one recording, or of several of one board.

    Attributes
    ----------
    poses : list of slice
    triads : TriadFit, accelerometers, with this recording's poses
    gyroscope_offset, gyroscope_offset_sd : (G, 3) rad/s
        Where the board moves, and its sd from the spread among poses, which holds drift and
        whatever depends on gravity.
    gyroscope_walk : (G,) rad/s per root of a second, sd of an offset's walk; 0 where none shows
    accelerometer_noise, gyroscope_noise : (A, 3) m/s^2, (G, 3) rad/s
        Noise of one reading within a second.
    accelerometer_correlation, gyroscope_correlation : (A, 3), (G, 3)
        Correlation of neighbouring readings.
    accelerometer_smoothing, gyroscope_smoothing : (A, 3), (G, 3), the same of their fastest noise
    gravity : float, m/s^2, the assumed magnitude
    gyroscopes : Gyroscopes, their maps; None where only their offsets were asked for
    spare : numbers, from 1, of the other recordings left out: poses in two orientations at most
    """

    poses: list[slice]
    triads: TriadFit
    gyroscope_offset: np.ndarray
    gyroscope_offset_sd: np.ndarray
    gyroscope_walk: np.ndarray
    accelerometer_noise: np.ndarray
    gyroscope_noise: np.ndarray
    accelerometer_correlation: np.ndarray
    gyroscope_correlation: np.ndarray
    accelerometer_smoothing: np.ndarray
    gyroscope_smoothing: np.ndarray
    gravity: float
    gyroscopes: Gyroscopes | None = None
    left_out: tuple[int, ...] = ()

    @property
    def still_samples(self) -> int:
        """In all of the poses."""
        return sum(pose.stop - pose.start for pose in self.poses)

    @property
    def gyroscope_matrix(self) -> np.ndarray:
        """Reading = matrix @ angular rate + offset, (G, 3, 3); identities where only offsets."""
        if self.gyroscopes is not None:
            return self.gyroscopes.matrix
        return np.broadcast_to(np.eye(3), (len(self.gyroscope_offset), 3, 3))

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
        count, own = len(self.triads.matrix), self.gyroscopes
        split = self.triads.covariance.reshape(count, 12, count, 12)[:, :9, :, :9]
        spread, matrices = split.reshape(9 * count, 9 * count), self.triads.matrix
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
    left_out = tuple(k for k, one in enumerate(every[1:], 1) if not _tells(one))
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
    return [_still(one, shortest) for one in recordings]


@one_thread()  # of matrices this small, more of them only spin
def _calibrated(every: Sequence[Still], gravity: float, gyroscopes: str) -> list[FirstOrder]:
    """First order of each recording, by the poses of all."""
    if len(every) > 1 and not all(map(_tells, every)):
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
        own = _of_poses(one, triads.of(number), gravity)
        found.append(replace(own, gyroscopes=None if maps is None else maps.between(poses)))
    return found


def _still(recording: Recording, shortest: float) -> Still:
    require_live(recording)
    require_once(recording)
    poses = still_poses(recording, shortest=shortest)
    rate = [recording.angular_rate[pose] for pose in poses]
    offsets = np.array([piece.mean(axis=0) for piece in rate])
    noise = averaged_sd(rate, usual_step(recording.time))
    noise = outside_dead_band(noise, rate, recording.gyroscope_noise_sd)
    return Still(recording, poses, offsets, noise)


def _tells(still: Still) -> bool:
    """True where poses say more than offsets of their own: in two orientations they do not."""
    means = np.array([force[:, 0].mean(axis=0) for force in still.force])
    apart = means - means.mean(axis=0)
    return (
        len(means) > 2
        and np.linalg.svd(apart, compute_uv=False)[1] > SETTINGS.orientations * GRAVITY
    )


def _triads(every: Sequence[Still], gravity: float) -> TriadFit:
    """Fit of the poses of all recordings, one recording after the other."""
    mean, sd = [], []
    for one in every:
        force, step = one.force, usual_step(one.recording.time)
        # a quantised reading that never changes has no spread of its own
        noise = np.maximum(averaged_sd(force, step), 1e-6 * GRAVITY)
        for piece, least in zip(force, steps_sd(force), strict=True):
            mean.append(piece.mean(axis=0))
            sd.append(np.maximum(noise / np.sqrt(len(piece)), least))
    recording = np.repeat(np.arange(len(every)), [len(one.poses) for one in every])
    labels = every[0].recording.accelerometer_labels
    time = np.concatenate([_after_moving(one) for one in every])
    return fit_triads(np.array(mean), np.array(sd), gravity, labels, recording, time)


def _after_moving(still: Still) -> np.ndarray:
    """(P,) s of the poses' middles after that of the moving samples, where offsets are wanted."""
    time, moving = still.recording.time, still.moving
    middle = np.median(time[moving]) if moving.any() else time[-1]
    return np.array([time[pose].mean() for pose in still.poses]) - middle


def _of_poses(still: Still, triads: TriadFit, gravity: float) -> FirstOrder:
    """First order by the still poses alone, which say nothing of the gyroscopes' maps."""
    force, step = still.force, usual_step(still.recording.time)
    rate = [still.recording.angular_rate[pose] for pose in still.poses]
    counts = np.array([len(piece) for piece in rate], float)
    sd = np.maximum(still.noise, 1e-9) / np.sqrt(counts)[:, None, None]
    return FirstOrder(
        still.poses, triads, *walked_mean(still.offsets, sd, _after_moving(still)),
        np.maximum(reading_sd(force, step), 1e-6 * GRAVITY),
        outside_dead_band(reading_sd(rate, step), rate, still.recording.gyroscope_noise_sd),
        lag_correlation(force), lag_correlation(rate), smoothing(force), smoothing(rate), gravity,
    )  # fmt: skip


def correct(recording: Recording, found: FirstOrder) -> Recording:
    """The recording with offsets and maps, of gyroscopes as far as they are known, taken out.

    Which readings were at a rail is kept as masks, as the corrected values no longer show it;
    the declared noise becomes the pooled noise found, the still poses become ``stationary``. All
    is in the axes of the first accelerometer, the drawing too. Where the time base is in doubt
    (`Gyroscopes.time_base_sd`), ``clock_sd`` allows for it.
    """
    matrix, offset, maps = found.triads.matrix, found.triads.offset, found.gyroscope_matrix
    back, turn_back = np.linalg.inv(matrix), np.linalg.inv(maps)
    still = np.zeros(len(recording.time), bool)
    for pose in found.poses:
        still[pose] = True
    # from the accelerometers' own axes to those of the corrected readings
    axes = np.swapaxes(nearest_orthogonal(matrix), 1, 2)
    if recording.accelerometer_axes is not None:
        axes = axes @ recording.accelerometer_axes
    clock_sd, known = recording.clock_sd, found.gyroscopes
    declared = clock_sd >= RECORDING.clock_sd  # a smaller one is the user's own word
    if known is not None and (doubt := known.time_base_sd(declared)):
        clock_sd = np.hypot(np.nan_to_num(clock_sd), doubt)
    return replace(
        recording, specific_force=corrected(back, offset, recording.specific_force),
        angular_rate=corrected(turn_back, found.gyroscope_offset, recording.angular_rate),
        accelerometer_position=recording.accelerometer_position @ found.drawing_turn,
        accelerometer_noise_sd=_noise(matrix, found.accelerometer_noise),
        gyroscope_noise_sd=_noise(maps, found.gyroscope_noise),
        accelerometer_range=nearest_rail(recording.accelerometer_range, matrix, offset),
        gyroscope_range=nearest_rail(recording.gyroscope_range, maps, found.gyroscope_offset),
        map_covariance=found.left(), clock_sd=float(clock_sd), stationary=still,
        accelerometer_axes=axes,
        specific_force_saturated=rails_shown(back, recording.saturated_accelerometers()),
        angular_rate_saturated=rails_shown(turn_back, recording.saturated_gyroscopes()),
        correction=_correction(recording, found, back, turn_back),
    )  # fmt: skip


def corrected(inverse, offset, readings) -> np.ndarray:
    """inverse (K, 3, 3) @ (readings (T, K, 3) - offset (K, 3)), summed from x to z.

    Written out, so that whoever does the same gets the same bits.
    """
    x = readings - offset
    return (
        inverse[:, :, 0] * x[:, :, :1] + inverse[:, :, 1] * x[:, :, 1:2]
        + inverse[:, :, 2] * x[:, :, 2:]
    )  # fmt: skip


def _correction(recording: Recording, found: FirstOrder, *inverses) -> xr.Dataset:
    """Contents of `Recording.correction`; after a former correction, both as one."""
    offsets = (found.triads.offset, found.triads.parts_sd()["offset"], found.triads.walk), (
        found.gyroscope_offset, found.gyroscope_offset_sd, found.gyroscope_walk,
    )  # fmt: skip
    variables, before = {}, recording.correction
    for kind, inverse, (offset, sd, walk) in zip(KINDS, inverses, offsets, strict=True):
        if before is not None:
            first = before[f"{kind}_inverse"].to_numpy()
            offset = np.linalg.solve(first, offset[..., None])[..., 0]
            offset, inverse = before[f"{kind}_offset"].to_numpy() + offset, inverse @ first
        unit = {"units": NUMBERS[f"{kind}_noise_sd"]}
        rooted = {"units": f"{unit['units']} s-0.5"}
        variables |= {
            f"{kind}_inverse": (inverse, {"units": "1"}), f"{kind}_offset": (offset, unit),
            f"{kind}_offset_sd": (sd, unit),
            f"{kind}_offset_walk": (walk, rooted),
        }  # fmt: skip
    return xr.Dataset({name: (CORRECTION[name], *both) for name, both in variables.items()})


def _noise(matrix, noise) -> float:
    """Pooled sd of a corrected reading."""
    squares = np.einsum("kij,kj->ki", np.linalg.inv(matrix) ** 2, noise**2)
    return float(np.sqrt(squares.mean()))
