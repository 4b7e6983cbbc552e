"""Simulated measurements and recordings, from the one measurement model."""
