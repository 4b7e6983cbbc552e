"""A cause of a diagnosis in words: what it is, how large, how sure, what cannot be told from it."""

from __future__ import annotations

import numpy as np

from imuarray.diagnosis.words import MEANING, first_up, whose
from imuarray.model import EFFECTS
from imuarray.report.quantities import (
    NARROW,
    joined,
    plus_minus,
    probability,
    quantity,
    span,
    symbols,
    unit_shown,
)

DOUBTFUL = 0.5  # share of a cause's gain that a placebo must not have
FEW = 3  # parameters that are told one by one
# Of effects that are no part of the mean: what the extended model does about them.
INSTEAD = {
    "saturation": "readings at the rail are left out",
    "stale_samples": "repeated readings are left out",
    "axis_swap": "the axes are turned back",
    "heavy_tails": "the noise is a mixture of two normals; the readings of the wide one are left"
    " out of the fit",
    "coloured_noise": "noise remembers itself from sample to sample, and widths allow for it",
    "accelerometer_noise": "the noise has the size given below",
    "gyroscope_noise": "the noise has the size given below",
}


def words(effect: str) -> str:
    """An effect's id without underscores."""
    return effect.replace("_", " ")


def whose_short(sensors) -> str:
    """'all IMUs', 'IMU 3', 'IMUs 3, 4'."""
    return whose(sensors).removeprefix("in ")


def cause_in_words(cause: dict, labels, says="") -> str:
    """A cause with its size, what was read (``says``), evidence and class."""
    effect = cause["effect"]
    text = f"{words(effect)}, {whose_short(cause['sensors'])}: {MEANING.get(effect, words(effect))}"
    size = says or sizes(cause, labels)
    text += f"; {size}" if size else ""
    gain = plus_minus(cause["heldout_gain_nats"], cause["heldout_gain_se"])
    p_value = probability(cause["log10_p_value"])
    text += f". Gain on held-out time {gain} nats, p{NARROW}={NARROW}{p_value}."
    if 0 < DOUBTFUL * cause.get("gain_in_sample_nats", 0.0) < cause.get("placebo_gain_nats", 0.0):
        text += (
            " Its placebo, the same numbers at other IMUs, gains too: it is doubtful whose it is."
        )
    if cause["indistinguishable_from"]:
        rivals = joined(words(name) for name in cause["indistinguishable_from"])
        text += f" On this recording it cannot be told from {rivals}: one class."
    return first_up(text)


def split_name(name: str, labels) -> tuple[str, str]:
    """(component, IMU) of a parameter's name; IMU is "" where the name has none."""
    for label in sorted(labels, key=len, reverse=True):
        if name.endswith(f"_{label}"):
            return name[: -len(label) - 1], label
    return name, ""


def sizes(cause: dict, labels) -> str:
    """A cause's parameters: each of a few, else their rms and the largest."""
    groups: dict[tuple[str, str], list] = {}
    for name, item in cause["parameters"].items():
        part, label = split_name(name, labels)
        if part == "phase":
            continue
        unit = unit_shown(cause["effect"], name, item["unit"])
        kind = part if cause["effect"] in ("sensor_clock", "position_shift") and unit != "m" else ""
        if cause["effect"] in INSTEAD:
            kind = "correlation time" if part.startswith("correlation_time") else part.split("_")[0]
        groups.setdefault((kind, unit), []).append((part, label, item))
    return ", ".join(_group(kind, unit, items) for (kind, unit), items in groups.items())


def _group(kind, unit, items) -> str:
    values = np.array([item["value"] for *_, item in items])
    # the sign of a clock's frequency says which way its sawtooth runs
    values = np.abs(values) if kind == "frequency" else values
    several = len({label for _, label, _ in items}) > 1
    if len(items) <= FEW:
        size = np.max(np.abs(values))
        return ", ".join(
            f"{part_in_words(part)}{f' of IMU {label}' if several and label else ''} ".replace(
                "value ", ""
            )
            + quantity(value, item["sd"], unit, size)
            for value, (part, label, item) in zip(values, items, strict=True)
        )
    if kind:
        return f"{kind} {span(float(values.min()), float(values.max()), unit)}"
    place = int(np.argmax(np.abs(values)))
    part, label, item = items[place]
    rms = quantity(float(np.sqrt(np.mean(values**2))), None, unit)
    largest = quantity(float(values[place]), item["sd"], unit)
    text = f"rms {rms}, the largest, {part_in_words(part)} of IMU {label}, {largest}"
    if item["sd"] is not None and abs(values[place]) < 2 * item["sd"]:
        text += " (single values are uncertain: the motion can take up combinations of them)"
    return text


def part_in_words(part: str) -> str:
    """'accelerometer z, degree 1' of 'accelerometer_z_degree1'."""
    return part.replace("_degree", ", degree ").replace("_", " ")


def equation(effect: str) -> str:
    """What an effect does to a reading, in the model's own words."""
    if effect not in EFFECTS:
        return INSTEAD.get(effect, words(effect))
    text = symbols((EFFECTS[effect].apply.__doc__ or "").strip().split("\n")[0].rstrip("."))
    return text[:1].lower() + text[1:] if text[1:2].islower() else text
