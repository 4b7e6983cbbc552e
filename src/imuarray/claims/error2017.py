"""Paper 2017, figures 4 and 5: the error of the calibrated positions."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from imuarray.claims.numbers import listed, power_law, ratio, rises, show
from imuarray.claims.registry import Outcome, claim, judge

SAMPLES = "calibration/position_error_samples"
MOTION = "calibration/position_error_motion"


def _curve(results, iterations=None):
    """RMSE over N after ``iterations``, or after the most there are."""
    table = results.table(SAMPLES)
    return table[table.iterations == (iterations or table.iterations.max())].sort_values("samples")


def _exponent(results):
    """Exponent of RMSE against N >= 10, its error, and a remark on that for N >= 3.

    Below N = 10 too many runs stop at the last iteration without having converged.
    """
    curve = _curve(results)
    every, late = curve[curve.samples >= 3], curve[curve.samples >= 10]
    fits = [power_law(c.samples, c.rmse_m, c.rmse_se_m) for c in (late, every)]
    shares = [100 * c.converged_share.min() for c in (late, every)]
    remark = (
        f"at least {show(shares[0])} % of the runs converged for each N >= 10; over N >= 3"
        f" {show(fits[1][0])} +- {show(fits[1][1], 2)}, where as few as {show(shares[1])} % have"
    )
    return *fits[0], remark


@claim(
    "2017-01",
    "IV",
    "With enough iterations and N > 2 the RMSE falls as the inverse root of N.",
    "exponent -1/2",
    "exponent fitted over N >= 10 within max(0.05, 3 errors) of -1/2",
)
def inverse_root(results):
    slope, error, late = _exponent(results)
    return Outcome(
        show(slope), show(error, 2), judge(abs(slope + 0.5) <= max(0.05, 3 * error)), late
    )


@claim(
    "2017-02",
    "abstract",
    "The position error is inversely proportional to the number of samples.",
    "exponent -1",
    "exponent of the RMSE over N >= 10 within max(0.05, 3 errors) of -1",
)
def inverse(results):
    slope, error, _ = _exponent(results)
    remark = (
        "the abstract's word is right for the variance, not for the error; section IV says -1/2"
    )
    return Outcome(
        show(slope), show(error, 2), judge(abs(slope + 1) <= max(0.05, 3 * error)), remark
    )


@claim(
    "2017-03",
    "V",
    "The variance of the positions falls with the inverse of the number of samples.",
    "exponent -1",
    "exponent of RMSE^2 over N >= 10 within max(0.1, 3 errors) of -1",
)
def variance_inverse(results):
    slope, error, _ = _exponent(results)
    stands = abs(2 * slope + 1) <= max(0.1, 6 * error)
    return Outcome(show(2 * slope), show(2 * error, 2), judge(stands))


@claim(
    "2017-04",
    "abstract, V",
    "1000 samples at 2000 deg/s and 2000 deg/s^2 give an accuracy of the order of 1e-6 m.",
    "order of 1e-6 m",
    "RMSE at N = 1000 within a factor sqrt(10) of 1e-6 m",
)
def micrometre(results):
    row = _curve(results).set_index("samples").loc[1000]
    stands = 1e-6 / np.sqrt(10) <= row.rmse_m <= 1e-6 * np.sqrt(10)
    return Outcome(f"{show(row.rmse_m)} m", f"{show(row.rmse_se_m, 2)} m", judge(stands))


@claim(
    "2017-05",
    "IV",
    "For two samples the RMSE does not decrease with more iterations.",
    "no decrease",
    "last RMSE / first RMSE not below 1 by more than 3 errors",
)
def two_samples(results):
    table = results.table(SAMPLES)
    two = table[table.samples == 2].sort_values("iterations")
    first, last = two.iloc[0], two.iloc[-1]
    value, error = ratio(last.rmse_m, last.rmse_se_m, first.rmse_m, first.rmse_se_m)
    remark = (
        f"RMSE {show(first.rmse_m)} m after {first.iterations:.0f}, {show(last.rmse_m)} m after"
        f" {last.iterations:.0f} iterations; {100 * last.converged_share:.0f} % of the runs had"
        " converged by then: slower than for N > 2, and heavy-tailed"
    )
    return Outcome(show(value), show(error, 2), judge(value >= 1 - 3 * error), remark)


@claim(
    "2017-06",
    "IV",
    "Two samples leave the calibration ill posed: further conditions are needed.",
    "not well posed at N = 2",
    "joint information at N = 2, motion unknown, is rank deficient",
)
def two_ill_posed(results):
    ranks = results.table("claims/ranks")
    two = ranks[ranks.samples == 2]
    deficient = int(np.sum(two["rank"] < two.unknowns))
    bound = results.table("claims/position_bound").iloc[0]
    remark = (
        f"Cramer-Rao bound at N = 2: {show(bound.bound_m)} +- {show(bound.bound_se_m, 2)} m; slow"
        " convergence, not a missing condition, keeps the RMSE up"
    )
    return Outcome(f"{deficient} of {len(two)} arrays deficient", "", judge(deficient > 0), remark)


@claim(
    "2017-07",
    "IV",
    "For more than two samples the RMSE decreases with the number of iterations.",
    "decreases",
    "no step up by more than 3 errors, and last < first by 3 errors, for each N > 2",
)
def more_iterations(results):
    table = results.table(SAMPLES)
    worst, up = 0.0, 0
    for _, curve in table[table.samples > 2].groupby("samples"):
        curve = curve.sort_values("iterations")
        up += rises(curve.rmse_m, curve.rmse_se_m)
        a, b = curve.iloc[-1], curve.iloc[0]
        value, error = ratio(a.rmse_m, a.rmse_se_m, b.rmse_m, b.rmse_se_m)
        worst = max(worst, value + 3 * error)
    text = f"largest (last / first + 3 errors) {show(worst)}; {up} steps up"
    return Outcome(text, "in the value", judge(up == 0 and worst < 1))


@claim(
    "2017-08",
    "IV",
    "For more than two samples the RMSE decreases with the number of samples.",
    "decreases",
    "no step up by more than 3 errors over N > 2 after the most iterations",
)
def more_samples(results):
    curve = _curve(results)
    curve = curve[curve.samples > 2]
    up = rises(curve.rmse_m, curve.rmse_se_m)
    falls = curve.rmse_m.iloc[-1] < curve.rmse_m.iloc[0]
    few = _curve(results, results.table(SAMPLES).iterations.min())
    spread = few.rmse_m.max() / few.rmse_m.min()
    remark = (
        f"not so after the first iteration, where all N agree within a factor {show(spread, 2)}"
    )
    value = f"{listed(curve.rmse_m)} m for N = {listed(curve.samples, 4)}"
    return Outcome(value, f"{listed(curve.rmse_se_m, 2)} m", judge(up == 0 and falls), remark)


def _grid(table, along, across):
    """Steps up along a column of figure 5's grid, and where they start."""
    up, where = 0, []
    for level, line in table.groupby(across):
        line = line.sort_values(along)
        found = rises(line.rmse_m, line.rmse_se_m)
        up += found
        where += [show(level, 6)] if found else []
    return up, where


