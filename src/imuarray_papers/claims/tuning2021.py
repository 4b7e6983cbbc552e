"""Paper 2021, section III-C, figure 2 and table I: tuning."""

import numpy as np

from imuarray_papers.claims.registry import (
    by_samples,
    claim,
    judged,
    listed,
    near,
    power_law,
    rises,
    show,
)

SWEEP = "tuning/variance_T{}"


def _low(results):
    """By T, the sweep where the variance is below 1: there it goes with 1/N."""
    return {t: sweep[sweep.variance < 1] for t, sweep in results.each_table(SWEEP).items()}


@claim("2021-18")
def inverse_draws(results):
    fits = {
        t: power_law(low.draws, low.variance, low.variance_se) for t, low in _low(results).items()
    }
    slopes, errors = ({t: fit[part] for t, fit in fits.items()} for part in (0, 1))
    stands = all(near(slope, -1, error, 0.1) for slope, error in fits.values())
    return judged(by_samples(slopes), by_samples(errors, 2), stands)


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
    chosen = [tuned["draws"] for tuned in results.each_json("tuning/T{}").values()]
    up = np.diff(np.log(values)) > 3 * np.hypot(errors[1:], errors[:-1])
    value = (
        f"N x variance {listed(values)} and N = {listed(chosen)} for T = {listed(results.samples)}"
    )
    stands = bool(np.all(up) and np.all(np.diff(chosen) >= 0) and chosen[-1] > chosen[0])
    remark = "no values of table I in the text"
    return judged(value, listed(values * errors, 2), stands, remark)


@claim("2021-20")
def linear_in_samples(results):
    values, errors = _scaled(results)
    slope, error = power_law(results.samples, values, errors * values)
    remark = "each T has data of its own, whose information differs: hence the wide criterion"
    return judged(slope, error, abs(slope - 1) < 0.3, remark)


@claim("2021-21")
def target_variance(results):
    found = results.each_json("tuning/T{}")
    pairs = [(tuned["variance"], tuned["draws"]) for tuned in found.values()]
    stands = all(v <= 0.12 and (n == 1 or v * n / (n - 1) > 0.08) for v, n in pairs)
    value = by_samples({t: tuned["variance"] for t, tuned in found.items()})
    value += f" with N = {listed([n for _, n in pairs])}"
    count = int(results.table(SWEEP.format(results.samples[0])).realisations.iloc[0])
    remark = ""
    if any(n == 1 for _, n in pairs):
        remark = "the smallest N there is, 1, already does better for few samples"
    return judged(value, f"{100 * np.sqrt(2 / (count - 1)):.0f} %", stands, remark)


@claim("2021-22")
def acceptance(results):
    low, high = results.settings["paper2021"]["acceptance_range"]
    found = {t: v["acceptance"] for t, v in results.each_json("posterior/T{}").items()}
    stands = all(low <= rate <= high for rates in found.values() for rate in rates)
    return judged(by_samples(found), "over the whole run, burn-in included", stands)


@claim("2021-23")
def twenty_three(results):
    found = results.json("claims/marginalisation")
    theory, walked = found["theory"]["acceptance"], found["random_walk"]["acceptance"]
    stands = abs(theory - 0.234) < 0.005 and abs(walked - 0.234) < 0.05
    value = f"{show(walked)} simulated, {show(theory, 4)} in the limit"
    return judged(value, found["random_walk"]["se"], stands)


@claim("2021-24")
def three_point_three(results):
    found = results.json("claims/marginalisation")["theory"]
    variance, acceptance = found["noisy_variance"], found["noisy_acceptance"]
    stands = abs(variance - 3.3) < 0.05 and abs(acceptance - 0.07) < 0.005
    return judged(f"{show(variance)}, {show(acceptance)}", "none", stands)


@claim("2021-25")
def trade_off(results):
    ends, up, largest = {}, 0, 0.0
    for samples, sweep in results.each_table("tuning/acceptance_T{}").items():
        sweep = sweep.sort_values("step_length_m")
        error = np.maximum(sweep.acceptance_se, 1 / sweep.transitions)
        up += rises(sweep.acceptance, error)
        ends[samples] = (sweep.acceptance.iloc[0], sweep.acceptance.iloc[-1])
        largest = max(largest, sweep.acceptance_se.max())
    stands = up == 0 and all(a > 0.5 and b < 0.05 for a, b in ends.values())
    value = "; ".join(f"T = {t}: {show(a)} to {show(b)}" for t, (a, b) in ends.items())
    return judged(f"{value}; {up} steps up", largest, stands)


@claim("2021-26")
def stuck(results):
    table = results.table("claims/acceptance_variance").sort_values("log_variance")
    low, high = table.iloc[0], table.iloc[-1]
    error = float(np.hypot(low.acceptance_se, high.acceptance_se))
    value = f"{listed(table.acceptance)} at variance {listed(table.log_variance)} (at the truth)"
    return judged(value, error, low.acceptance - high.acceptance > 3 * error)
