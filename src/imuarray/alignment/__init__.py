"""Loose IMUs' own logs as one recording: rotations, clocks, readings on common instants."""

from imuarray.alignment.align import align
from imuarray.alignment.found import Alignment
