"""Residuals of a recording beside those of its own simulation, in assumed sigmas.

The papers' model is fitted to the moving samples with the declared noise; then a recording is
simulated from the fitted motion and positions, with that noise and the same rails, and fitted
likewise. Where the model holds, the two are alike.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from imuarray.estimation.newton import calibrate_gauss_newton
from imuarray.model import ArrayModel
from imuarray.motion import Motion
from imuarray.recording import Recording, array_of
from imuarray.simulation.recordings import clip, measure
from imuarray_papers.measured.positions import LIMIT

# The shape of the picture, not the positions' last micrometre, is wanted.
TOLERANCE = 0.05
BINS = 8


@dataclass(frozen=True)
class Residuals:
    """Standardised residuals of one fit: (T, A, 3), (T, G, 3), and the estimated motion.

    At a gyroscope's rail the residual is NaN. ``positions`` (A, 3) m.
    """

    specific_force: np.ndarray
    angular_rate: np.ndarray
    motion: Motion
    positions: np.ndarray
    converged: bool


def fit_residuals(recording: Recording) -> Residuals:
    """Fit the papers' model with the recording's declared noise to all its samples."""
    array = array_of(recording)
    sds = recording.accelerometer_noise_sd, recording.gyroscope_noise_sd
    model = ArrayModel.isotropic(array, *sds)
    saturated = recording.saturated_gyroscopes()
    found = calibrate_gauss_newton(
        model, recording.specific_force, recording.angular_rate, saturated=saturated,
        position_prior=(array.parameters, recording.position_prior_sd), tolerance=TOLERANCE,
        limit=LIMIT,
    )  # fmt: skip
    motion = found.motion.motion
    predicted = model.predict_many(motion, found.positions)
    rate = (recording.angular_rate - predicted.angular_rate) / sds[1]
    return Residuals(
        (recording.specific_force - predicted.specific_force) / sds[0],
        np.where(saturated, np.nan, rate), motion, found.positions, found.converged,
    )  # fmt: skip


def simulate_like(recording: Recording, fit: Residuals, rng) -> Recording:
    """The recording as the papers' model would have given it, with its rails and noise."""
    sds = recording.accelerometer_noise_sd, recording.gyroscope_noise_sd
    model = ArrayModel.isotropic(array_of(recording), *sds)
    force, rate, _ = measure(
        model, fit.motion, fit.positions, rng, gyroscope_range=recording.gyroscope_range
    )
    return replace(
        recording, specific_force=clip(force, recording.accelerometer_range)[0], angular_rate=rate,
        specific_force_saturated=None, angular_rate_saturated=None,
        title="simulated from the fitted motion",
    )  # fmt: skip


def residual_summary(fit: Residuals, recording: Recording, source: str) -> pd.DataFrame:
    """Per sensor and axis, and in bins of |omega| and |omega_dot|: rms and quantiles, in sigmas.

    Rows have source, quantity, by (axis, angular_rate, angular_acceleration), triad, axis,
    bin_low, bin_high (rad/s or rad/s^2), rms, q05, q50, q95.
    """
    rows = []
    for quantity in ("specific_force", "angular_rate"):
        values = getattr(fit, quantity)
        kind = "accelerometer" if quantity == "specific_force" else "gyroscope"
        for k, label in enumerate(getattr(recording, f"{kind}_labels")):
            for i, axis in enumerate("xyz"):
                rows.append((quantity, "axis", label, axis, np.nan, np.nan, values[:, k, i]))
        for by in ("angular_rate", "angular_acceleration"):
            size = np.linalg.norm(getattr(fit.motion, by), axis=1)
            edges = np.quantile(size, np.linspace(0, 1, BINS + 1))
            place = np.clip(np.searchsorted(edges, size, side="right") - 1, 0, BINS - 1)
            for b in range(BINS):
                for k, label in enumerate(getattr(recording, f"{kind}_labels")):
                    chosen = values[place == b, k]
                    rows.append((quantity, by, label, "all", edges[b], edges[b + 1], chosen))
    names = ["quantity", "by", "triad", "axis", "bin_low", "bin_high"]
    table = pd.DataFrame([row[:-1] for row in rows], columns=names)
    table.insert(0, "source", source)
    return table.assign(**_sizes([row[-1] for row in rows]))


def _sizes(samples) -> dict[str, list[float]]:
    finite = [x[np.isfinite(x)] for x in samples]
    quantiles = [np.quantile(x, [0.05, 0.5, 0.95]) if x.size else [np.nan] * 3 for x in finite]
    return {
        "rms": [float(np.sqrt(np.mean(x**2))) if x.size else np.nan for x in finite],
        **{name: [float(q[i]) for q in quantiles] for i, name in enumerate(("q05", "q50", "q95"))},
    }


def histogram(fit: Residuals, source: str, reach: float = 300.0) -> pd.DataFrame:
    """Density of the standardised residuals: source, quantity, low, high, density."""
    parts = []
    for quantity in ("specific_force", "angular_rate"):
        values = getattr(fit, quantity)
        values = values[np.isfinite(values)]
        # fine about zero, where the simulation is, and coarse far out
        half = np.concatenate([np.linspace(0, 10, 21), np.geomspace(10, reach, 30)[1:]])
        counts, edges = np.histogram(values, np.concatenate([-half[:0:-1], half]))
        density = counts / values.size / np.diff(edges)
        parts.append(pd.DataFrame({"source": source, "quantity": quantity, "low": edges[:-1],
                                   "high": edges[1:], "density": density}))  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def compare(recording: Recording, rng) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(`residual_summary`, `histogram`) of the recording and of its simulation."""
    fit = fit_residuals(recording)
    simulated = simulate_like(recording, fit, rng)
    again = fit_residuals(simulated)
    pairs = ((fit, recording, "measured"), (again, simulated, "simulated"))
    summaries = [residual_summary(one, data, source) for one, data, source in pairs]
    shapes = [histogram(one, source) for one, _, source in pairs]
    return pd.concat(summaries, ignore_index=True), pd.concat(shapes, ignore_index=True)
