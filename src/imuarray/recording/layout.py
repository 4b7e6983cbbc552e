"""The small YAML that says what a log holds: columns or topics, units, positions, axes, noise."""

import json
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from imuarray.errors import LARGEST, SMALLEST, expecting, require
from imuarray.recording.settings import SETTINGS
from imuarray.recording.units import SI, factor
from imuarray.recording.validate import is_rotation

KINDS = {"accelerometers": "force", "gyroscopes": "rate"}
# Which keys may be in each section, and which have to be there, the editors' schema says. A board's
# triads share one table's rows; a rig's IMUs have each their own log, or topic, and stamps.
SCHEMA = Path(__file__).with_name("columns.schema.json")
BOARD, RIG, BAG = json.loads(SCHEMA.read_text(encoding="utf-8"))["anyOf"]
_NAMES = "column", "columns", "log", "sensor", "topic"


class _Loader(yaml.SafeLoader):
    """Safe YAML that refuses a key given twice: the second would silently replace the first.

    Keys (labels among them) and the names of columns are text as it stands: 010 and yes, too.
    """

    def construct_mapping(self, node, deep=False):
        scalars = [pair for pair in node.value if isinstance(pair[0], yaml.ScalarNode)]
        keys = [key.value for key, _ in scalars]
        for key, value in scalars:
            names = value.value if isinstance(value, yaml.SequenceNode) else [value]
            for name in [key] + names * (key.value in _NAMES):
                if isinstance(name, yaml.ScalarNode) and not name.tag.endswith(":merge"):
                    name.tag = "tag:yaml.org,2002:str"
        twice = next((key for i, key in enumerate(keys) if key in keys[:i]), None)
        if twice is not None:
            line = node.start_mark.line + 1
            raise yaml.YAMLError(f"the key {twice!r} twice in the section at line {line}")
        return super().construct_mapping(node, deep)


def read_layout(path: str | PathLike, bag: bool = False) -> dict[str, Any]:
    """The YAML that describes a log; InputError for a missing file or a wrong key.

    Each of a rig's IMUs has both kinds' sections whole, its own keys in place of the common ones.
    """
    path = Path(path)
    require(path.is_file(), str(path), "a YAML file that describes the log", "none")
    # ValueError: bytes that are no UTF-8, a date with a 13th month
    with expecting(path, "YAML", (yaml.YAMLError, ValueError, RecursionError)):
        layout = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    rig = bag or (isinstance(layout, dict) and "imus" in layout)
    schema = BAG if bag else RIG if rig else BOARD
    _require_keys(layout, schema, str(path))
    for imu in layout.get("imus", {}).values():
        imu |= {kind: layout[kind] | imu.get(kind, {}) for kind in KINDS}
    return layout


