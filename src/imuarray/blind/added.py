"""An effect added to a measured recording is to be found on top of whatever is there."""

from imuarray.blind.grade import classes
from imuarray.blind.inject import EFFECTS
from imuarray.blind.measured import inject_measured, measured_change
from imuarray.recording import Recording
from imuarray.streams import stream

# Effects that a good board does not have already; each of the largest realistic size.
ADDED = (
    "accelerometer_bias",
    "accelerometer_nonlinearity",
    "gyroscope_g_sensitivity",
    "stale_samples",
    "axis_swap",
)


def add(recording: Recording, effect: str, seed: int) -> tuple[Recording, dict]:
    """The recording with the effect on one IMU, and the truth as plain JSON.

    ValueError as `inject_measured` raises it.
    """
    count = recording.specific_force.shape[1]
    imu = int(stream(seed, "blind", "added", effect).integers(count))
    size = float(EFFECTS[effect].high)
    change = measured_change(recording, effect, (imu,), size, seed)
    changed = inject_measured(recording, effect, (imu,), size, seed)
    label = recording.accelerometer_labels[imu]
    truth = {"effect": effect, "sensor": label, **change.described()}
    return changed, truth


def grade_added(truth: dict, before: dict, after: dict) -> dict:
    """Is it named after, not before, and on its sensor? Both are `diagnosis.json`.

    ``others``: names that came with it and hold nothing of the truth.
    """
    effect, sensor = truth["effect"], truth["sensor"]
    named = classes(after["causes"])
    mine = [
        cause for cause in after["causes"]
        if effect in (cause["effect"], *cause["indistinguishable_from"])
    ]  # fmt: skip
    sensors = sorted({name for cause in mine for name in cause["sensors"]})
    earlier = classes(before["causes"])
    return {
        "effect": effect,
        "sensor": sensor,
        "amplitude": truth["amplitude"]["value"],
        "unit": truth["amplitude"]["unit"],
        "there_before": effect in earlier,
        "found": bool(mine),
        "named": any(cause["effect"] == effect for cause in mine),
        "sensors": " ".join(sensors),
        "sensor_right": sensors == [sensor],
        "gain_nats": sum(cause["heldout_gain_nats"] for cause in mine),
        "others": " ".join(
            name for name, members in named.items() if name not in earlier and effect not in members
        ),
    }
