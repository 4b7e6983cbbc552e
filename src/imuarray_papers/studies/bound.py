"""The Cramer-Rao bound of the positions: who reaches it, how fast, and what it depends on."""

from dataclasses import replace

import numpy as np
import pandas as pd

from imuarray.geometry import Array, sub_array
from imuarray.linear import scaled_eigh
from imuarray.model import ArrayModel
from imuarray.model.structure import products
from imuarray.motion import normal_motion, sphere_motion
from imuarray.streams import stream
from imuarray_papers.estimation.bcd import calibrate_bcd
from imuarray_papers.estimation.collapsed import Collapsed
from imuarray_papers.estimation.information import arms, information_at
from imuarray_papers.estimation.newton import fisher_scoring
from imuarray_papers.studies.settings import SETTINGS
from imuarray_papers.studies.truths import in_batches, realisations, root_mean_square, run_batches


def block_information(model: ArrayModel, motion) -> np.ndarray:
    """Information were the motion known: what a step of ML-BCD assumes."""
    state = np.zeros((12, len(motion.angular_rate)))
    state[:6], state[6:9] = (
        products(motion.angular_rate).T,
        np.asarray(motion.angular_acceleration).T,
    )
    stacked = arms(state)[1:].reshape(3, -1)
    return np.kron(np.diag(model.noise.triad_weights), stacked @ stacked.T)[3:, 3:]


def contraction(known, assumed) -> float:
    """By what factor ML-BCD's slowest error shrinks in an iteration, near the optimum.

    The largest squared canonical correlation of positions and motion: one less the smallest
    eigenvalue of the information with the motion unknown against that with it known.
    """
    values = np.linalg.eigvals(np.linalg.solve(assumed, known)).real
    return float(1.0 - values.min())


def rms_width(known) -> float:
    """rms over coordinates of the bound's sds, m."""
    return float(np.sqrt(np.trace(np.linalg.inv(known)) / len(known)))


def widths(model: ArrayModel, seed, names, samples: int, sizes, count: int) -> np.ndarray:
    """`rms_width` (count,), m, for random motions of the magnitudes ``sizes``.

    The motions are those of the streams (seed, names, number), the same with every model.
    """
    motions = (sphere_motion(stream(seed, *names, k), (samples,), *sizes) for k in range(count))
    return np.array([rms_width(information_at(model, m, model.array.relative)) for m in motions])


def _draw(model, rng, samples, motion, options):
    """(motion, truth, forces, rates, saturated) of a realisation."""
    given = options["position_sd"], options["rail"]
    moves, *rest = realisations(model, rng, 1, samples, motion, *given)
    return moves.select(0), *(part[0] for part in rest)


def efficiency(
    model: ArrayModel, seed, sample_counts, motion, options, threads=1, quiet=True, noise=1.0
) -> pd.DataFrame:
    """RMSE of the most likely positions, with and without a prior, against the bound; a row per N.

    Noise is ``noise`` times the model's, and estimators know it. ``motion`` and ``options`` as
    `studies.position_error` has them. ``bound_m`` is the rms of each realisation's own
    bound (with the prior: of the linearised posterior's sds), and ``ratio`` the root of the mean
    of e' I e / P over realisations, e the P errors and I the information: 1 for an efficient
    estimator, in every direction, whatever the motion.
    """
    rows, model = [], replace(model, noise=model.noise.times(noise))
    for samples in sample_counts:

        def batch(rng, size, samples=samples):
            return [[_one(model, rng, samples, motion, options) for _ in range(size)]]

        names = ("bound", samples, str(noise))
        # (realisations, estimators, columns)
        [found] = in_batches(batch, seed, names, options["realisations"], threads, quiet)
        for place, name in enumerate(("maximum likelihood", "with the prior")):
            square, bound, quadratic, iterations, converged = found[:, place].T
            rmse, error = root_mean_square(square)
            ratio, ratio_se = root_mean_square(quadratic)
            rows.append(
                {"samples": samples, "noise": noise, "estimator": name, "rmse_m": rmse,
                 "rmse_se_m": error, "bound_m": float(np.sqrt(np.mean(bound))), "ratio": ratio,
                 "ratio_se": ratio_se,
                 "realisations": len(found), "iterations_max": int(iterations.max()),
                 "not_converged": int(np.sum(converged == 0))}
            )  # fmt: skip
    return pd.DataFrame(rows)