def _require_keys(section: Any, schema: dict, where: str) -> None:
    """InputError unless a section, and each section in it, has the schema's keys."""
    keys = {key: key in schema.get("required", ()) for key in schema["properties"]}
    require(isinstance(section, dict), where, _listed(keys), repr(section))
    for key in section:
        near = [] if key in keys else get_close_matches(str(key), keys, 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        require(key in keys, where, _listed(keys), f"an unknown key {key!r}{hint}")
    for key, needed in keys.items():
        require(key in section or not needed, where, _listed(keys), f"no {key!r}")
    for key in filter(section.__contains__, keys):
        known, inner = schema["properties"][key], section[key]
        place = where if key == "triads" else f"{where}: {key}"
        if "properties" in known:
            _require_keys(inner, known, place)
        elif "additionalProperties" in known:
            what = "IMUs by label" if key == "imus" else f"{key} by label"
            require(isinstance(inner, dict) and inner, place, what, repr(inner))
            for label, own in inner.items():
                _require_keys(own, known["additionalProperties"], f"{place} {label!r}")


def _listed(keys: dict[str, bool]) -> str:
    """The keys that have to be there, and those that may."""
    kinds = ("the keys", True), ("optionally", False)
    parts = [(word, [key for key in keys if keys[key] is needed]) for word, needed in kinds]
    return ", ".join(f"{word} {', '.join(names)}" for word, names in parts if names)


def _is_number(value) -> bool:
    """True of numbers that can be computed with: YAML has .nan, .inf, integers of any length."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= LARGEST


def positive(value, where: str) -> float:
    """A number above 0, or InputError."""
    require(_is_number(value) and value >= SMALLEST, where, "a positive number", repr(value))
    return float(value)


def _three(value, where: str) -> list[float]:
    numbers = isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))
    require(numbers, where, "three numbers", repr(value))
    return [float(x) for x in value]


def numbers(layout, where: str) -> dict[str, float]:
    """Noise and range of both kinds, and the positions' prior sd, in SI units."""
    out = {}
    for kind, quantity in KINDS.items():
        section, name = layout[kind], kind.removesuffix("s")
        place = f"{where}: {kind}"
        unit = factor(quantity, section.get("unit", SI[quantity]), f"{place}: unit")
        for key, attribute in (("noise", "noise_sd"), ("range", "range")):
            value = positive(section[key], f"{place}: {key}")
            out[f"{name}_{attribute}"] = unit * value
    length = factor("length", layout.get("position_unit", "m"), f"{where}: position_unit")
    prior = positive(
        layout.get("position_prior", SETTINGS.position_prior / length), f"{where}: position_prior"
    )
    return out | {"position_prior_sd": length * prior}


def unit_of(section, kind: str, where: str) -> float:
    """SI units in 1 of a kind's readings, by its unit and how many units a count is."""
    unit = factor(KINDS[kind], section.get("unit", SI[KINDS[kind]]), f"{where}: {kind}: unit")
    return unit * positive(section.get("scale", 1.0), f"{where}: {kind}: scale")


def positions(sections: dict[str, dict], layout, where: str) -> np.ndarray:
    """Nominal positions (A, 3) m of triads or IMUs; NaN where the layout has none at all."""
    without = [label for label, section in sections.items() if "position" not in section]
    if len(without) == len(sections):
        return np.full((len(sections), 3), np.nan)
    found = f"none of {without[0]!r}" if without else ""
    require(not without, where, "the position of each or of none", found)
    length = factor("length", layout.get("position_unit", "m"), f"{where}: position_unit")
    places = [
        _three(section["position"], f"{where} {label!r}: position")
        for label, section in sections.items()
    ]
    size = float(np.ptp(places, axis=0).max())
    near, found = size <= SETTINGS.widest, f"{size:g}: name the position_unit, mm or m"
    expected = f"positions within {SETTINGS.widest:g} m of each other"
    require(near or "position_unit" in layout, where, expected, found)
    return length * np.array(places)


def rotation(axes, where: str) -> np.ndarray:
    """Rotation from the sensor's axes to the array's: [-y, -x, -z] or a 3 x 3 matrix.

    The shorthand lists, for the array's x, y and z, the sensor's axis that points along it.
    """
    expected = "axes such as [-y, -x, -z] or a 3 x 3 rotation matrix"
    require(isinstance(axes, list) and len(axes) == 3, where, expected, repr(axes))
    if all(isinstance(row, str) for row in axes):
        matrix = np.zeros((3, 3))
        for row, name in enumerate(axes):
            letter = name.lstrip("+-")
            require(letter in ("x", "y", "z"), where, expected, repr(axes))
            matrix[row, "xyz".index(letter)] = -1.0 if name.startswith("-") else 1.0
    else:
        matrix = np.array([_three(row, where) for row in axes])
    require(is_rotation(matrix), where, expected, f"{axes!r}, which is no rotation")
    return matrix


def three_columns(names, where: str) -> list[str]:
    """Three different names, or InputError."""
    three = isinstance(names, list) and len(set(map(str, names))) == len(names) == 3
    require(three, where, "three columns", repr(names))
    return [str(name) for name in names]
