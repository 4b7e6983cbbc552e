"""The positions' posterior linearised at the truth, and what the printed determinant does to it.

One Gauss-Newton step from the truth with prior: Gaussian, no chains. Good where the posterior
is narrow; it is what the claims fall back on where the chains are too short to have converged.
"""

import numpy as np
import pandas as pd

from imuarray.diagnosis.fit import at
from imuarray.engine.derivatives import no_derivatives
from imuarray.engine.linearise import State
from imuarray.engine.parameters import columns_of
from imuarray.engine.readings import measured
from imuarray.geometry import positions_of
from imuarray.model import ArrayModel
from imuarray.model.structure import design
from imuarray.motion import Motion
from imuarray_papers.measured.positions import coordinate_table
from imuarray_papers.posterior.likelihood import Likelihood


def linearise(recording, truth, model, accelerometer_sd, gyroscopes: int):
    """Mean error (3 (A - 1),) m and covariance of the posterior linearised at the truth.

    ``accelerometer_sd`` is what the analysis assumes, ``gyroscopes`` the number whose average
    p(omega | y_g) stands for: (30b) is the covariance of one.
    """
    motion = np.hstack([truth[name].to_numpy() for name in Motion._fields[:3]])
    positions, array = truth["position"].to_numpy(), model.array
    rate_sd = np.sqrt(model.noise.gyroscope[0, 0] * array.gyroscopes / gyroscopes)
    assumed = ArrayModel.isotropic(array, accelerometer_sd, float(rate_sd))
    readings = measured(assumed, recording.specific_force, recording.angular_rate)
    columns = columns_of(array, (), recording.position_prior_sd)
    nothing = no_derivatives(len(motion), len(positions))
    state = State(motion, positions, np.empty(0), nothing)
    information, score = at(readings, columns, columns.owner, state).normal(columns.owner)
    weight = recording.position_prior_sd**-2.0
    pull = weight * (recording.relative_positions() - positions)[1:].ravel()
    covariance = np.linalg.inv(information + weight * np.eye(len(information)))
    return covariance @ (score + pull), covariance


def coordinates(recording, truth, model, accelerometer_sd, gyroscopes, name) -> pd.DataFrame:
    """Per coordinate: truth, mean and sd (m) of the linearised posterior called ``name``."""
    error, covariance = linearise(recording, truth, model, accelerometer_sd, gyroscopes)
    labels, true = recording.accelerometer_labels[1:], truth["position"].to_numpy()[1:].ravel()
    table = coordinate_table(labels, true + error, np.sqrt(np.diag(covariance)), name=name)
    table.insert(3, "truth_m", true)
    return table


def log_gram_gradient(theta, precision) -> np.ndarray:
    """Derivative of log |H' Lambda H| in theta (3 (A - 1),)."""
    positions = positions_of(theta)
    H = design(positions)[:, 6:]
    back = precision @ H @ np.linalg.inv(H.T @ precision @ H)  # (3A, 6)
    slopes = design(np.eye(3))[:, 6:].reshape(3, 3, 6) - design(np.zeros((1, 3)))[:, 6:]
    return 2 * np.einsum("icx,kcx->ki", slopes, back.reshape(-1, 3, 6))[1:].ravel()


def log_gram_hessian(theta, precision, step=1e-6) -> np.ndarray:
    """Second derivative of log |H' Lambda H|, by central differences of the gradient."""
    rows = [
        (log_gram_gradient(theta + shift, precision) - log_gram_gradient(theta - shift, precision))
        / (2 * step)
        for shift in step * np.eye(theta.size)
    ]
    return 0.5 * (np.array(rows) + np.array(rows).T)


def determinant_effect(covariance, theta, samples: int, precision) -> dict:
    """Change of a posterior when |H' Lambda H| stands without its root, as (25) prints it."""
    information = np.linalg.inv(covariance)
    gradient = -0.5 * samples * log_gram_gradient(theta, precision)
    changed = information + 0.5 * samples * log_gram_hessian(theta, precision)
    proper = bool(np.linalg.eigvalsh(changed)[0] > 0)
    shift = np.linalg.solve(changed, gradient)
    sd = np.sqrt(np.diag(covariance))
    widths = np.sqrt(np.abs(np.diag(np.linalg.inv(changed)))) / sd
    along = gradient / np.sqrt(gradient @ covariance @ gradient)
    return {
        "shift_max_sd": float(np.abs(shift / sd).max()),
        "shift_rms_sd": float(np.sqrt(np.mean((shift / sd) ** 2))),
        "shift_along_sd": float(along @ shift),
        "width_ratio_min": float(widths.min()), "width_ratio_max": float(widths.max()),
        "proper": proper,
    }  # fmt: skip


def determinant_by_sampling(recording, truth, model, rng, count=4000, draws=64) -> dict:
    """The determinant's effect by importance sampling of the exact posterior, for a small array."""
    gyroscopes, sd = model.array.gyroscopes, np.sqrt(model.noise.accelerometer[0, 0])
    error, covariance = linearise(recording, truth, model, sd, gyroscopes)
    positions = truth["position"].to_numpy()
    centre, factor = positions[1:].ravel() + error, 1.3 * np.linalg.cholesky(covariance)
    prior = recording.relative_positions()[1:].ravel()
    normals = rng.standard_normal((count, centre.size))
    thetas = centre + normals @ factor.T
    likelihoods = [Likelihood.of(model, recording.specific_force, recording.angular_rate,
                                 determinant=name) for name in ("derived", "printed")]  # fmt: skip
    logs = np.empty((2, count))
    seeds = rng.integers(0, 2**63, count)
    for row, likelihood in enumerate(likelihoods):
        for i, theta in enumerate(thetas):
            places = positions_of(theta)
            # the same draws for both, so that only the determinant differs
            logs[row, i] = likelihood.estimate(places, draws, np.random.default_rng(seeds[i]))
    logs += 0.5 * np.sum(normals**2, axis=1)
    logs -= 0.5 * np.sum((thetas - prior) ** 2, axis=1) / recording.position_prior_sd**2
    weights = np.exp(logs - logs.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    means = weights @ thetas
    sds = np.sqrt(weights @ thetas**2 - means**2)
    shift = (means[1] - means[0]) / sds[0]
    return {
        "shift_max_sd": float(np.abs(shift).max()),
        "shift_rms_sd": float(np.sqrt(np.mean(shift**2))),
        "width_ratio_min": float((sds[1] / sds[0]).min()),
        "width_ratio_max": float((sds[1] / sds[0]).max()),
        "effective": float(1 / np.sum(weights[0] ** 2)), "draws": count,
    }  # fmt: skip
