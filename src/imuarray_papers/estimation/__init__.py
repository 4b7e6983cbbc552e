"""Positions and motion under the papers' model, compiled: ML-BCD and Gauss-Newton."""
