"""Recordings of an array: NetCDF-4 files, read with validation."""

from imuarray.recording.format import (
    has_truth,
    load_dataset,
    read_recording,
    read_truth,
    write_recording,
)
from imuarray.recording.record import Recording, array_of
