"""The input of the analyses: the recording's usable samples, and the model asked for."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from imuarray.analysis import methods
from imuarray.errors import LARGEST, SMALLEST, InputError
from imuarray.geometry.array import require_planar_extent
from imuarray.model.effects import find_effects
from imuarray.recording import Recording
from imuarray.recording.channels import require_live

Say = Callable[[str], None]


def silent(text: str) -> None:
    """The default ``say``: what a notebook wants to hear of the work's course."""


def assumed(recording: Recording, accelerometer_noise: float | None) -> Recording:
    """The recording with another accelerometer noise (m/s^2) than it declares, if one is given."""
    if accelerometer_noise is None:
        return recording
    if not SMALLEST <= accelerometer_noise <= LARGEST:
        raise InputError(
            f"accelerometer_noise: expected a positive number, found {accelerometer_noise!r}"
        )
    return replace(recording, accelerometer_noise_sd=accelerometer_noise)


def usable(recording: Recording, say: Say = silent) -> Recording:
    """The recording without still poses and samples with an accelerometer at its rail.

    InputError where that leaves none, and for constant or copied channels; IdentifiabilityError
    for two IMUs.
    """
    require_live(recording)
    require_planar_extent(recording.accelerometer_position, "recording")
    lost = recording.at_rail("accelerometer")
    if lost.all():
        raise InputError("recording: expected samples off the rail, found every one at a rail")
    if lost.any():
        say(f"left out {lost.sum()} of {lost.size} samples with an accelerometer at its rail")
    if recording.stationary is not None and recording.stationary.any():
        # they say nothing about the positions, and cost as much as the others
        still = recording.stationary & ~lost
        say(f"left out {still.sum()} of {lost.size} samples of still poses")
        lost = lost | still
        if lost.all():
            raise InputError("recording: expected moving samples, found still poses only")
    return recording.select(~lost) if lost.any() else recording


def require_together(
    model, recordings: Sequence[Recording], effects: Sequence[str],
    accelerometer_noise: float | None,
) -> None:  # fmt: skip
    """InputError where a model, its effects, noise and recordings do not go together."""
    find_effects(effects)  # an unknown one is named before anything else
    if model not in methods.MODELS and not methods.is_file(model):
        known = ", ".join(methods.MODELS)
        raise InputError(f"model: expected any of {known} or a calibration (.nc), found {model!r}")
    if effects and model != "sensors":
        what = "--model papers" if model == "papers" else "the model of a calibration"
        raise InputError(f"--effects: expected none with {what}, found some")
    if model != "papers" and accelerometer_noise is not None:
        raise InputError(
            "--accelerometer-noise: expected it with --model papers only, found it where the noise"
            " is estimated"
        )
    if len(recordings) > 1:
        if model != "sensors":
            raise InputError(f"--model {model}: expected one recording, found {len(recordings)}")
        for other in recordings[1:]:
            if other.accelerometer_labels != recordings[0].accelerometer_labels or not np.allclose(
                other.relative_positions(), recordings[0].relative_positions(), atol=1e-9
            ):
                raise InputError(
                    "recordings: expected one board, found other labels or nominal positions"
                )
        ways = {None if r.map_covariance is None else len(r.map_covariance) for r in recordings}
        if len(ways) > 1:
            raise InputError(
                "recordings: expected all of them corrected alike (imuarray first-order), or none,"
                " found some with maps of sensors taken out that others have"
            )
