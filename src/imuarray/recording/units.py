"""The spellings of units that recordings and tables may use, and what each is in SI units."""

import math

import numpy as np

from imuarray.errors import require
from imuarray.recording.settings import SETTINGS

GRAVITY = 9.80665  # m/s^2, the unit g of data sheets
_DEGREE = math.pi / 180
# The first of each is SI, and what is written.
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "0.1 ms": 1e-4},
    "length": {"m": 1.0, "mm": 1e-3},
    "force": {"m s-2": 1.0, "m/s^2": 1.0, "m/s2": 1.0, "g": GRAVITY, "mg": 1e-3 * GRAVITY},
    "rate": {
        "rad s-1": 1.0, "rad/s": 1.0, "deg s-1": _DEGREE, "deg/s": _DEGREE, "dps": _DEGREE,
        "mdeg/s": 1e-3 * _DEGREE, "mdps": 1e-3 * _DEGREE,
    },
}  # fmt: skip
SI = {quantity: next(iter(known)) for quantity, known in UNITS.items()}


def require_plausible_rate(time, where: str, declared: object = "") -> None:
    """InputError for stamps (T,) s that no IMU makes: a unit; ``declared``: theirs, if known."""
    steps = np.abs(np.diff(time))
    steps = steps[steps > 0]
    if not steps.size:
        return
    step = float(np.median(steps))
    # the unit in which they would be plausible, from the last one that they were taken to be in
    units = UNITS["time"]
    right = [u for u, size in units.items() if 1e-4 <= step * size / units.get(declared, 1.0) < 0.2]
    hint = f"are they in {right[0]}" if right else "is their unit right"
    hint += f", declared {declared}?" if declared and right else "?"
    usual = 1 / SETTINGS.fastest <= step <= 1 / SETTINGS.slowest
    expected = f"stamps of {SETTINGS.slowest:g} to {SETTINGS.fastest:g} samples a second"
    require(usual, where, expected, f"{1 / step:.3g} over {np.ptp(time):.6g} s; {hint}")


def factor(quantity: str, unit: object, where: str) -> float:
    """One ``unit`` of a ``quantity`` of `UNITS` in SI units; InputError if unknown."""
    known = UNITS[quantity]
    found = "none" if unit is None else repr(unit)
    right = isinstance(unit, str) and unit in known
    require(right, where, f"a unit of {', '.join(known)}", found)
    return known[unit]
