"""Paper 2017, figures 4 and 5: the error of the calibrated positions."""

import numpy as np
from scipy.special import chdtrc

from imuarray_papers.claims.numbers import listed, near, power_law, ratio, rises, show
from imuarray_papers.claims.registry import claim, untested, verdict

SAMPLES = "calibration/position_error_samples"
MOTION = "calibration/position_error_motion"
BOUND = "claims/position_bound"
RATE, ACCELERATION = "angular_rate_dps", "angular_acceleration_dps2"
UNITS = {RATE: "deg/s", ACCELERATION: "deg/s^2"}


def _curve(results, iterations=None):
    """RMSE over N after ``iterations``, or after the most there are."""
    table = results.table(SAMPLES)
    return table[table.iterations == (iterations or table.iterations.max())].sort_values("samples")


def _exponent(results, least=10):
    """Exponent of RMSE against N >= ``least``, its error, and the least share that converged (%).

    Below N = 10 too many runs stop at the last iteration without having converged.
    """
    curve = _curve(results)
    curve = curve[curve.samples >= least]
    fit = power_law(curve.samples, curve.rmse_m, curve.rmse_se_m)
    return *fit, 100 * curve.converged_share.min()


@claim("2017-01")
def inverse_root(results):
    (slope, error, share), (wider, spread, fewer) = (_exponent(results, n) for n in (10, 3))
    remark = (
        f"at least {show(share)} % of the runs converged for each N >= 10; over N >= 3"
        f" {show(wider)} +- {show(spread, 2)}, where as few as {show(fewer)} % have"
    )
    return verdict(slope, error, near(slope, -0.5, error, 0.05), remark)


@claim("2017-02", power=1)
@claim("2017-03", power=2)
def inverse(results, power):
    """Verdict on the exponent of the error (power 1), or of its square, the variance."""
    slope, error = (power * part for part in _exponent(results)[:2])
    return verdict(slope, error, near(slope, -1, error, 0.05 * power))


@claim("2017-44", SAMPLES)
def complete(table):
    rmse = table[table.samples >= 10].pivot(index="iterations", columns="samples", values="rmse_m")
    last = rmse.iloc[-1]
    # what is left to go falls by the same factor in each iteration, as the last two levels show;
    # with 0.46 of the last RMSE left the RMSE is 10 % above it
    going = rmse[(rmse > 1.2 * last).all(axis=1)].tail(2)
    left = np.sqrt(going**2 - last**2)
    if len(left) < 2:
        return untested("no two numbers of iterations before convergence at this scale")
    (first, second), (a, b) = left.index, left.to_numpy()
    needed = second + np.log(b / (0.46 * last)) * (second - first) / np.log(a / b)
    factors = (b / a) ** (1 / (second - first))
    value = f"{listed(needed.iloc[[0, -1]])} iterations for N = {listed(needed.index[[0, -1]], 5)}"
    remark = (
        f"what is left falls by {show(1 - factors.max(), 2)} to {show(1 - factors.min(), 2)} of"
        " itself in an iteration for each N, but goes down to the bound, as N^-1/2: N log N"
    )
    return verdict(value, "", needed.iloc[-1] <= 1.1 * needed.iloc[0], remark)


@claim("2017-04", least=1e-6 / np.sqrt(10), most=1e-6 * np.sqrt(10))
@claim("2017-13", most=1e-5, errors=3)
def thousand(results, most, least=0.0, errors=0):
    """RMSE at N = 1000, with so many standard errors."""
    row = _curve(results).set_index("samples").loc[1000]
    stands = least <= row.rmse_m and row.rmse_m + errors * row.rmse_se_m <= most
    return verdict(f"{show(row.rmse_m)} m", f"{show(row.rmse_se_m, 2)} m", stands)


@claim("2017-05", SAMPLES)
def two_samples(table):
    two = table[table.samples == 2].sort_values("iterations")
    first, last = two.iloc[0], two.iloc[-1]
    value, error = ratio(last.rmse_m, last.rmse_se_m, first.rmse_m, first.rmse_se_m)
    remark = (
        f"RMSE {show(first.rmse_m)} m after {first.iterations:.0f}, {show(last.rmse_m)} m after"
        f" {last.iterations:.0f} iterations; {100 * last.converged_share:.0f} % of the runs had"
        " converged by then: slower than for N > 2, and heavy-tailed"
    )
    return verdict(value, error, value >= 1 - 3 * error, remark)


