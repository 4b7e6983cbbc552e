"""Recordings with an injected effect, to test a diagnosis by somebody who did not write it.

Nothing here shares code with the measurement model, the simulation or the estimators: the
rigid-body formula, its derivatives and every effect are written out once more.
"""

from imuarray.blind.cases import Case, Truth, make
from imuarray.blind.inject import CATALOGUE, EFFECTS, GAUGE, OUTSIDE
from imuarray.blind.matrix import matrix
from imuarray.blind.measured import inject_measured
from imuarray.blind.scene import Scene
from imuarray.blind.sizes import scale_to, size_of, total_size

__all__ = [
    "CATALOGUE",
    "EFFECTS",
    "GAUGE",
    "OUTSIDE",
    "Case",
    "Scene",
    "Truth",
    "inject_measured",
    "make",
    "matrix",
    "scale_to",
    "size_of",
    "total_size",
]
