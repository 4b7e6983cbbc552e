"""What the parameters of effects are called, in every file and on every page."""

import numpy as np

from imuarray.model.array_model import ArrayModel
from imuarray.model.effects import EFFECTS, known_effect

AXES = "xyz"
OFF_DIAGONAL = ("xy", "xz", "yx", "yz", "zx", "zy")


def component(effect: str, place: tuple[int, ...]) -> str:
    """The name of a parameter within its IMU's: ``place`` are its indices but the IMU's."""
    item = known_effect(effect)
    if item.components:
        parts = zip(item.components, place or (0,), strict=True)
        return "_".join(names[index] for names, index in parts)
    if not place:
        return "value"
    sizes = item.shape(2, 2)[1:] if item.shape else (3,) * len(place)
    if set(sizes) == {3}:
        return "".join(AXES[index] for index in place)
    if sizes == (len(OFF_DIAGONAL),):
        return OFF_DIAGONAL[place[0]]
    return "value" + "_".join(str(index + 1) for index in place)


def unit_of(effect: str, place: tuple[int, ...]) -> str:
    """The parameter's unit: commas count along the last axis, bars along the second."""
    unit = EFFECTS[effect].unit
    if "|" in unit:
        return unit.split("|")[place[0]].strip()
    return unit.split(",")[place[-1]].strip() if "," in unit else unit


def parameter_ids(model: ArrayModel, labels=None) -> list[tuple[str, str]]:
    """(effect, component_IMU) of each flat effect parameter, (P,).

    ``labels``: of the accelerometers and of the gyroscopes; by default the array's, or numbers.
    """
    return [(effect, name) for effect, name, _ in _parameters(model, labels)]


def parameter_names(model: ArrayModel, labels=None) -> list[str]:
    """'effect component_IMU unit' of each flat effect parameter, (P,); see `parameter_ids`."""
    return [" ".join(parts) for parts in _parameters(model, labels)]


def _parameters(model: ArrayModel, labels) -> list[tuple[str, str, str]]:
    counts = (str(k + 1) for k in range(model.array.gyroscopes))
    whole = max(labels or (model.array.labels, tuple(counts)), key=len)
    return [
        (item.id, f"{component(item.id, i[1:])}_{whole[i[0]]}", unit_of(item.id, i[1:]))
        for item, shape in zip(model.chain, model.shapes, strict=True)
        for i in np.ndindex(*shape)
    ]
