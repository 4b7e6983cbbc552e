"""Gyroscopes at their rail: what a lost reading still tells, and where to search from."""

from __future__ import annotations

import numpy as np


def contradiction(predicted, angular_rate, saturated, sd) -> np.ndarray:
    """How far predictions fall short of lost readings, (T,): sum of squares, in sds.

    A reading at its rail says that the rate is there or beyond, on that side. ``predicted`` and
    ``angular_rate`` (T, G, 3) rad/s, ``saturated`` (T, G, 3) bool, ``sd`` (G, 3) rad/s.
    """
    short = np.sign(angular_rate) * (angular_rate - predicted)
    return np.sum(np.where(saturated, np.maximum(short, 0.0) / sd, 0.0) ** 2, axis=(1, 2))


def at_rail(angular_rate, saturated) -> np.ndarray:
    """The mean of each axis' lost readings, (T, 3) rad/s; zero where none is lost."""
    count = np.maximum(saturated.sum(axis=1), 1)
    return np.where(saturated, angular_rate, 0.0).sum(axis=1) / count


def turned(rate, angular_rate, saturated) -> np.ndarray:
    """``rate`` (T, 3) rad/s, its lost axes on the side of their readings and not below them."""
    rail = at_rail(angular_rate, saturated)
    beyond = np.sign(rail) * np.maximum(np.abs(rate), np.abs(rail))
    return np.where(saturated.any(axis=1), beyond, rate)


def better(one, other) -> np.ndarray:
    """(T,) bool: which samples of ``one`` to replace by ``other``, both (cost (T,), found (T,)).

    One that was found goes before one that was not, then the lower cost.
    """
    return np.where(one[1] == other[1], other[0] < one[0], other[1])