def _one(model, rng, samples, motion, options):
    """Squared error and bound (m^2), e' I e / P, iterations, converged: without, with a prior."""
    moves, truth, force, rate, saturated = _draw(model, rng, samples, motion, options)
    data = Collapsed.of(model, force, rate, saturated)
    size = truth[1:].size
    # errors of r_k - r_1 are correlated: the reference triad's is in all of them
    spread = options["position_sd"] ** 2 * (np.eye(size) + np.tile(np.eye(3), (size // 3,) * 2))
    prior = model.array.parameters, np.linalg.inv(spread)
    known = information_at(model, moves, truth, saturated)
    out = []
    for given in (None, prior):
        found = fisher_scoring(
            data, model.array.relative, given, limit=SETTINGS.patience, covariance=False
        )
        error = (found.positions - truth)[1:].ravel()
        whole = known if given is None else known + given[1]
        out.append([
            np.mean(error**2), np.trace(np.linalg.inv(whole)) / size, error @ whole @ error / size,
            len(found.cost) - 1, found.converged,
        ])  # fmt: skip
    return np.array(out, float)


def convergence(
    model: ArrayModel, seed, samples, motions, options, count=5, threads=1
) -> pd.DataFrame:
    """Iterations of ML-BCD and of Gauss-Newton to 1.01 times the bound, for each motion.

    A row for each of ``count`` realisations. ``contraction`` is what the information predicts for
    ML-BCD, ``observed`` what its steps show; iterations beyond the limits are NaN.
    """

    def job(which):
        number, repeat = which
        rng, motion = stream(seed, "bound", "convergence", number, repeat), motions[number]
        moves, truth, force, rate, saturated = _draw(model, rng, samples, motion, options)
        known = information_at(model, moves, truth, saturated)
        bound, bcd, newton, observed = descents(model, force, rate, saturated, options["limit"])
        return {
            "array": model.array.name,
            "angular_rate_dps": np.degrees(motion[0]),
            "angular_acceleration_dps2": np.degrees(motion[1]),
            "samples": samples,
            "bound_m": bound,
            "bcd_iterations": bcd,
            "newton_iterations": newton,
            "contraction": contraction(known, block_information(model, moves)),
            "limit": options["limit"],
            "observed": observed,
        }

    jobs = [(number, repeat) for number in range(len(motions)) for repeat in range(count)]
    return pd.DataFrame(run_batches(job, jobs, threads, True, "convergence"))


def rate_seen(bound, marks, away) -> float:
    """The factor by which ML-BCD's last steps shrink its distance ``away`` at ``marks``."""
    # not so far that rounding is what is left
    floor = max(1e-3 * bound, 10 * away.min())
    late = np.flatnonzero((away < 0.3 * away[0]) & (away > floor))
    if len(late) < 2:
        return np.nan
    first, last = late[len(late) // 2], late[-1]
    return float((away[last] / away[first]) ** (1 / max(marks[last] - marks[first], 1)))


def descents(model: ArrayModel, force, rate, saturated, limit: int = SETTINGS.bcd_limit):
    """ML-BCD and Gauss-Newton from the nominal positions to the optimum, on the same measurements.

    The bound (m, rms), iterations of each to 1.01 times it, NaN if never, and `rate_seen`.
    """
    data = Collapsed.of(model, force, rate, saturated)
    best = fisher_scoring(data, model.array.relative)
    bound = np.sqrt(np.trace(best.covariance) / len(best.covariance))
    if not best.converged:  # data that determine too little: there is no way to go
        return bound, np.nan, np.nan, np.nan
    # distance from the optimum, errors adding in squares
    enough = bound * np.sqrt(SETTINGS.near**2 - 1)
    marks = np.unique(np.geomspace(1, limit, 1000).astype(int))
    slow = calibrate_bcd(
        model, force, rate, saturated=saturated, tolerance=0.0, limit=limit, marks=marks
    )
    away = np.sqrt(np.mean((slow.snapshots - best.positions)[:, 1:] ** 2, axis=(1, 2)))
    near = np.flatnonzero(away <= enough)
    newton = np.nan
    for iteration in range(1, SETTINGS.scoring_limit + 1):
        tried = fisher_scoring(data, model.array.relative, limit=iteration, covariance=False)
        if np.sqrt(np.mean((tried.positions - best.positions)[1:] ** 2)) <= enough:
            newton = iteration
            break
    bcd = marks[near[0]] if len(near) else np.nan
    return bound, bcd, newton, rate_seen(bound, marks, away)


def against_size(model: ArrayModel, seed, samples, motion, factors, count=20) -> pd.DataFrame:
    """The bound for arrays of the same shape, ``factors`` times as large; a row for each."""
    rows = []
    for factor in factors:
        array = model.array
        scaled = Array(factor * array.positions, array.labels, array.gyroscopes, array.name)
        larger = ArrayModel(scaled, model.noise)
        found = widths(larger, seed, ("bound", "size"), samples, motion, count)
        extent = float(np.linalg.norm(np.ptp(scaled.relative, axis=0)))
        bound = float(np.sqrt(np.mean(np.square(found))))
        rows.append(
            {"factor": factor, "extent_m": extent, "bound_m": bound, "relative": bound / extent}
        )
    return pd.DataFrame(rows)


def ranks(cases) -> pd.DataFrame:
    """Rank and conditioning of the information; ``cases`` of (name, model, motion)."""
    rows = []
    for name, model, motion in cases:
        known = information_at(model, motion, model.array.relative)
        # a coordinate of which nothing is known must not be scaled up to something
        scale = np.sqrt(np.maximum(np.diag(known), SETTINGS.rank * np.diag(known).max()))
        values = scaled_eigh(known, scale).values
        informed = values > SETTINGS.rank * values[-1]
        rows.append(
            {"case": name, "samples": len(motion.angular_rate), "unknowns": len(known),
             "rank": int(informed.sum()), "condition": float(values[-1] / values[informed][0])}
        )  # fmt: skip
    return pd.DataFrame(rows)


def isotropic(model: ArrayModel, accelerometer=1.0, gyroscope=1.0, array=None) -> ArrayModel:
    """The model with its noise sds times two factors, of its array or of another."""
    sds = model.noise.accelerometer[0, 0] ** 0.5, model.noise.gyroscope[0, 0] ** 0.5
    return ArrayModel.isotropic(array or model.array, accelerometer * sds[0], gyroscope * sds[1])


def geometries(model: ArrayModel) -> dict[str, ArrayModel]:
    """Other arrays with the noise of ``model``: fewer triads, all in one plane, half the size."""
    array, counts = model.array, [n for n in (3, 4, 8) if n < model.array.accelerometers]
    arrays = [replace(sub_array(array, n), name=f"{n} triads") for n in counts]
    for name, factor in (("all triads in one plane", [1.0, 1.0, 0.0]), ("half the size", 0.5)):
        arrays.append(Array(array.positions * factor, array.labels, array.gyroscopes, name))
    return {other.name: isotropic(model, array=other) for other in arrays}


def rank_cases(model: ArrayModel, seed, sphere, normal) -> list[tuple]:
    """(name, model, motion) of what may and may not determine the positions.

    ``sphere``: magnitudes as in paper 2017; ``normal``: sds as in paper 2021.
    """
    rng = stream(seed, "bound", "ranks")
    many = normal_motion(rng, (50,), *normal)
    axis, still = np.array([0.0, 0.6, 0.8]), np.zeros((50, 3))
    rate, acceleration = (field[:, 2:] * axis for field in many[:2])
    motions = {f"general motion, N = {n}": normal_motion(rng, (n,), *normal) for n in (1, 2, 3, 5)}
    motions |= {
        "the papers' magnitudes": sphere_motion(rng, (50,), *sphere),
        "omega_dot = 0": many._replace(angular_acceleration=still),
        "omega = 0": many._replace(angular_rate=still),
        "turned about one axis": many._replace(
            angular_rate=rate, angular_acceleration=acceleration
        ),
        "about one axis, omega_dot free": many._replace(angular_rate=rate),
    }
    cases = [(name, model, motion) for name, motion in motions.items()]
    return cases + [(name, other, many) for name, other in geometries(model).items()]


def bound_table(model, seed, cases) -> pd.DataFrame:
    """RMSE bound for each (samples, |omega|, |omega_dot|, |s|) in ``cases`` (SI units)."""
    rows = []
    for number, (samples, *sizes) in enumerate(cases):
        rng = stream(seed, "position bound", number)
        squares = []  # mean variance over coordinates for each of the motions
        for _ in range(SETTINGS.repeats):
            motion = sphere_motion(rng, (samples,), *sizes)
            values = np.linalg.eigvalsh(information_at(model, motion, model.array.relative))
            squares.append(np.mean(1.0 / np.maximum(values, 1e-14 * values[-1])))
        bound, error = root_mean_square(squares)
        rows.append(
            {
                "samples": samples,
                "angular_rate_dps": np.degrees(sizes[0]),
                "angular_acceleration_dps2": np.degrees(sizes[1]),
                "bound_m": bound,
                "bound_se_m": error,
            }  # fmt: skip
        )
    return pd.DataFrame(rows)
