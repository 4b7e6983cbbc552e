"""The algebra and the estimator of paper 2021, III-B, and the tuning rules of III-C, on numbers."""

import math

import numpy as np
from scipy.optimize import minimize
from scipy.special import ndtr

from imuarray.geometry import Array
from imuarray.model import ArrayModel
from imuarray.model.structure import design, products
from imuarray.motion import normal_motion
from imuarray.simulation.recordings import measure
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray_papers.reference import (
    draw_rates,
    linear_part,
    log_likelihood,
    nonlinear_part,
    projection,
)

TINY = np.array(
    [[0.0, 0.0, 0.0], [0.021, 0.002, -0.001], [-0.001, 0.019, 0.003], [0.017, 0.02, 0.002]]
)


def tiny_model(accelerometer_sd: float, gyroscope_sd: float) -> ArrayModel:
    """Four triads some 2 cm apart and one gyroscope; sds in m/s^2 and rad/s."""
    array = Array(TINY.copy(), tuple("1234"), 1, "tiny")
    return ArrayModel.isotropic(array, accelerometer_sd, gyroscope_sd)


def _density(y, positions, rate, precision, prior, beta):
    """Quadratic form and log |M| of (18) for phi ~ N(f, beta F), by (20) and (21), and M."""
    mean, covariance = prior
    whole = design(positions)
    B, H = whole[:, :6], whole[:, 6:]
    Q = np.linalg.inv(precision)
    inner = np.linalg.inv(covariance) / beta + H.T @ precision @ H
    inverse = precision - precision @ H @ np.linalg.solve(inner, H.T @ precision)
    parts = inner, beta * covariance, Q
    logdet = sum(np.linalg.slogdet(part)[1] for part in parts)
    off = y - B @ products(rate) - H @ mean
    return off @ inverse @ off, logdet, Q + beta * H @ covariance @ H.T, inverse


def limits(rng, model, sds) -> dict:
    """SH = 0, (20), (21), and the limits (23) and (24) as beta grows.

    ``sds``: |omega|, omega_dot and s sds in SI units for F_t and the data.
    """
    positions, precision = model.array.relative, model.noise.accelerometer_precision
    motion = normal_motion(rng, (1,), *sds)
    force, rate, _ = measure(model, motion, positions, rng)
    covariance = np.diag(np.repeat(np.square(sds[1:]), 3))
    prior = (np.sqrt(np.diag(covariance)) * rng.standard_normal(6), covariance)
    H = linear_part(positions)
    S, logdet_gram = projection(positions, model.noise.accelerometer)
    plain = force[0].ravel() - nonlinear_part(rate[0].mean(axis=0), positions)
    final = plain @ S @ plain
    common = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(precision)[1]
    table = []
    for beta in np.geomspace(1e-3, 1e7, 11):
        square, logdet, M, _ = _density(force[0].ravel(), positions, rate[0].mean(axis=0),
                                        precision, prior, beta)  # fmt: skip
        rest = logdet - common - 6 * np.log(beta) - logdet_gram
        table.append([beta, abs(square - final) / final, abs(np.expm1(rest))])
    _, logdet, M, inverse = _density(plain, positions, rate[0].mean(axis=0), precision, prior, 1e-3)
    return {
        "SH_relative": float(np.abs(S @ H).max() / np.abs(precision @ H).max()),
        "rank_S": int(np.linalg.matrix_rank(S / precision[0, 0], tol=1e-9)), "size": len(S),
        "inverse_identity": float(np.abs(inverse @ M - np.eye(len(M))).max()),
        "determinant_identity": float(abs(logdet - np.linalg.slogdet(M)[1])),
        "beta_quadratic_determinant": table,
    }  # fmt: skip


def determinant_power(rng, model, sds, beta=1e6, pairs=200) -> dict:
    """Power of 1 / |H' Lambda H| in the normalised density (19), from pairs of theta.

    Regression of the density's change beyond the exponent on that of log |H' Lambda H|.
    """
    positions, precision = model.array.relative, model.noise.accelerometer_precision
    covariance = np.diag(np.repeat(np.square(sds[1:]), 3))
    gram, beyond = [], []
    for _ in range(pairs):
        moved = positions + 1e-3 * rng.standard_normal(positions.shape)
        H = design(moved)[:, 6:]
        gram.append(np.linalg.slogdet(H.T @ precision @ H)[1])
        M = np.linalg.inv(precision) + beta * H @ covariance @ H.T
        beyond.append(-0.5 * np.linalg.slogdet(M)[1])
    slope, offset = np.polyfit(gram, beyond, 1)
    misfit = np.abs(np.array(beyond) - slope * np.array(gram) - offset).max()
    return {"power": float(-slope), "misfit": float(misfit), "pairs": pairs}


