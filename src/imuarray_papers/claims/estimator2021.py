"""Paper 2021, sections II, III, the appendix, figure 2, table I: estimator and its tuning."""

import numpy as np
import pandas as pd

from imuarray_papers.claims.numbers import by_samples, listed, near, power_law, rises, show, tiny
from imuarray_papers.claims.registry import claim, verdict

EXACT = "rounding only"
SWEEP = "tuning/variance_T{}"
LIMITS, DRAWS, UNBIASEDNESS, THEORY = (
    f"claims/marginalisation:{part}" for part in ("limits", "effective_draws", "unbiased", "theory")
)


@claim("2021-01")
def dimensions(results):
    size = len(results.table(f"posterior/T{results.samples[0]}"))
    return verdict(str(size), "none", size == 93)


@claim("2021-02", "claims/identifiability:invariances")
def gyroscopes(found):
    change = found["gyroscope_change"]
    return verdict(f"{change:g} rad/s", EXACT, change == 0.0)


@claim("2021-03", DRAWS)
def naive(found):
    value = f"{show(found['naive'])} of {found['draws']} draws count"
    return verdict(value, "", found["naive"] < 10)


@claim("2021-04", DRAWS)
def rao_blackwell(found):
    ours, drawn = found["rao_blackwellised"], found["conditioned"]
    value = f"{show(ours, 4)} against {show(drawn)} of {found['draws']}"
    return verdict(value, "", ours > 10 * drawn)


@claim("2021-05", UNBIASEDNESS)
def unbiased(rows):
    off = [(row["mean_ratio"] - 1) / row["mean_se"] for row in rows]
    value = ", ".join(f"{row['mean_ratio']:.5f}" for row in rows)
    value += f" for N = {listed([row['draws'] for row in rows])}"
    errors = listed([row["mean_se"] for row in rows], 2)
    return verdict(value, errors, np.max(np.abs(off)) < 4)


@claim("2021-06", UNBIASEDNESS)
def variance_of_estimate(rows):
    rows = pd.DataFrame(rows)
    errors = rows.relative_variance * np.sqrt(2 / (rows.realisations - 1))
    slope, error = power_law(rows.draws, rows.relative_variance, errors)
    return verdict(slope, error, near(slope, -1, error, 0.05))


@claim("2021-07", LIMITS)
def null_space(found):
    value = f"{tiny(found['SH_relative'], 1e-9)}; rank {found['rank_S']} of {found['size']}"
    stands = found["SH_relative"] < 1e-9 and found["rank_S"] == found["size"] - 6
    return verdict(value, EXACT, stands)


@claim("2021-08", LIMITS)
def identities(found):
    worst = max(found["inverse_identity"], abs(found["determinant_identity"]))
    return verdict(tiny(worst, 1e-9), EXACT, worst < 1e-9)


@claim("2021-09", LIMITS, column=1)
@claim("2021-10", LIMITS, column=2)
def limit(found, column):
    table = np.array(found["beta_quadratic_determinant"])
    # exponent in beta of the distance from the limit
    slope = np.polyfit(np.log(table[3:9, 0]), np.log(table[3:9, column]), 1)[0]
    beta, last = table[-1, [0, column]]
    value = (
        f"exponent {show(slope, 4)}; relative distance {tiny(last, 1e-4)} at beta = {show(beta)}"
    )
    return verdict(value, EXACT, abs(slope + 1) < 0.05 and last < 1e-4)


@claim("2021-11", "claims/marginalisation:determinant")
def printed_power(found):
    stands = abs(found["power"] - 1) < 0.01
    value = f"{show(-found['power'])}; misfit {tiny(found['misfit'], 0.01)}"
    return verdict(value, EXACT, stands)


def _printed(results, prefix, remark):
    """Verdict on (26a) as printed: does it move or widen posteriors? ``remark(rows)``."""
    table = results.table("claims/determinant")
    names = [f"{prefix}T{samples}" for samples in results.samples]
    rows = table[table.name.isin(names) & (table.method == "linearised")]
    value = (
        f"mean moves by up to {listed(rows.shift_max_sd, 2)} sd; sds by a factor"
        f" {listed(rows.width_ratio_min, 5)} for T = {listed(rows.samples)}"
    )
    stands = rows.shift_max_sd.max() < 0.1 and np.all(np.abs(rows.width_ratio_min - 1) < 0.1)
    return verdict(value, "none: linearised", stands, remark(rows))


@claim("2021-12")
def printed_small_noise(results):
    table = results.table("claims/determinant")
    tiny = table[table.name.str.startswith("tiny") & (table.samples == table.samples.min())]
    shifts = zip(tiny.name, tiny.method, tiny.shift_max_sd, strict=True)
    checked = "; ".join(f"{name} {method} {show(shift, 2)}" for name, method, shift in shifts)
    remark = f"four triads, T = {results.samples[0]}, largest shift: {checked}"
    return _printed(results, "", lambda rows: remark)


@claim("2021-13")
def printed_large_noise(results):
    words = "along the worst direction, the array's size, {} sd; it grows with T"
    return _printed(
        results, "simulation_", lambda rows: words.format(listed(rows.shift_along_sd, 2))
    )


@claim("2021-14", "claims/marginalisation:six_dimensions")
def six(found):
    value = f"{found['dimensions']} of {found['full']} dimensions"
    limit = 1e-6 * max(1, abs(found["value"]))
    value += f"; difference {tiny(found['difference'], float(show(limit)))}"
    return verdict(value, EXACT, found["dimensions"] == 6 and found["difference"] < limit)


