"""Paper 2021, sections IV-B and IV-C, figure 5 and table II: the experiment and its simulation."""

from __future__ import annotations

import numpy as np

from imuarray.claims.numbers import by_samples, listed, show
from imuarray.claims.registry import FAILS, Outcome, claim, judge, untested
from imuarray.geometry import UNDERSIDE_ROTATION

MEASURED = "measured data needed; the value is for a simulated stand-in"
RANGE = 157.0  # m/s^2, where the accelerometers saturate


def _sds(results, prefix):
    """Median sd (m) over coordinates for each T."""
    return {t: results.posterior(f"{prefix}T{t}")[0].sd_m.median() for t in results.samples}


def _all_names(results, *prefixes):
    return [f"{prefix}T{t}" for prefix in prefixes for t in results.samples]


@claim(
    "2021-40",
    "IV-B",
    "0.5 % of the accelerometers' range gives sigma_a = 0.79 m/s^2.",
    "0.79 m/s^2",
    "0.005 x 157 m/s^2 within 1 % of the configured value",
)
def half_percent(results):
    used = results.settings["experiment"]["accelerometer_sd"]
    value = 0.005 * RANGE
    return Outcome(
        f"{show(value)} m/s^2, {show(used)} used", "none", judge(abs(value / used - 1) < 0.01)
    )


@claim(
    "2021-41",
    "IV-B",
    "The accelerometers saturate around 157 m/s^2.",
    "157 m/s^2",
    "16 g, the data sheet's largest range, within 1 %",
)
def saturation(results):
    value = 16 * 9.80665
    return Outcome(f"{show(value, 4)} m/s^2", "none", judge(abs(value / RANGE - 1) < 0.01))


@claim(
    "2021-42",
    "IV-B",
    "A larger accelerometer covariance widens the posterior.",
    "widens",
    "same motion, sigma_a 0.79 against 0.04 m/s^2: ratio of median sds above 1 for every T",
)
def widens(results):
    small = {
        t: results.linearised(f"simulation_small_noise_T{t}").sd_m.median() for t in results.samples
    }
    large = {t: results.linearised(f"simulation_T{t}").sd_m.median() for t in results.samples}
    ratios = {t: large[t] / small[t] for t in results.samples}
    return Outcome(
        by_samples(ratios), "none: linearised", judge(all(r > 1 for r in ratios.values()))
    )


def _hundred(results):
    wide, narrow = _sds(results, "simulation_"), _sds(results, "")
    return {t: wide[t] / narrow[t] for t in results.samples}


@claim(
    "2021-43",
    "IV-C, table II",
    "The simulation with the experiment's covariance has sds about 100 times those of figure 4.",
    "about 100",
    "ratio of median sds within a factor 2 of 100 for every T",
)
def hundred(results):
    ratios = _hundred(results)
    stands = all(50 <= value <= 200 for value in ratios.values())
    remark = (
        results.sources(_all_names(results, "simulation_", "")) + "; table II is not in the text"
    )
    return Outcome(by_samples(ratios), "", judge(stands), remark)


@claim(
    "2021-44",
    "IV-C",
    "That widening is due to the enlarged covariance.",
    "attributed to it",
    "sigma_a alone makes up more than half of the ratio's logarithm for every T",
)
def attributed(results):
    total, share = {}, {}
    for t in results.samples:
        sds = [results.linearised(f"{name}T{t}").sd_m.median()
               for name in ("simulation_", "simulation_small_noise_", "")]  # fmt: skip
        total[t] = sds[0] / sds[2]
        share[t] = np.log(sds[0] / sds[1]) / np.log(total[t])
    remark = (
        "the rest is slower motion: twisting as simulated turns less than section IV-A's motion"
    )
    return Outcome(f"share {by_samples(share, 2)} of {by_samples(total)}", "none: linearised",
                   judge(all(0.5 < value for value in share.values())), remark)  # fmt: skip