def six_dimensions(rng, model, sds, samples=20, draws=8) -> dict:
    """The collapsed estimate (6 numbers a sample) against (26a) written out in 3A numbers."""
    positions, covariance = model.array.relative, model.noise.accelerometer
    force, rate, _ = measure(model, normal_motion(rng, (samples,), *sds), positions, rng)
    likelihood = Likelihood.of(model, force, rate)
    rates = draw_rates(rate, np.sqrt(model.noise.gyroscope[0, 0]), draws, rng)
    direct = log_likelihood(force, positions, covariance, rates)
    seen = projection(positions, covariance)[0] @ design(positions)[:, :6]
    weak = np.linalg.svd(seen, compute_uv=False)
    return {
        "difference": float(abs(likelihood.on(positions, rates) - direct)),
        "value": float(direct), "dimensions": int(np.sum(weak > 1e-9 * weak[0])),
        "full": 3 * len(positions),
    }  # fmt: skip


def log_sum_exp(rng, count=200) -> dict:
    """(31)/(32) against exact summation, near zero and far from it."""
    worst = 0.0
    for level in (0.0, -800.0, -1e5, 800.0):
        for _ in range(count // 4):
            values = level + 5 * rng.standard_normal(50)
            exact = values.max() + math.log(math.fsum(np.exp(values - values.max())))
            recursive = np.logaddexp.reduce(values)  # (32), one after the other
            worst = max(worst, abs(recursive - exact) / max(1.0, abs(exact)))
    return {"worst_relative": worst, "sums": count}


def underflow(rng, model, force, rate, places: dict, draws: int = 100) -> list[dict]:
    """Plain sums of exponentials of (26) over ``draws`` of omega that are 0, at each place.

    ``force`` (T, A, 3) and ``rate`` (T, G, 3) measured; ``places`` (A, 3) m by name. One sum
    a sample; ``median_exponent`` is over samples and draws.
    """
    rows, rates = [], draw_rates(rate, np.sqrt(model.noise.gyroscope[0, 0]), draws, rng)
    for name, positions in places.items():
        S, _ = projection(positions, model.noise.accelerometer)
        off = force.reshape(len(force), 1, -1) - nonlinear_part(rates, positions)
        exponents = -0.5 * np.sum((off @ S) * off, axis=-1)
        lost = int(np.sum(np.exp(exponents).sum(axis=1) == 0.0))
        rows.append({"place": name, "fails": lost, "sums": len(force),
                     "median_exponent": float(np.median(exponents))})  # fmt: skip
    return rows


def quadrature(model, positions, force, rate, motion, order=7, sds=(1e4, 1e3)) -> float:
    """log p(y_a | theta), constants left out as (26) does, by Gauss-Hermite over omega.

    Shares nothing with the estimator: no flat prior and no S. phi has a wide prior, ``sds`` for
    omega_dot and s, around the true ``motion``, so y_a given omega is plainly normal with
    covariance Q + H F H'. That prior's width changes the result by less than 1e-5.
    """
    x, w = np.polynomial.hermite_e.hermegauss(order)
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    weights = np.multiply.outer(np.multiply.outer(w, w), w).ravel() / w.sum() ** 3
    turning = [np.cross(axis, positions).ravel() for axis in np.eye(3)]
    H = np.stack([*turning, *(np.tile(axis, len(positions)) for axis in np.eye(3))], axis=1)
    Q, F = model.noise.accelerometer, np.diag(np.repeat(np.square(sds), 3))
    M = Q + H @ F @ H.T
    constant = 0.5 * np.dot([1, 1, -1], [np.linalg.slogdet(part)[1] for part in (F, Q, M)])
    sd, total = np.sqrt(model.noise.gyroscope[0, 0] / rate.shape[1]), 0.0
    for t in range(len(force)):
        nodes = (rate[t].mean(axis=0) + sd * grid)[:, None]
        phi = np.concatenate([motion.angular_acceleration[t], motion.specific_force[t]])
        turned = np.cross(nodes, np.cross(nodes, positions)).reshape(len(grid), -1)
        off = force[t].ravel() - turned - H @ phi
        logs = -0.5 * np.sum(off * np.linalg.solve(M, off.T).T, axis=1)
        total += constant + logs.max() + np.log(weights @ np.exp(logs - logs.max()))
    return float(total)


def unbiased(rng, count: int, draws=(1, 2, 4, 8, 16, 32)) -> list[dict]:
    """Mean and variance of p-hat over realisations, relative to p by `quadrature`."""
    model = tiny_model(0.04, np.radians(0.06))
    positions = model.array.relative
    motion = normal_motion(rng, (2,), np.radians(1000.0), np.radians(35000.0), 20.0)
    force, rate, _ = measure(model, motion, positions, rng)
    likelihood = Likelihood.of(model, force, rate)
    level, rows = quadrature(model, positions, force, rate, motion), []
    for number in draws:
        logs = likelihood.realisations(positions, number, count, rng) - level
        ratio = np.exp(logs)
        error = ratio.std(ddof=1) / np.sqrt(count)
        rows.append({"draws": number, "mean_ratio": ratio.mean(), "mean_se": error,
                     "relative_variance": ratio.var(ddof=1), "log_mean": logs.mean(),
                     "log_variance": logs.var(ddof=1), "realisations": count})  # fmt: skip
    return rows


def effective_draws(rng, model, sds, draws=4000, repeats=20) -> dict:
    """Kish's effective number of ``draws``, median over samples, for three estimators of p(y_t).

    naive (10): all motion from its prior; conditioned: omega from p(omega | y_g), the rest
    from its prior; Rao-Blackwellised (26): the rest integrated.
    """
    positions, force_sd = model.array.relative, np.sqrt(model.noise.accelerometer[0, 0])
    rate_sd = np.sqrt(model.noise.gyroscope[0, 0] / model.array.gyroscopes)
    H, (S, _) = linear_part(positions), projection(positions, model.noise.accelerometer)
    scale = np.repeat(sds[1:], 3)
    found = {"naive": [], "conditioned": [], "rao_blackwellised": []}
    for _ in range(repeats):
        force, rate, _ = measure(model, normal_motion(rng, (1,), *sds), positions, rng)
        y, centre = force[0].ravel(), rate[0].mean(axis=0)
        wide = sds[0] * rng.standard_normal((draws, 3))
        near = centre + rate_sd * rng.standard_normal((draws, 3))
        rest = scale * rng.standard_normal((draws, 6))
        for name, rates in (("naive", wide), ("conditioned", near)):
            off = y - nonlinear_part(rates, positions) - rest @ H.T
            logs = -0.5 * np.sum(off**2, axis=1) / force_sd**2
            if name == "naive":
                logs -= 0.5 * np.sum((rates - centre) ** 2, axis=1) / rate_sd**2
            found[name].append(_kish(logs))
        off = y - nonlinear_part(near, positions)
        found["rao_blackwellised"].append(_kish(-0.5 * np.einsum("ni,ij,nj->n", off, S, off)))
    return {"draws": draws} | {name: float(np.median(values)) for name, values in found.items()}


def _kish(logs) -> float:
    weights = np.exp(logs - logs.max())
    return float(weights.sum() ** 2 / np.sum(weights**2))


def theory() -> dict:
    """Best acceptance of a random walk with exact and with noisy log density.

    Acceptance 2 Phi(-sqrt(l^2 + 2 v) / 2) for scaled step l and variance v of the log
    estimate (Sherlock et al.); jump l^2 x acceptance, cost of an estimate 1 / v.
    """

    def acceptance(step, variance):
        return 2 * ndtr(-0.5 * np.sqrt(step**2 + 2 * variance))

    exact = minimize(lambda x: -2 * x[0] - np.log(acceptance(np.exp(x[0]), 0.0)), [0.5],
                     method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13})  # fmt: skip
    noisy = minimize(
        lambda x: -2 * x[0] - x[1] - np.log(acceptance(np.exp(x[0]), np.exp(x[1]))), [0.5, 0.5],
        method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13},
    )  # fmt: skip
    step, variance = np.exp(noisy.x)
    return {
        "acceptance": float(acceptance(np.exp(exact.x[0]), 0.0)),
        "noisy_variance": float(variance), "noisy_acceptance": float(acceptance(step, variance)),
    }  # fmt: skip


