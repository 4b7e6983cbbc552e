"""Causes in words: what they are, how large, how sure, what cannot be distinguished from them.

The sentences of `diagnosis.json` and of its page alike.
"""

import numpy as np

from imuarray.diagnosis.plain import (
    NARROW,
    Sizes,
    first_up,
    joined,
    plain,
    plus_minus,
    probability,
    quantity,
    span,
    symbols,
    unit_shown,
)
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.state import Cause, Search
from imuarray.engine.fit import flat_parameters
from imuarray.model.array_model import component, unit_of
from imuarray.model.effects import known_effect

FEW = 3  # parameters that are stated one by one


def parameters_of(search: Search, cause: Cause, sds) -> dict:
    """{name: {value, sd, unit}} of a cause; ``sds`` (N, m), of what a scan fixed there is none."""
    values, columns = flat_parameters(search.columns, search.fit.state), search.columns
    active, item = search.active, known_effect(cause.effect)
    held = (*item.held, *(item.held_rough if search.fit.state.gyroscopes_free else ()))
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
    """'all IMUs', 'IMU 3', 'IMUs 3, 4'."""
    if sensors == ["all"]:
        return "all IMUs"
    return f"IMU{'s' if len(sensors) > 1 else ''} {', '.join(sensors)}"


def words(effect: str) -> str:
    """An effect's id without underscores."""
    return effect.replace("_", " ")


def cause_in_words(cause: dict, labels, says: str = "") -> str:
    """A cause of `diagnosis.json` with its size, or what was read (``says``), test and class."""
    text = f"{words(cause['effect'])}, {whose(cause['sensors'])}: {in_short(cause, labels, says)}"
    if stretches := cause.get("stretches_s"):
        first = [f"{a:.4g} to {b:.4g}" for a, b in stretches[:FEW]]
        text += f"; longest at {', '.join(first)} s"
    gain = plus_minus(cause["heldout_gain_nats"], cause["heldout_gain_se"])
    p_value = probability(cause["log10_p_value"])
    equals = "" if p_value.startswith("<") else f"={NARROW}"
    text += f". Gain on held-out time {gain} nats, p{NARROW}{equals}{p_value}."
    true, placebo = cause.get("gain_in_sample_nats", 0.0), cause.get("placebo_gain_nats", 0.0)
    if cause["sensors"] != ["all"] and 0 < SETTINGS.doubtful * true < placebo:
        text += (
            " Its placebo, the same numbers at other IMUs, gains too: it is doubtful whose it is."
        )
    if cause["indistinguishable_from"]:
        rivals = joined(words(name) for name in cause["indistinguishable_from"])
        text += f" On this recording it cannot be distinguished from {rivals}: one class."
    return first_up(text)


def in_short(cause: dict, labels, says: str = "") -> str:
    """Kind and size of a cause, in the words of one who holds the board."""
    effect = cause["effect"]
    found = plain(effect, _sizes_of(cause, labels)) if cause["parameters"] else []
    told = [says or sizes(cause, labels)] if says or not found else []
    parts = found or [known_effect(effect).meaning or words(effect)]
    return "; ".join(filter(None, parts + told))


def _sizes_of(cause: dict, labels) -> Sizes:
    rows = cause["parameters"].items()
    return Sizes.of(
        {split_name(name, labels): (item["value"], item["sd"]) for name, item in rows}, labels
    )


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
        effect = known_effect(cause["effect"])
        kind = part.split("_")[0] if effect.scanned and unit != "m" else ""
        if effect.kind != "mean":
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
    """Change that an effect makes in a reading, in the model's own words."""
    item = known_effect(effect)
    if item.apply is None:
        return item.remedy or words(effect)
    text = symbols((item.apply.__doc__ or "").strip().split("\n")[0].rstrip("."))
    return text[:1].lower() + text[1:] if text[1:2].islower() else text