@claim(
    "2021-45",
    "IV-C, table II",
    "Simulated sds with the experiment's settings are similar to the experiment's.",
    "similar",
    "measured / simulated median sd within a factor 1.5 of 1 for every T",
)
def similar(results):
    names = [f"{results.kinds[kind]}_" for kind in ("experiment", "simulation")]
    sds = [_sds(results, name) for name in names]
    ratios = {t: sds[0][t] / sds[1][t] for t in results.samples}
    source = results.sources(_all_names(results, *names))
    if results.measured is None:
        return untested(f"{MEASURED}; {source}", f"stand-in / simulation {by_samples(ratios)}")
    stands = all(1 / 1.5 < ratio < 1.5 for ratio in ratios.values())
    remark = f"8 IMUs, {results.measured}; the widths follow from sigma_a and the motion, whatever"
    remark += f" the residuals are; {source}"
    return Outcome(by_samples(ratios), "", judge(stands), remark)


@claim(
    "2021-46",
    "IV-C",
    "In the experiment the posterior's covariance shrinks with T.",
    "shrinks",
    "median sd falls at each step of T",
)
def experiment_shrinks(results):
    name = f"{results.kinds['experiment']}_"
    sds, source = _sds(results, name), results.sources(_all_names(results, name))
    if results.measured is None:
        return untested(f"{MEASURED}; {source}", f"median sd {by_samples(sds)} m")
    stands = np.all(np.diff(list(sds.values())) < 0)
    return Outcome(f"median sd {by_samples(sds)} m", "", judge(stands), f"8 IMUs; {source}")


@claim(
    "2021-47",
    "IV-C",
    "In the simulation of the experiment the posterior's covariance shrinks with T.",
    "shrinks",
    "median sd falls at each step of T",
)
def simulation_shrinks(results):
    sds = _sds(results, "simulation_")
    stands = np.all(np.diff(list(sds.values())) < 0)
    remark = results.sources(_all_names(results, "simulation_"))
    return Outcome(f"{by_samples(sds)} m", "", judge(stands), remark)


@claim(
    "2021-50",
    "IV-C",
    "An offset common to all packages leaves the topside unshifted and shifts the underside twice.",
    "0 and 2",
    "topside shift 0; underside shift twice the offset across the axis of rotation and along z",
)
def doubled(results):
    axis = np.real(
        np.linalg.eig(UNDERSIDE_ROTATION)[1][
            :, np.argmax(np.real(np.linalg.eigvals(UNDERSIDE_ROTATION)))
        ]
    )
    across = np.cross(axis, [0.0, 0.0, 1.0])
    top = across - across  # a topside triad and the reference are turned alike
    factors = [abs((UNDERSIDE_ROTATION @ d - d) @ d) for d in (across, np.array([0.0, 0, 1]), axis)]
    value = f"topside {show(np.abs(top).max())}; underside {listed(factors[:2])}"
    value += f", along the axis {show(factors[2], 2)}"
    remark = (
        "an offset along the axis of rotation moves all triads alike and cannot be seen; halving"
        " the"
        " shift therefore gives the in-package position only across that axis"
    )
    stands = np.allclose(factors[:2], 2) and not top.any()
    return Outcome(value, "none", judge(stands), remark)


@claim(
    "2021-51",
    "IV-B",
    "(30b) is the covariance of p(omega_t | y_g).",
    "as (15)",
    "ratio to the closed form sigma_g^2 / G within a factor 2",
)
def spread(results):
    found = results.json("claims/marginalisation")["spread"]
    verdict = judge(0.5 < found["ratio"] < 2)
    remark = (
        f"(30b) is one gyroscope's covariance, not that of the mean of {found['gyroscopes']}: it"
        " widens on purpose or by slip"
        if verdict == FAILS
        else ""
    )
    return Outcome(show(found["ratio"], 4), show(found["se"], 2), verdict, remark)


@claim(
    "2021-53",
    "IV-C",
    "Position estimates agree with the maximum likelihood results of [26].",
    "consistent",
    "needs the other paper's results",
)
def consistent(results):
    reason = "results of another paper on measured data"
    if results.measured is None:
        return untested(reason)
    t = results.samples[-1]
    table = results.measured_table(f"positions/{results.measured}")
    ml = table[(table.method == "bcd") & (table.samples == t)].mean_m.to_numpy()
    posterior = results.table(f"posterior/{results.measured}_T{t}")
    off = np.abs(ml - posterior.mean_m.to_numpy()) / posterior.sd_m.to_numpy()
    value = f"ML-BCD of 2017 on the same {t} samples: within {show(off.max(), 2)} posterior sds"
    return untested(f"{reason}; the value is ours", value)