def _bound_falls(results, along, across) -> int:
    """Steps up of the Cramer-Rao bound over the same grid."""
    bound = results.table("claims/position_bound")
    grid = bound[bound.samples == results.settings["paper2017"]["fig5_samples"]].iloc[1:]
    lines = [line.sort_values(along) for _, line in grid.groupby(grid[across].round(3))]
    return sum(rises(line.bound_m, line.bound_se_m) for line in lines)


@claim(
    "2017-09",
    "IV, figure 5",
    "Faster rotation gives a smaller position error.",
    "decreases",
    "no step up by more than 3 errors along angular rate, N = 10, 200 iterations",
)
def faster_rotation(results):
    names = ("angular_rate_dps", "angular_acceleration_dps2")
    table = results.table(MOTION)
    up, where = _grid(table, *names)
    remark = f"at {', '.join(where)} deg/s^2; " if where else ""
    remark += f"the Cramer-Rao bound itself goes up in {_bound_falls(results, *names)} steps"
    value = f"{up} of {len(table) - table[names[1]].nunique()} steps go up"
    return Outcome(value, "3 errors a step", judge(up == 0), remark)


def _beyond(table, limit) -> str:
    """What our rows of figure 5 at accelerations above ``limit`` (deg/s^2) do: a remark."""
    levels = {a: row.set_index("angular_rate_dps")
              for a, row in table.groupby("angular_acceleration_dps2")}  # fmt: skip
    text, near = "", levels[max(a for a in levels if a <= limit)]
    for level in (a for a in levels if a > limit):
        row = levels[level]
        higher = row.rmse_m - near.rmse_m > 3 * np.hypot(row.rmse_se_m, near.rmse_se_m)
        worse = (row.rmse_m / near.rmse_m)[higher]
        text += f"; our extension to {show(level, 6)} deg/s^2, not judged: "
        text += (
            f"the RMSE is {listed(worse)} times larger at {listed(worse.index, 6)} deg/s, where"
            f" {100 * row.converged_share[worse.index].mean():.0f} % of the runs have converged"
            " after 200 iterations"
            if len(worse)
            else "no step up"
        )
    return text


