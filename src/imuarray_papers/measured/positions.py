"""Measured recordings of one board: positions, residuals, agreement between recordings."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from scipy.special import ndtri

from imuarray.model import ArrayModel
from imuarray.model.structure import product_slopes
from imuarray.recording import Recording, array_of
from imuarray.simulation.recordings import simulate_samples
from imuarray_papers.estimation.bcd import calibrate_bcd
from imuarray_papers.estimation.collapsed import Collapsed
from imuarray_papers.estimation.newton import calibrate_gauss_newton
from imuarray_papers.posterior.proposals import rate_distribution

TOLERANCE = 1e-3  # of a position's own sd
LIMIT = 500  # large residuals make Gauss-Newton converge linearly


@dataclass(frozen=True)
class Positions:
    """MAP positions of a recording's samples with p(omega | y_g) from (30a) and (30b).

    ``mean`` (A, 3) m relative to the reference triad, ``covariance`` (3 (A - 1),) squared,
    ``accelerometer_sd`` what was assumed, ``residual_sd`` what the residuals say (m/s^2).
    """

    mean: np.ndarray
    covariance: np.ndarray
    accelerometer_sd: float
    residual_sd: float
    converged: bool
    iterations: int

    @property
    def sd(self) -> np.ndarray:
        """Sds of r_2 ... r_A, (A - 1, 3) m."""
        return np.sqrt(np.diag(self.covariance)).reshape(-1, 3)


def locate(recording: Recording, accelerometer_sd: float | None = None) -> Positions:
    """Posterior mode and its Gaussian width; sigma_a estimated from the residual where None.

    The motion is estimated with the positions, omega with the prior N((30a), (30b)) of each
    sample (the declared noise where there are fewer than 4 gyroscopes); the positions have the
    recording's prior. With sigma_a = None the estimate is repeated with the residual's own size
    until that no longer changes by 1 %.
    """
    if accelerometer_sd is not None:
        return _locate(recording, accelerometer_sd)
    # from above: with a small sigma_a the gyroscopes' spread, not the data, sets the fit
    assumed, start = max(recording.accelerometer_noise_sd, 0.5), None
    for _ in range(20):
        found = _locate(recording, assumed, start)
        start = found.mean
        if abs(found.residual_sd / assumed - 1) < 0.01:
            break
        assumed = found.residual_sd
    return found


def _fit(recording: Recording, assumed: float, start=None):
    """(model with one gyroscope, mean and covariance of its rates, `Calibration`)."""
    mean, covariance = rate_distribution(recording)
    model = ArrayModel.isotropic(array_of(recording, 1), assumed, recording.gyroscope_noise_sd)
    found = calibrate_gauss_newton(
        model, recording.specific_force, mean[:, None], start=start, tolerance=TOLERANCE,
        limit=LIMIT, position_prior=(model.array.parameters, recording.position_prior_sd),
        rate_covariance=covariance,
    )  # fmt: skip
    return model, mean, covariance, found


def _locate(recording, assumed, start=None) -> Positions:
    model, mean, covariance, found = _fit(recording, assumed, start)
    motion, force = found.motion.motion, recording.specific_force
    residual = force - model.predict_many(motion, found.positions).specific_force
    # the motion uses up 9 degrees of freedom a sample, less what the prior of omega supplies
    prior, slope = np.linalg.inv(covariance), product_slopes(motion.angular_rate)
    reduced, _ = Collapsed.of(model, force, mean[:, None]).reduce(found.positions)
    known = prior + np.einsum("tai,ab,tbj->tij", slope, reduced.C, slope)
    supplied = np.einsum("tij,tji->", np.linalg.inv(known), prior)
    freedom = residual.size - (9 * len(known) - float(supplied))
    sd = float(np.sqrt(np.sum(residual**2) / (freedom - found.positions[1:].size)))
    return Positions(
        found.positions, found.covariance, assumed, sd, found.converged, len(found.cost)
    )


def bcd_positions(recording: Recording, accelerometer_sd: float) -> Positions:
    """ML-BCD of the 2017 paper on the same samples; gyroscopes with the spread among them.

    Without widths, which it does not give: NaN.
    """
    _, covariance = rate_distribution(recording)
    spread = float(np.sqrt(np.mean(np.einsum("tii->ti", covariance))))
    array = array_of(recording)
    model = ArrayModel.isotropic(array, accelerometer_sd, spread)
    saturated = recording.saturated_gyroscopes()
    found = calibrate_bcd(
        model, recording.specific_force, recording.angular_rate, saturated=saturated,
        tolerance=1e-8, limit=20000,
    )  # fmt: skip
    unknown = np.full((found.positions[1:].size,) * 2, np.nan)
    return Positions(
        found.positions, unknown, accelerometer_sd, np.nan, found.converged, len(found.cost)
    )


def coordinate_table(labels, means, sds, **columns) -> pd.DataFrame:
    """One row a coordinate: ``columns``, then accelerometer, axis, mean_m, sd_m; (A, 3) m each."""
    return pd.DataFrame({
        **columns, "accelerometer": np.repeat(labels, 3), "axis": list("xyz") * len(labels),
        "mean_m": np.ravel(means), "sd_m": np.ravel(sds),
    })  # fmt: skip


def pairwise(table: pd.DataFrame) -> pd.DataFrame:
    """z-scores of the differences between recordings, one row a pair and coordinate.

    ``table`` has recording, accelerometer, axis, mean_m and sd_m. Were the claimed widths
    right, z would be standard normal: the board's positions are the same in all recordings.
    """
    wide = table.set_index(["accelerometer", "axis", "recording"])[["mean_m", "sd_m"]].unstack()
    parts = []
    for one, other in combinations(sorted(table.recording.unique()), 2):
        difference = wide["mean_m"][one] - wide["mean_m"][other]
        width = np.hypot(wide["sd_m"][one], wide["sd_m"][other])
        part = pd.DataFrame({"difference_m": difference, "sd_m": width, "z": difference / width})
        parts.append(part.reset_index().assign(recording=one, other=other))
    return pd.concat(parts, ignore_index=True)


def agreement(pairs: pd.DataFrame, table: pd.DataFrame) -> dict:
    """Coverage of 50 and 95 % intervals of the differences, rms z, claimed and real spread.

    ``spread_m`` is the sd between recordings, pooled over coordinates (rms); errors of the
    shares are not given, as pairs share recordings and coordinates share a motion.
    """
    size = pairs.z.abs()
    groups = table.groupby(["accelerometer", "axis"])
    return {
        "recordings": int(table.recording.nunique()),
        "coverage_50": float(np.mean(size < ndtri(0.75))),
        "coverage_95": float(np.mean(size < ndtri(0.975))),
        "z_rms": float(np.sqrt(np.mean(pairs.z**2))),
        "spread_m": float(np.sqrt(groups.mean_m.var(ddof=1).mean())),
        "claimed_m": float(np.sqrt(np.mean(table.sd_m**2))),
    }


def simulate_subset(recording: Recording, accelerometer_sd: float, rng):
    """The samples as the model would have given them: (recording, truth dataset).

    Motion and positions are those of `locate`; accelerometers get the noise that the analysis
    assumes (paper 2021, section IV-C), gyroscopes that which the recording declares.
    """
    *_, found = _fit(recording, accelerometer_sd)
    whole = array_of(recording)
    return simulate_samples(
        ArrayModel.isotropic(whole, accelerometer_sd, recording.gyroscope_noise_sd),
        found.motion.motion, found.positions, recording.accelerometer_position, rng,
        position_prior_sd=recording.position_prior_sd, title=f"simulated like {recording.title}",
    )  # fmt: skip


def locate_table(recording: Recording, sigmas, /, **columns) -> pd.DataFrame:
    """`coordinate_table` for each of ``sigmas``, for the estimated sigma_a, and of ML-BCD.

    Columns ``method`` (map, bcd), ``assumed`` (a number as text, or residual),
    ``accelerometer_sd``, ``residual_sd`` (m/s^2), ``converged``, ``iterations``, and
    ``nominal_m``. Too few samples leave the residual no freedom: that row is then left out.
    """
    ways = [("map", locate, assumed) for assumed in [*sigmas, None]]
    parts = []
    for method, locating, assumed in [*ways, ("bcd", bcd_positions, sigmas[-1])]:
        found = locating(recording, assumed)
        parts.append(coordinate_table(
            recording.accelerometer_labels[1:], found.mean[1:], found.sd, **columns, method=method,
            assumed="residual" if assumed is None else f"{assumed:g}",
            accelerometer_sd=found.accelerometer_sd, residual_sd=found.residual_sd,
            converged=found.converged, iterations=found.iterations,
        ))  # fmt: skip
    table = pd.concat(parts, ignore_index=True)
    nominal = recording.relative_positions()[1:].ravel()
    return table.assign(nominal_m=np.tile(nominal, len(parts)))
