"""Measured data against the model: positions, agreement between recordings, residuals."""
