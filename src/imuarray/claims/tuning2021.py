"""Paper 2021, section III-C, figure 2 and table I: tuning."""

from __future__ import annotations

import numpy as np

from imuarray.claims.numbers import by_samples, listed, power_law, show
from imuarray.claims.registry import Outcome, claim, judge


def _sweep(results, samples):
    return results.table(f"tuning/variance_T{samples}")


@claim(
    "2021-18",
    "IV-A, figure 2",
    "For a fixed T the variance of log p-hat is about inversely proportional to N.",
    "exponent -1",
    "fitted exponent within max(0.1, 3 errors) of -1 for every T, where the variance is below 1",
)
def inverse_draws(results):
    fits = {}
    for samples in results.samples:
        sweep = _sweep(results, samples)
        low = sweep[sweep.variance < 1]
        fits[samples] = power_law(low.draws, low.variance, low.variance_se)
    stands = all(abs(slope + 1) <= max(0.1, 3 * error) for slope, error in fits.values())
    errors = by_samples({samples: fit[1] for samples, fit in fits.items()}, 2)
    return Outcome(by_samples({t: fit[0] for t, fit in fits.items()}), errors, judge(stands))


def _scaled(results):
    """N x variance in the regime 1/N, for each T."""
    found = {}
    for samples in results.samples:
        sweep = _sweep(results, samples)
        low = sweep[sweep.variance < 1]
        logs = np.log(low.draws * low.variance)
        found[samples] = (
            np.exp(logs.mean()),
            np.sqrt(np.sum((low.variance_se / low.variance) ** 2)) / len(low),
        )
    return found


@claim(
    "2021-19",
    "IV-A",
    "The variance of log p-hat grows with T, so that N must grow to keep it.",
    "N grows with T",
    "chosen N does not fall, and N x variance rises by 3 errors at each step of T",
)
def grows(results):
    scaled = _scaled(results)
    values, errors = np.array(list(scaled.values())).T
    chosen = [results.json(f"tuning/T{samples}")["draws"] for samples in results.samples]
    up = np.diff(np.log(values)) > 3 * np.hypot(errors[1:], errors[:-1])
    value = (
        f"N x variance {listed(values)} and N = {listed(chosen)} for T = {listed(results.samples)}"
    )
    stands = bool(np.all(up) and np.all(np.diff(chosen) >= 0) and chosen[-1] > chosen[0])
    return Outcome(
        value, f"{listed(values * errors, 2)}", judge(stands), "no values of table I in the text"
    )


@claim(
    "2021-20",
    "IV-A",
    "... because log p-hat is a sum over independent samples.",
    "variance linear in T",
    "fitted exponent of the variance against T within 0.3 of 1",
)
def linear_in_samples(results):
    scaled = _scaled(results)
    values, errors = np.array(list(scaled.values())).T
    slope, error = power_law(results.samples, values, errors * values)
    remark = "each T has data of its own, whose information differs: hence the wide criterion"
    return Outcome(show(slope), show(error, 2), judge(abs(slope - 1) < 0.3), remark)


@claim(
    "2021-21",
    "III-C",
    "N is set so that Var(log p-hat) is about 0.1 at the prior mean.",
    "0.1",
    "variance at most 0.12 at the chosen N, and above 0.08 with one draw fewer",
)
def target_variance(results):
    found = {}
    for samples in results.samples:
        tuned = results.json(f"tuning/T{samples}")
        found[samples] = (tuned["variance"], tuned["draws"])
    stands = all(v <= 0.12 and (n == 1 or v * n / (n - 1) > 0.08) for v, n in found.values())
    value = by_samples({samples: pair[0] for samples, pair in found.items()})
    value += f" with N = {listed([pair[1] for pair in found.values()])}"
    count = int(_sweep(results, results.samples[0]).realisations.iloc[0])
    remark = "the smallest N there is, 1, already does better for few samples" if any(
        n == 1 for _, n in found.values()) else ""  # fmt: skip
    return Outcome(value, f"{100 * np.sqrt(2 / (count - 1)):.0f} %", judge(stands), remark)


