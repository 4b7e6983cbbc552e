"""Positions of the papers' model by Gauss-Newton in collapsed form, with their covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imuarray.errors import IdentifiabilityError, InputError, require_shape
from imuarray.estimation.bcd import Calibration, require_rotation, require_samples
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.information import information_at
from imuarray.estimation.newton import fisher_scoring
from imuarray.geometry.array import require_planar_extent
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
    IdentifiabilityError
        As `calibrate_bcd`, and where the information of the positions is singular.
    InputError
        For effects, which `imuarray.calibrate` takes, and for noise that is not one sd for each
        accelerometer triad.
    """
    if model.effects or model.noise.triad_weights is None:
        raise InputError(
            "model: expected the papers', with one noise sd for each accelerometer triad, found"
            f" {', '.join(model.effects) or 'a covariance'}"
        )
    require_samples(len(specific_force))
    positions = model.array.relative if start is None else np.asarray(start, float)
    require_shape("start", positions, model.array.positions.shape)
    positions = positions - positions[0]
    require_planar_extent(positions, "positions")
    data = Collapsed.of(model, specific_force, angular_rate, saturated)
    require_rotation(data, positions)
    if position_prior is not None:
        mean, sd = np.asarray(position_prior[0], float), position_prior[1]
        position_prior = mean, np.diag(np.broadcast_to(sd, mean.shape) ** -2.0)
    found = fisher_scoring(
        data if rate_covariance is None else with_rates(data, rate_covariance), positions,
        position_prior, tolerance, limit,
    )  # fmt: skip
    # the collapsed cost leaves out how the gyroscopes differ among themselves
    spread = angular_rate - data.mean.T[:, None]
    apart = model.noise.misfit(np.zeros((len(spread), 3 * len(positions))), spread, saturated)
    require_rotation(data, found.positions)
    return replace(found, cost=found.cost + apart)


def with_rates(data: Collapsed, covariance) -> Collapsed:
    """The same with the covariance (T, 3, 3) (rad/s)^2 of each sample's angular rate."""
    require_shape("rate_covariance", np.asarray(covariance), (data.samples, 3, 3))
    precision = np.linalg.inv(covariance)
    return replace(data, gyroscope_information=np.ascontiguousarray(precision.transpose(1, 2, 0)))


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
