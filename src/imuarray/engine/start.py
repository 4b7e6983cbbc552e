"""Where a fit begins: nominal positions, no effects, the motion that the readings say."""

import numpy as np

from imuarray.engine.derivatives import no_derivatives, polynomial_derivative
from imuarray.engine.linearise import State
from imuarray.engine.parameters import Columns
from imuarray.engine.readings import Readings
from imuarray.engine.settings import SETTINGS
from imuarray.engine.turning import turned
from imuarray.errors import InputError
from imuarray.model.structure import design, products


def start(readings: Readings, columns: Columns) -> State:
    """The state of no effects: omega the gyroscopes' median, omega_dot and s by least squares.

    Of two IMUs the rate's change is a prior of omega_dot; InputError where samples are too few.
    """
    positions = readings.array.relative
    used = readings.keep[..., 3:]
    rate = np.nanmedian(np.where(used, readings.values[..., 3:], np.nan), axis=1)
    linear = _linear_motion(readings, positions, rate)
    motion = np.concatenate([rate, linear], axis=1)
    parameters = np.zeros(columns.model.effect_size)
    found = State(motion, positions, parameters, no_derivatives(len(motion), len(positions)))
    if not readings.pair:
        return found
    if not readings.gapless:
        raise InputError(
            "recording: expected samples that follow each other, of two IMUs, found too few: the"
            " rate's change from sample to sample is their angular acceleration"
        )
    found = turned(readings, found)
    return found._replace(motion=np.hstack([rate, found.turning.mean, linear[:, 3:]]))


def _linear_motion(readings, positions, rate) -> np.ndarray:
    """omega_dot and s (T, 6) of the accelerometers off their rails, given omega."""
    count = len(positions)
    both = design(positions)
    force = readings.values[:, :count, :3].reshape(len(rate), -1)
    weight = readings.weights[:, :count, :3].reshape(len(rate), -1)
    target = weight * (force - products(rate) @ both[:, :6].T)
    matrix = weight[..., None] * both[None, :, 6:]
    left = np.swapaxes(matrix, 1, 2) @ matrix
    if readings.pair:
        left += 1e-9 * np.trace(left, axis1=1, axis2=2)[:, None, None] * np.eye(6)
    right = np.einsum("tri,tr->ti", matrix, target)
    return np.linalg.solve(left, right[..., None])[..., 0]


def is_smooth(readings: Readings, motion) -> bool:
    """Whether neighbouring samples determine its derivatives: omega's slope is omega_dot."""
    slope = polynomial_derivative(readings.time, readings.run, motion[:, :3], readings.window, 1)
    return bool(np.corrcoef(slope.ravel(), motion[:, 3:6].ravel())[0, 1] > SETTINGS.smooth)