@claim(
    "2017-10",
    "IV, figure 5",
    "Faster angular acceleration gives a smaller position error.",
    "decreases",
    "no step up by more than 3 errors along angular acceleration up to hand motion (35 000"
    " deg/s^2, paper 2021), N = 10, 200 iterations",
)
def faster_acceleration(results):
    names = ("angular_acceleration_dps2", "angular_rate_dps")
    whole = results.table(MOTION)
    hand = results.settings["paper2021"]["angular_acceleration_sd_dps2"]
    table = whole[whole.angular_acceleration_dps2 <= hand]
    up, where = _grid(table, *names)
    remark = (
        (f"at {', '.join(where)} deg/s; " if where else "")
        + "figure 5's axes are not in the text; the Cramer-Rao bound goes up in"
        f" {_bound_falls(results, *names)} steps of our whole grid" + _beyond(whole, hand)
    )
    value = f"{up} of {len(table) - table[names[1]].nunique()} steps go up"
    return Outcome(value, "3 errors a step", judge(up == 0), remark)


@claim(
    "2017-11",
    "IV",
    "The magnitude of the translational acceleration does not affect the accuracy.",
    "no effect",
    "RMSE at all magnitudes equal: chi-square p-value above 0.001",
)
def translation(results):
    table = results.table("calibration/position_error_force")
    weight = table.rmse_se_m**-2.0
    mean = np.sum(weight * table.rmse_m) / weight.sum()
    statistic = float(np.sum(weight * (table.rmse_m - mean) ** 2))
    p = float(chdtrc(len(table) - 1, statistic))
    value = (
        f"{listed(table.rmse_m)} m at {listed(table.specific_force_mps2)} m/s^2 (p = {show(p, 2)})"
    )
    return Outcome(value, f"{listed(table.rmse_se_m, 2)} m", judge(p > 0.001))


@claim(
    "2017-12",
    "V",
    "The variance's 1/N suggests that the estimator approaches the lower bound.",
    "approaches the bound",
    "RMSE / Cramer-Rao bound, plus 3 errors, below 1.1 at the largest N",
)
def efficient(results):
    last = _curve(results).iloc[-1]
    bound = results.table("claims/position_bound")
    row = bound[bound.samples == last.samples].iloc[0]
    value, error = ratio(last.rmse_m, last.rmse_se_m, row.bound_m, row.bound_se_m)
    remark = "the paper leaves the bound for the calibration problem open; here it is computed"
    return Outcome(show(value), show(error, 2), judge(value + 3 * error < 1.1), remark)


@claim(
    "2017-13",
    "V",
    "Calibrated positions make the fusion algorithm of [4] reliable.",
    "1e-6 m reached, 1e-5 m needed",
    "RMSE at N = 1000 below the paper's own limit of 1e-5 m by 3 errors",
)
def reliable(results):
    row = _curve(results).set_index("samples").loc[1000]
    stands = row.rmse_m + 3 * row.rmse_se_m < 1e-5
    return Outcome(f"{show(row.rmse_m)} m", f"{show(row.rmse_se_m, 2)} m", judge(stands))