def best_acceptance(rng, size: int, repeats=4) -> dict:
    """Acceptance at the largest mean squared jump of a random walk on N(0, I), ``size`` dims."""
    found = [_best_of_walks(rng, size) for _ in range(repeats)]
    error = np.std(found, ddof=1) / np.sqrt(repeats)
    return {"acceptance": float(np.mean(found)), "se": float(error), "size": size}


def _best_of_walks(rng, size, chains=150, steps=40, points=13) -> float:
    scaled = np.geomspace(0.8, 6.0, points)
    rates, jumps = [], []
    for length in scaled / np.sqrt(size):
        state = rng.standard_normal((chains, size))
        moved, jump = 0, 0.0
        for _ in range(steps):
            change = length * rng.standard_normal((chains, size))
            gain = -np.sum(change * (state + 0.5 * change), axis=1)
            taken = np.log(rng.random(chains)) < gain
            jump += np.sum(change[taken] ** 2)
            state[taken] += change[taken]
            moved += taken.sum()
        rates.append(moved / (chains * steps))
        jumps.append(jump)
    # a parabola through the top smooths the Monte Carlo noise of the maximum
    order = np.argsort(jumps)[-5:]
    fit = np.polyfit(np.log(scaled[order]), np.log(np.array(jumps)[order]), 2)
    best = np.exp(-fit[1] / (2 * fit[0]))
    return float(np.interp(best, scaled, rates))
