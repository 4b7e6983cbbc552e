"""Causes in words and numbers: parameters with sd and unit, sensors, one sentence each."""

from __future__ import annotations

import numpy as np

from imuarray.diagnosis.fit import flat_parameters
from imuarray.diagnosis.parameters import HELD
from imuarray.diagnosis.state import Cause, Search, own_turning
from imuarray.model.names import component, unit_of

# What an effect is, in the words of one who holds the board.
MEANING = {
    "accelerometer_bias": "the accelerometers have an offset",
    "accelerometer_scale": "the accelerometers' axes are scaled",
    "accelerometer_misalignment": "the accelerometers' axes are skewed",
    "accelerometer_nonlinearity": "the accelerometers' response is curved",
    "size_effect": "the three axes of an accelerometer sit at places of their own",
    "gyroscope_bias": "the gyroscopes have an offset",
    "gyroscope_scale": "the gyroscopes' axes are scaled",
    "gyroscope_misalignment": "the gyroscopes' axes are skewed against each other",
    "gyroscope_g_sensitivity": "the gyroscopes respond to specific force",
    "gyroscope_nonlinearity": "the gyroscopes' response is curved",
    "sensor_delay": "whole IMUs are read at instants of their own",
    "gyroscope_delay": "gyroscopes tell another instant than accelerometers, later for delays > 0",
    "sensor_clock": "the IMUs sample on clocks of their own, so that a reading's age is a sawtooth",
    "saturation": "readings pile up at a rail below the declared range",
    "accelerometer_noise": "the accelerometers' noise is not the declared one",
    "gyroscope_noise": "the gyroscopes' noise is not the declared one",
    "heavy_tails": "a share of the readings is far noisier than the rest",
    "coloured_noise": "noise remembers itself from sample to sample",
    "bias_drift": "an offset changes through the recording",
    "axis_swap": "axes are exchanged or reversed",
    "stale_samples": "former samples are repeated",
    "position_shift": "a triad moved on the board during the recording",
}


def parameters_of(search: Search, cause: Cause, sds) -> dict:
    """{name: {value, sd, unit}} of a cause; ``sds`` (N, m), of what a scan fixed there is none."""
    values, columns = flat_parameters(search.columns, search.fit.state), search.columns
    active, held = search.active, HELD.get(cause.effect, ())
    if cause.effect == "sensor_clock" and own_turning(search.fit.state):
        held = (0, *held)  # where the gyroscopes' turning is free it takes the period's place
    found = {}
    for imu in cause.imus:
        for column in columns.of(cause.effect):
            place = columns.places[column]
            fixed = bool(place) and place[-1] in held
            if not (active[imu, column] or fixed):
                continue
            name = f"{component(cause.effect, place)}_{search.readings.labels[imu]}"
            found[name] = {
                "value": float(values[imu, column]),
                "sd": None if fixed else float(sds[imu, column]),
                "unit": unit_of(cause.effect, place),
            }
    return found


def sensors_of(labels, imus) -> list[str]:
    """Labels of the IMUs, or ["all"]."""
    return ["all"] if len(imus) == len(labels) else [labels[k] for k in imus]


def whose(sensors) -> str:
    """In a sentence."""
    if sensors == ["all"]:
        return "in all IMUs"
    return f"in IMU{'s' if len(sensors) > 1 else ''} {', '.join(sensors)}"


def sentence(effect: str, sensors, parameters: dict, gain, rivals) -> str:
    """What a cause is, how large, and what cannot be told from it."""
    meaning = MEANING.get(effect, effect.replace("_", " "))
    text = f"{first_up(meaning)} ({whose(sensors)})"
    size = _size(parameters)
    text += f"; {size}" if size else ""
    if gain is not None:
        text += f"; {gain:.3g} nats gained on held-out time"
    if rivals:
        text += f". This recording cannot tell it from {', '.join(rivals)}"
    return text + "."


# Components that are told apart by name; all others of a unit are one size.
NAMED = ("period", "frequency", "delay", "ratio", "share", "factor", "correlation", "time")


def _size(parameters: dict) -> str:
    """Root mean squares of the parameters, by kind of component with a unit."""
    groups: dict[tuple[str, str], list[float]] = {}
    for name, item in parameters.items():
        kind = "correlation time" if name.startswith("correlation_time") else name.split("_")[0]
        kind = kind if kind.split(" ")[0] in NAMED else ""
        if name.startswith(("phase", "offset")):
            continue
        groups.setdefault((kind, item["unit"]), []).append(item["value"])
    words = []
    for (kind, unit), values in groups.items():
        size = float(np.sqrt(np.mean(np.square(values))))
        words.append(f"{kind or 'size'} {size:.3g}{'' if unit == '1' else ' ' + unit}")
    return ", ".join(words)


def first_up(text: str) -> str:
    """With a capital."""
    return text[:1].upper() + text[1:]