@claim("2017-06", "claims/ranks", BOUND)
def two_ill_posed(ranks, bound):
    two = ranks[ranks.samples == 2]
    deficient = int(np.sum(two["rank"] < two.unknowns))
    bound = bound.iloc[0]
    remark = (
        f"Cramer-Rao bound at N = 2: {show(bound.bound_m)} +- {show(bound.bound_se_m, 2)} m; slow"
        " convergence, not a missing condition, keeps the RMSE up"
    )
    return verdict(f"{deficient} of {len(two)} arrays deficient", "", deficient > 0, remark)


@claim("2017-07", SAMPLES)
def more_iterations(table):
    worst, up = 0.0, 0
    for _, curve in table[table.samples > 2].groupby("samples"):
        curve = curve.sort_values("iterations")
        up += rises(curve.rmse_m, curve.rmse_se_m)
        a, b = curve.iloc[-1], curve.iloc[0]
        value, error = ratio(a.rmse_m, a.rmse_se_m, b.rmse_m, b.rmse_se_m)
        worst = max(worst, value + 3 * error)
    text = f"largest (last / first + 3 errors) {show(worst)}; {up} steps up"
    return verdict(text, "in the value", up == 0 and worst < 1)


@claim("2017-08")
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
    return verdict(value, f"{listed(curve.rmse_se_m, 2)} m", up == 0 and falls, remark)


def _steps_up(results, table, along, across, remark):
    """Verdict on figure 5's steps up; the ``remark`` gets the number of the bound's own."""
    table = table.sort_values(along)
    up = {level: rises(line.rmse_m, line.rmse_se_m) for level, line in table.groupby(across)}
    bound = results.table(BOUND)
    grid = bound[bound.samples == results.settings["paper2017"]["fig5_samples"]].iloc[1:]
    lines = grid.sort_values(along).groupby(grid[across].round(3))
    bounds = sum(rises(line.bound_m, line.bound_se_m) for _, line in lines)
    count = sum(up.values())
    text = f"{count} of {len(table) - table[across].nunique()} steps go up"
    where = ", ".join(show(level, 6) for level in up if up[level])
    where = f"at {where} {UNITS[across]}; " if where else ""
    return verdict(text, "3 errors a step", count == 0, where + remark.format(bounds))


@claim("2017-09")
def faster_rotation(results):
    remark = "the Cramer-Rao bound itself goes up in {} steps"
    return _steps_up(results, results.table(MOTION), RATE, ACCELERATION, remark)


def _beyond(table, limit) -> str:
    """A remark on our rows of figure 5 at accelerations above ``limit`` (deg/s^2)."""
    levels = {a: row.set_index(RATE) for a, row in table.groupby(ACCELERATION)}
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


@claim("2017-10")
def faster_acceleration(results):
    whole = results.table(MOTION)
    hand = results.settings["paper2021"]["angular_acceleration_sd_dps2"]
    table = whole[whole.angular_acceleration_dps2 <= hand]
    remark = "figure 5's axes are not in the text; the Cramer-Rao bound goes up in {} steps of our"
    remark += f" whole grid{_beyond(whole, hand)}"
    return _steps_up(results, table, ACCELERATION, RATE, remark)


@claim("2017-11", "calibration/position_error_force")
def translation(table):
    weight = table.rmse_se_m**-2.0
    mean = np.sum(weight * table.rmse_m) / weight.sum()
    statistic = float(np.sum(weight * (table.rmse_m - mean) ** 2))
    p = float(chdtrc(len(table) - 1, statistic))
    value = (
        f"{listed(table.rmse_m)} m at {listed(table.specific_force_mps2)} m/s^2 (p = {show(p, 2)})"
    )
    return verdict(value, f"{listed(table.rmse_se_m, 2)} m", p > 0.001)


@claim("2017-12")
def efficient(results):
    last = _curve(results).iloc[-1]
    bound = results.table(BOUND)
    row = bound[bound.samples == last.samples].iloc[0]
    value, error = ratio(last.rmse_m, last.rmse_se_m, row.bound_m, row.bound_se_m)
    return verdict(value, error, value + 3 * error < 1.1)
