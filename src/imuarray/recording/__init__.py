"""Recordings of an array: NetCDF-4 files, read with validation."""

from imuarray.recording.format import (
    Recording,
    read_recording,
    read_truth,
    write_recording,
)

__all__ = ["Recording", "read_recording", "read_truth", "write_recording"]
