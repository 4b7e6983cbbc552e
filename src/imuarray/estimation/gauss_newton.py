"""Positions of the papers' model by Gauss-Newton in collapsed form, with their covariance."""

from dataclasses import replace

import numpy as np

from imuarray.errors import IdentifiabilityError
from imuarray.estimation.bcd import Calibration, arranged, require_rotation
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.information import information_at
from imuarray.estimation.newton import fisher_scoring
from imuarray.linear import FLOOR, scaled_eigh, scaled_inverse
from imuarray.model import ArrayModel


def calibrate_gauss_newton(
    model: ArrayModel,
    specific_force,
    angular_rate,
    start=None,
    saturated=None,
    position_prior=None,
    rate_covariance=None,
    tolerance: float = 1e-6,
    limit: int = 50,
) -> Calibration:
    """ML (or MAP) positions of the papers' model, with their covariance (`newton.fisher_scoring`).

    Parameters
    ----------
    start : (A, 3) m or None for the nominal positions
    position_prior : None, or (mean (3 (A - 1),), sd) in metres
    rate_covariance : None, or (T, 3, 3) (rad/s)^2
        Of an array's one gyroscope, instead of the model's noise; say that of (30b).
    tolerance : float
        Stop when no position moves by more than this many of its own sds.

    Raises
    ------
    IdentifiabilityError, InputError
        As `calibrate_bcd`, and where the information of the positions is singular.
    """
    data, positions = arranged(model, specific_force, angular_rate, start, saturated)
    if position_prior is not None:
        mean, sd = np.asarray(position_prior[0], float), position_prior[1]
        position_prior = mean, np.diag(np.broadcast_to(sd, mean.shape) ** -2.0)
    found = fisher_scoring(
        data if rate_covariance is None else data.with_rates(rate_covariance), positions,
        position_prior, tolerance, limit,
    )  # fmt: skip
    require_rotation([data], found.positions)
    return replace(found, cost=found.cost + apart(model, data, angular_rate, saturated))


def apart(model: ArrayModel, data: Collapsed, angular_rate, saturated=None) -> float:
    """How the gyroscopes differ among themselves, which the collapsed cost leaves out."""
    spread = angular_rate - data.mean.T[:, None]
    nothing = np.zeros((len(spread), 3 * model.array.accelerometers))
    return model.noise.misfit(nothing, spread, saturated)


def parameter_covariance(model: ArrayModel, found: Calibration, saturated=None) -> np.ndarray:
    """Covariance (P, P) of r_2 ... r_A at an ML estimate: the Fisher information's inverse.

    IdentifiabilityError where that information is singular.
    """
    known = information_at(model, found.motion.motion, found.positions, saturated)
    values, vectors, _ = scaled_eigh(known)
    if not values[0] > FLOOR:
        weak = np.flatnonzero(np.abs(vectors[:, 0]) > 0.3)
        raise IdentifiabilityError(
            "calibration: expected informative motion, found a direction of the positions"
            f" (components {weak.tolist()}) that the data do not determine; the motion is too poor"
        )
    return scaled_inverse(known)
