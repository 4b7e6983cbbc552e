"""All effects by name: ``EFFECTS[id].draw(scene, rng, sensors, size)`` gives a `Change`.

Ids of the catalogue are those of the project's list; ``outside_`` ones are not in it, ``gauge_``
ones can not be told from a clean recording.
"""

from __future__ import annotations

from imuarray.blind import errors, gauge, noise, outside, timing
from imuarray.blind.change import EFFECTS, Change, Effect, Pair, noiseless_readings, noisy_readings

MODULES = (errors, timing, noise, outside, gauge)

GAUGE = tuple(name for name in EFFECTS if name.startswith("gauge_"))
OUTSIDE = tuple(name for name in EFFECTS if name.startswith("outside_"))
CATALOGUE = tuple(name for name in EFFECTS if name not in GAUGE + OUTSIDE)

__all__ = [
    "CATALOGUE",
    "EFFECTS",
    "GAUGE",
    "OUTSIDE",
    "Change",
    "Effect",
    "Pair",
    "draw",
    "noiseless_readings",
    "noisy_readings",
]


def draw(scene, effect: str, rng, sensors, size: float) -> Change:
    """Draw the parameters of an effect; the same state of ``rng`` gives the same directions.

    Raises ValueError for an unknown effect or for sensors that are not different indices.
    """
    if effect not in EFFECTS:
        raise ValueError(f"effect: expected one of {', '.join(EFFECTS)}, found {effect!r}")
    return EFFECTS[effect].draw(scene, rng, sensors, size)
