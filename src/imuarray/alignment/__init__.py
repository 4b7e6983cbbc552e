"""Loose IMUs' own logs as one recording: rotations, clocks, readings on common instants."""

from imuarray.alignment.align import Alignment, align

__all__ = ["Alignment", "align"]
