"""Offsets that drift: a random walk, known at one instant."""

import numpy as np


def shared_walk(time) -> np.ndarray:
    """(P, P) s, how long a walk both ways from time 0 is the same at each two of ``time`` (P,)."""
    return np.where(np.multiply.outer(time, time) > 0, np.minimum.outer(abs(time), abs(time)), 0.0)