@claim(
    "2021-22",
    "III-C",
    "sigma_q is tuned to an acceptance between 7 and 23 %.",
    "0.07 to 0.23",
    "both chains' own acceptance inside for every T, not only in the sweep",
)
def acceptance(results):
    low, high = results.settings["paper2021"]["acceptance_range"]
    found = {t: results.json(f"posterior/T{t}")["acceptance"] for t in results.samples}
    stands = all(low <= rate <= high for rates in found.values() for rate in rates)
    value = "; ".join(f"T = {samples}: {listed(rates)}" for samples, rates in found.items())
    return Outcome(value, "over the whole run, burn-in included", judge(stands))


@claim(
    "2021-23",
    "III-C, from [42]",
    "A Gaussian random walk is best at an acceptance of about 23 %.",
    "0.23",
    "93-dimensional normal: acceptance at the largest mean jump within 0.05; theory within 0.005",
)
def twenty_three(results):
    found = results.json("claims/marginalisation")
    theory, walked = found["theory"]["acceptance"], found["random_walk"]["acceptance"]
    stands = abs(theory - 0.234) < 0.005 and abs(walked - 0.234) < 0.05
    return Outcome(
        f"{show(walked)} simulated, {show(theory, 4)} in the limit",
        show(found["random_walk"]["se"], 2),
        judge(stands),
    )


@claim(
    "2021-24",
    "III-C, from [43]",
    "With a noisy likelihood the best variance is 3.3 and the acceptance 7 %.",
    "3.3, 0.07",
    "optimum of the limiting efficiency within 0.05 and 0.005",
)
def three_point_three(results):
    found = results.json("claims/marginalisation")["theory"]
    stands = (
        abs(found["noisy_variance"] - 3.3) < 0.05 and abs(found["noisy_acceptance"] - 0.07) < 0.005
    )
    return Outcome(
        f"{show(found['noisy_variance'])}, {show(found['noisy_acceptance'])}", "none", judge(stands)
    )


@claim(
    "2021-25",
    "III-C",
    "Steps that are too long are mostly rejected, steps that are too short accepted.",
    "trade-off",
    "acceptance never rises with sigma_q by more than 3 errors; above 0.5 at one end, below 0.05"
    " at the other",
)
def trade_off(results):
    ends, up = {}, 0
    for samples in results.samples:
        sweep = results.table(f"tuning/acceptance_T{samples}").sort_values("step_length_m")
        error = np.maximum(sweep.acceptance_se, 1 / sweep.transitions).to_numpy()
        up += int(np.sum(np.diff(sweep.acceptance) > 3 * np.hypot(error[1:], error[:-1])))
        ends[samples] = (sweep.acceptance.iloc[0], sweep.acceptance.iloc[-1])
    stands = up == 0 and all(a > 0.5 and b < 0.05 for a, b in ends.values())
    value = "; ".join(f"T = {t}: {show(a)} to {show(b)}" for t, (a, b) in ends.items())
    return Outcome(
        f"{value}; {up} steps up",
        show(max(results.table(f"tuning/acceptance_T{t}").acceptance_se.max() for t in ends), 2),
        judge(stands),
    )


@claim(
    "2021-26",
    "III-C",
    "A likelihood estimate of too high variance makes the chain get stuck.",
    "acceptance falls",
    "largest T, same sigma_q: acceptance at the highest variance below that at the lowest by 3"
    " errors",
)
def stuck(results):
    table = results.table("claims/acceptance_variance").sort_values("log_variance")
    low, high = table.iloc[0], table.iloc[-1]
    error = float(np.hypot(low.acceptance_se, high.acceptance_se))
    value = f"{listed(table.acceptance)} at variance {listed(table.log_variance)} (at the truth)"
    return Outcome(value, show(error, 2), judge(low.acceptance - high.acceptance > 3 * error))