@claim("2021-16", "claims/marginalisation:underflow")
def underflow(found):
    value = "; ".join(
        f"{row['place']}: {row['fails']} of {row['sums']} sums (median exponent"
        f" {show(row['median_exponent'])})"
        for row in found
    )
    return verdict(value, "", any(row["fails"] > 0 for row in found))


@claim("2021-17", "claims/identifiability:common_axis")
def no_rotation(found):
    value = f"rank {found['no rotation']} of {found['unknowns']}"
    return verdict(value, EXACT, found["no rotation"] == 0)


def _low(results):
    """By T, the sweep where the variance is below 1: there it goes with 1/N."""
    return {t: sweep[sweep.variance < 1] for t, sweep in results.source(SWEEP).items()}


@claim("2021-18")
def inverse_draws(results):
    fits = {
        t: power_law(low.draws, low.variance, low.variance_se) for t, low in _low(results).items()
    }
    slopes, errors = ({t: fit[part] for t, fit in fits.items()} for part in (0, 1))
    stands = all(near(slope, -1, error, 0.1) for slope, error in fits.values())
    return verdict(by_samples(slopes), by_samples(errors, 2), stands)


def _scaled(results):
    """N x variance in the regime 1/N, for each T, and its relative error."""
    found = [
        (np.exp(np.log(low.draws * low.variance).mean()),
         np.sqrt(np.sum((low.variance_se / low.variance) ** 2)) / len(low))
        for low in _low(results).values()
    ]  # fmt: skip
    return np.array(found).T


@claim("2021-19")
def grows(results):
    values, errors = _scaled(results)
    chosen = [*results.source("tuning/T{}:draws").values()]
    up = np.diff(np.log(values)) > 3 * np.hypot(errors[1:], errors[:-1])
    value = (
        f"N x variance {listed(values)} and N = {listed(chosen)} for T = {listed(results.samples)}"
    )
    stands = bool(np.all(up) and np.all(np.diff(chosen) >= 0) and chosen[-1] > chosen[0])
    return verdict(value, listed(values * errors, 2), stands)


@claim("2021-20")
def linear_in_samples(results):
    values, errors = _scaled(results)
    slope, error = power_law(results.samples, values, errors * values)
    return verdict(slope, error, abs(slope - 1) < 0.3)


@claim("2021-21", "tuning/T{}:variance", "tuning/T{}:draws", SWEEP)
def target_variance(variance, draws, sweeps):
    pairs = zip(variance.values(), draws.values(), strict=True)
    stands = all(v <= 0.12 and (n == 1 or v * n / (n - 1) > 0.08) for v, n in pairs)
    value = f"{by_samples(variance)} with N = {listed(draws.values())}"
    count = int(next(iter(sweeps.values())).realisations.iloc[0])
    remark = ""
    if 1 in draws.values():
        remark = "the smallest N there is, 1, already does better for few samples"
    return verdict(value, f"{100 * np.sqrt(2 / (count - 1)):.0f} %", stands, remark)


@claim("2021-22")
def acceptance(results):
    low, high = results.settings["paper2021"]["acceptance_range"]
    found = results.source("posterior/T{}:acceptance")
    stands = all(low <= rate <= high for rates in found.values() for rate in rates)
    return verdict(by_samples(found), "over the whole run, burn-in included", stands)


@claim("2021-23", THEORY, "claims/marginalisation:random_walk")
def twenty_three(found, walk):
    theory, walked = found["acceptance"], walk["acceptance"]
    stands = abs(theory - 0.234) < 0.005 and abs(walked - 0.234) < 0.05
    value = f"{show(walked)} simulated, {show(theory, 4)} in the limit"
    return verdict(value, walk["se"], stands)


@claim("2021-24", THEORY)
def three_point_three(found):
    variance, acceptance = found["noisy_variance"], found["noisy_acceptance"]
    stands = abs(variance - 3.3) < 0.05 and abs(acceptance - 0.07) < 0.005
    return verdict(f"{show(variance)}, {show(acceptance)}", "none", stands)


@claim("2021-25", "tuning/acceptance_T{}")
def trade_off(sweeps):
    ends, up, largest = {}, 0, 0.0
    for samples, sweep in sweeps.items():
        sweep = sweep.sort_values("step_length_m")
        error = np.maximum(sweep.acceptance_se, 1 / sweep.transitions)
        up += rises(sweep.acceptance, error)
        ends[samples] = (sweep.acceptance.iloc[0], sweep.acceptance.iloc[-1])
        largest = max(largest, sweep.acceptance_se.max())
    stands = up == 0 and all(a > 0.5 and b < 0.05 for a, b in ends.values())
    value = "; ".join(f"T = {t}: {show(a)} to {show(b)}" for t, (a, b) in ends.items())
    return verdict(f"{value}; {up} steps up", largest, stands)


@claim("2021-26", "claims/acceptance_variance")
def stuck(table):
    table = table.sort_values("log_variance")
    low, high = table.iloc[0], table.iloc[-1]
    error = float(np.hypot(low.acceptance_se, high.acceptance_se))
    value = f"{listed(table.acceptance)} at variance {listed(table.log_variance)} (at the truth)"
    return verdict(value, error, low.acceptance - high.acceptance > 3 * error)
