"""The input of the analyses: the recording's usable samples, and the model asked for."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from imuarray.analysis import methods
from imuarray.engine.linearise import State
from imuarray.engine.readings import Readings
from imuarray.errors import LARGEST, SMALLEST, IdentifiabilityError, InputError, require
from imuarray.geometry.array import require_planar_extent
from imuarray.linear import scaled_inverse
from imuarray.model.effects import find_effects
from imuarray.model.structure import design
from imuarray.motion.rotation import require_rotation
from imuarray.recording import Recording
from imuarray.recording.channels import require_live

Notify = Callable[[str], None]


def silent(text: str) -> None:
    """The default ``notify``: what a notebook wants to hear of the work's course."""


def assumed(recording: Recording, accelerometer_noise: float | None) -> Recording:
    """The recording with another accelerometer noise (m/s^2) than it declares, if one is given."""
    if accelerometer_noise is None:
        return recording
    if not SMALLEST <= accelerometer_noise <= LARGEST:
        raise InputError(
            f"accelerometer_noise: expected a positive number, found {accelerometer_noise!r}"
        )
    return replace(recording, accelerometer_noise_sd=accelerometer_noise)


def usable(recording: Recording, notify: Notify = silent) -> Recording:
    """The recording without still poses and samples with an accelerometer at its rail.

    InputError where that leaves none, and for constant or copied channels; IdentifiabilityError
    for two IMUs.
    """
    require_live(recording)
    require_planar_extent(recording.accelerometer_position, "recording")
    lost = recording.at_rail("accelerometer")
    require(not lost.all(), "recording", "samples off the rail", "every one at a rail")
    if lost.any():
        notify(f"left out {lost.sum()} of {lost.size} samples with an accelerometer at its rail")
    if recording.still().any():
        # they say nothing about the positions, and cost as much as the others
        still = recording.still() & ~lost
        notify(f"left out {still.sum()} of {lost.size} samples of still poses")
        lost = lost | still
        require(not lost.all(), "recording", "moving samples", "still poses only")
    return recording.select(~lost) if lost.any() else recording


def require_seen(readings: Readings) -> None:
    """IdentifiabilityError where in some sample an axis has no gyroscope off its rail."""
    blind = np.flatnonzero(~np.all(np.any(readings.keep[..., 3:], axis=1), axis=1))
    if blind.size:
        raise IdentifiabilityError(
            "gyroscopes: expected one unsaturated per axis in every sample, found none in sample"
            f" {blind[0]} (and {blind.size - 1} more)"
        )


def require_motion(readings: Readings, state: State) -> None:
    """IdentifiabilityError where the motion is about one axis (Lemma 1), or hardly any.

    ``state``: as `engine.start.start` has it.
    """
    kinds = [readings.exists[:, kind] for kind in range(2)]
    force, rate = (readings.sd[own, kind] ** -2.0 for kind, own in enumerate(kinds))
    rows = design(state.positions)[:, 6:]
    inverse = scaled_inverse(rows.T @ (np.repeat(force, 3)[:, None] * rows))

    def turning():
        return state.motion[:, 3:6], np.sqrt(np.max(np.diag(inverse)[:3]))

    require_rotation(state.motion[:, :3], 1 / np.sqrt(np.sum(rate)), turning)


def require_together(
    model, recordings: Sequence[Recording], effects: Sequence[str],
    accelerometer_noise: float | None,
) -> None:  # fmt: skip
    """InputError where a model, its effects, noise and recordings do not go together."""
    find_effects(effects)  # an unknown one is named before anything else
    known = f"any of {', '.join(methods.MODELS)} or a calibration (.nc)"
    require(model in methods.MODELS or methods.is_file(model), "model", known, repr(model))
    kind = "--model papers" if model == "papers" else "the model of a calibration"
    require(not effects or model == "sensors", "--effects", f"none with {kind}", "some")
    taken = model == "papers" or accelerometer_noise is None
    other = "it where the noise is estimated"
    require(taken, "--accelerometer-noise", "it with --model papers only", other)
    if len(recordings) > 1:
        require(model == "sensors", f"--model {model}", "one recording", len(recordings))
        first = recordings[0]
        for one in recordings[1:]:
            same = one.accelerometer_labels == first.accelerometer_labels and np.allclose(
                one.relative_positions(), first.relative_positions(), atol=1e-9
            )
            require(same, "recordings", "one board", "other labels or nominal positions")
        ways = {None if r.map_covariance is None else len(r.map_covariance) for r in recordings}
        alike = "all of them corrected alike (imuarray first-order), or none"
        other = "some with maps of sensors taken out that others have"
        require(len(ways) == 1, "recordings", alike, other)
