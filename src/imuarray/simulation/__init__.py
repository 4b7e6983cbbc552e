"""Simulated measurements and recordings, from the one measurement model."""

from imuarray.simulation.measure import clip, measure
from imuarray.simulation.recordings import simulate_recording, simulate_samples

__all__ = ["clip", "measure", "simulate_recording", "simulate_samples"]
