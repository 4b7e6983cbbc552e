"""What the commands work on: the recording's usable samples, and the model asked for."""

from __future__ import annotations

from dataclasses import replace

from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.recording import Recording, array_of


def model_of(recording: Recording, effects=()) -> ArrayModel:
    """The measurement model a recording declares: its geometry and noise."""
    return ArrayModel.isotropic(
        array_of(recording), recording.accelerometer_noise_sd, recording.gyroscope_noise_sd, effects
    )


def assumed(recording: Recording, arguments) -> Recording:
    """The recording with the accelerometer noise that the command line assumes, if it does."""
    sd = arguments.accelerometer_noise
    return recording if sd is None else replace(recording, accelerometer_noise_sd=sd)


def usable(recording: Recording, quiet: bool) -> Recording:
    """The recording without still poses and samples with an accelerometer at its rail."""
    lost = recording.saturated_accelerometers().any(axis=(1, 2))
    if lost.all():
        raise InputError("recording: expected samples off the rail, found every one at a rail")
    if lost.any() and not quiet:
        print(f"left out {lost.sum()} of {lost.size} samples with an accelerometer at its rail")
    if recording.stationary is not None and recording.stationary.any():
        # they tell nothing of the positions, and cost as much as the others
        still = recording.stationary & ~lost
        if not quiet:
            print(f"left out {still.sum()} of {lost.size} samples of still poses")
        lost = lost | still
        if lost.all():
            raise InputError("recording: expected moving samples, found still poses only")
    return recording.select(~lost) if lost.any() else recording


def extender(arguments):
    """What gives a model the effects and the noise of the diagnosis asked for, or None.

    A function of the model and of the labels of accelerometers and gyroscopes, the model's own
    by default.
    """
    if arguments.diagnosis is None:
        return None
    from imuarray.criticism.extension import extended_model, read_extension

    if arguments.effects:
        raise InputError("--effects: expected none beside --diagnosis, found some")
    noise = getattr(arguments, "accelerometer_noise", None)
    if noise is not None:
        raise InputError(
            "--accelerometer-noise: expected none beside --diagnosis, whose noise is used, found"
            f" {noise:g}"
        )
    extension = read_extension(arguments.diagnosis)
    if "axis_swap" in extension.before:
        raise InputError(
            f"{arguments.diagnosis}: expected right axes, found an axis_swap; mend the recording"
        )
    if not arguments.quiet:
        for name in extension.before:
            print(f"{name}: concerns readings, not the model; they are used as they are")

    def extended(model: ArrayModel, labels=None) -> ArrayModel:
        return extended_model(extension, model, labels or (model.array.labels,) * 2)

    return extended


def chosen_model(recording: Recording, arguments) -> ArrayModel:
    """The recording's measurement model with the effects, or the diagnosis, asked for."""
    extended = extender(arguments)
    if extended is None:
        return model_of(recording, arguments.effects)
    return extended(
        model_of(recording), (recording.accelerometer_labels, recording.gyroscope_labels)
    )
