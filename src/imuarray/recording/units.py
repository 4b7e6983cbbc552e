"""The spellings of units that recordings and tables may use, and what each is in SI units."""

import math

from imuarray.errors import InputError

GRAVITY = 9.80665  # m/s^2, the unit g of data sheets
_DEGREE = math.pi / 180

# The first of each is SI, and what is written.
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "length": {"m": 1.0, "mm": 1e-3},
    "force": {"m s-2": 1.0, "m/s^2": 1.0, "m/s2": 1.0, "g": GRAVITY, "mg": 1e-3 * GRAVITY},
    "rate": {
        "rad s-1": 1.0, "rad/s": 1.0, "deg s-1": _DEGREE, "deg/s": _DEGREE, "dps": _DEGREE,
        "mdeg/s": 1e-3 * _DEGREE,
    },
}  # fmt: skip


def factor(quantity: str, unit: object, where: str) -> float:
    """What one ``unit`` of a ``quantity`` of `UNITS` is in SI units; InputError if unknown."""
    known = UNITS[quantity]
    if not isinstance(unit, str) or unit not in known:
        found = "none" if unit is None else repr(unit)
        raise InputError(f"{where}: expected a unit of {', '.join(known)}, found {found}")
    return known[unit]
