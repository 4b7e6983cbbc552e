"""Residuals of a recording beside those of its own simulation, in assumed sigmas.

The papers' model is fitted to the moving samples with the declared noise; then a recording is
simulated from the fitted motion and positions, with that noise and the same rails, and fitted
likewise. Where the model holds, the two are alike.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from imuarray.engine.parameters import model_of
from imuarray.model.array_model import Prediction
from imuarray.recording import Recording
from imuarray.simulation.recordings import clip, measure
from imuarray_papers.estimation.identifiability import Calibration
from imuarray_papers.estimation.newton import calibrate_gauss_newton
from imuarray_papers.measured.positions import LIMIT

# The shape of the picture, not the positions' last micrometre, is wanted.
TOLERANCE = 0.05
BINS = 8


def fit_residuals(recording: Recording) -> tuple[Calibration, Prediction]:
    """The papers' model with the declared noise, fitted to all samples; standardised residuals.

    At a gyroscope's rail a residual is NaN.
    """
    model, saturated = model_of(recording), recording.saturated_gyroscopes()
    found = calibrate_gauss_newton(
        model, recording.specific_force, recording.angular_rate, saturated=saturated,
        position_prior=(model.array.parameters, recording.position_prior_sd), tolerance=TOLERANCE,
        limit=LIMIT,
    )  # fmt: skip
    predicted = model.predict_many(found.motion.motion, found.positions)
    force = (recording.specific_force - predicted.specific_force) / recording.accelerometer_noise_sd
    rate = (recording.angular_rate - predicted.angular_rate) / recording.gyroscope_noise_sd
    return found, Prediction(force, np.where(saturated, np.nan, rate))


def simulate_like(recording: Recording, fit: Calibration, rng) -> Recording:
    """The recording as the papers' model would have given it, with its rails and noise."""
    model = model_of(recording)
    force, rate, _ = measure(
        model, fit.motion.motion, fit.positions, rng, gyroscope_range=recording.gyroscope_range
    )
    return replace(
        recording, specific_force=clip(force, recording.accelerometer_range)[0], angular_rate=rate,
        specific_force_saturated=None, angular_rate_saturated=None,
        title="simulated from the fitted motion",
    )  # fmt: skip


def residual_summary(fit: Calibration, residuals: Prediction, recording: Recording, source: str):
    """Rms of each triad's residuals, in sigmas, in bins of |omega_dot|.

    Rows have source, quantity, triad, bin_low, bin_high (rad/s^2), rms.
    """
    size = np.linalg.norm(fit.motion.motion.angular_acceleration, axis=1)
    edges, rows = np.quantile(size, np.linspace(0, 1, BINS + 1)), []
    place = np.clip(np.searchsorted(edges, size, side="right") - 1, 0, BINS - 1)
    for quantity, kind in (("specific_force", "accelerometer"), ("angular_rate", "gyroscope")):
        for k, label in enumerate(getattr(recording, f"{kind}_labels")):
            for b in range(BINS):
                values = getattr(residuals, quantity)[place == b, k]
                values = values[np.isfinite(values)]
                rms = np.sqrt(np.mean(values**2)) if values.size else np.nan
                rows.append((source, quantity, label, edges[b], edges[b + 1], rms))
    names = ["source", "quantity", "triad", "bin_low", "bin_high", "rms"]
    return pd.DataFrame(rows, columns=names)


def compare(recording: Recording, rng) -> pd.DataFrame:
    """`residual_summary` of the recording and of its simulation."""
    fit, residuals = fit_residuals(recording)
    simulated = simulate_like(recording, fit, rng)
    measured = residual_summary(fit, residuals, recording, "measured")
    again = residual_summary(*fit_residuals(simulated), simulated, "simulated")
    return pd.concat([measured, again], ignore_index=True)
