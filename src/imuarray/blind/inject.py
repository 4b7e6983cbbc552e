"""All effects by name: ``EFFECTS[id].draw(scene, rng, sensors, size)`` gives a `Change`.

Ids of the catalogue are those of the project's list; ``outside_`` ones are not in it, ``gauge_``
ones can not be distinguished from a clean recording.
"""

from imuarray.blind import errors, gauge, noise, outside, timing  # noqa: F401  (they register)
from imuarray.blind.change import EFFECTS

GAUGE = tuple(name for name in EFFECTS if name.startswith("gauge_"))
OUTSIDE = tuple(name for name in EFFECTS if name.startswith("outside_"))
CATALOGUE = tuple(name for name in EFFECTS if name not in GAUGE + OUTSIDE)
