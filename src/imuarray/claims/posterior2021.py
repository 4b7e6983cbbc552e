"""Paper 2021, section IV-A, figures 3 and 4: the chains and the simulated posteriors."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from imuarray.claims.numbers import by_samples, listed, show
from imuarray.claims.registry import Outcome, claim, judge, untested


def _names(results):
    return {samples: f"T{samples}" for samples in results.samples}


def _verdicts(results):
    return {t: results.json(f"posterior/{name}") for t, name in _names(results).items()}


def _posteriors(results):
    return {t: results.posterior(name)[0] for t, name in _names(results).items()}


@claim(
    "2021-27",
    "IV-A, figure 3",
    "Two chains from different starts converge to the same distribution.",
    "same",
    "largest rank-normalised split R-hat of all coordinates below 1.05 for every T",
)
def chains_agree(results):
    found = _verdicts(results)
    value = by_samples({t: v["rhat_max"] for t, v in found.items()}, 4)
    sizes = by_samples({t: v["ess_min"] for t, v in found.items()})
    z = by_samples({t: v["split_z_max"] for t, v in found.items()})
    steps = by_samples({t: v["steps"] for t, v in found.items()}, 7)
    remark = (
        f"smallest effective sizes {sizes}; largest |z| of the chains' means {z}; steps {steps}"
    )
    return Outcome(value, "", judge(all(v["rhat_max"] < 1.05 for v in found.values())), remark)


@claim(
    "2021-28",
    "IV-A",
    "The chains' means agree within their Monte Carlo errors.",
    "agree",
    "largest |z| between the two chains over 93 coordinates below 4.5, effective sizes above 100",
)
def means_agree(results):
    found = _verdicts(results)
    stands = all(v["split_z_max"] < 4.5 and v["ess_min"] > 100 for v in found.values())
    value = by_samples({t: v["split_z_max"] for t, v in found.items()})
    return Outcome(value, "1 by construction", judge(stands))


@claim(
    "2021-29",
    "IV-A",
    "A burn-in period ends within the run.",
    "ends",
    "smallest R-hat over the candidates of burn-in, from the chains' entry to half of the chain,"
    " below its threshold, every T",
)
def burn_in(results):
    found = {}
    for samples in results.samples:
        table = results.table(f"posterior/burn_in_T{samples}")
        table = table[table.burn_in > 0]  # the first candidate is none, the second the entry
        found[samples] = (
            table.rhat_max.min(),
            results.json(f"posterior/T{samples}")["burn_in_steps"],
        )
    limit = results.settings["paper2021"]["rhat_threshold"]
    value = by_samples({samples: best for samples, (best, _) in found.items()}, 4)
    remark = (
        "burn-in chosen: " + by_samples({t: cut for t, (_, cut) in found.items()}, 7) + " steps"
    )
    return Outcome(value, "", judge(all(best < limit for best, _ in found.values())), remark)


@claim(
    "2021-30",
    "IV-A, figure 4",
    "For every T the posterior's variance is less than the prior's.",
    "less",
    "every coordinate's sd below the prior's for every T",
)
def narrower(results):
    prior = results.settings["paper2021"]["prior_sd"]
    ratios = {t: p.sd_m.max() / prior for t, p in _posteriors(results).items()}
    stands = all(value < 1 for value in ratios.values())
    remark = results.sources(_names(results).values())
    return Outcome(f"largest sd / prior sd {by_samples(ratios)}", "", judge(stands), remark)


@claim(
    "2021-31",
    "IV-A, figure 4",
    "The posterior's variance decreases with T.",
    "decreases",
    "sd of every coordinate (IMU 2 in figure 4) falls at each step of T",
)
def shrinks(results):
    found = _posteriors(results)
    sds = np.array([table.sd_m for table in found.values()])
    median = by_samples({t: np.median(table.sd_m) for t, table in found.items()})
    own = by_samples(
        {t: np.median(p.sd_m[p.accelerometer.astype(str) == "2"]) for t, p in found.items()}
    )
    value = f"median sd {median} m; IMU 2 {own} m"
    remark = results.sources(_names(results).values())
    return Outcome(value, "", judge(np.all(np.diff(sds, axis=0) < 0)), remark)


@claim(
    "2021-32",
    "IV-A, figure 4",
    "The posterior's mean moves closer to the truth as T grows.",
    "closer",
    "RMS distance over coordinates falls at each step of T",
)
def closer(results):
    found = _posteriors(results)
    squares = {t: np.square(table.mean_m - table.truth_m) for t, table in found.items()}
    distance = {t: float(np.sqrt(values.mean())) for t, values in squares.items()}
    stands = np.all(np.diff(list(distance.values())) < 0)
    remark = results.sources(_names(results).values())
    return Outcome(f"{by_samples(distance)} m", "one data set a T", judge(stands), remark)


@claim(
    "2021-33",
    "IV-A",
    "The posterior concentrates around the true values: its sds are honest.",
    "around the truth",
    "mean squared z of the truth over coordinates within 0.3 ... 3 for every T",
)
def honest(results):
    found = _posteriors(results)
    z = {t: float(np.mean(((p.mean_m - p.truth_m) / p.sd_m) ** 2)) for t, p in found.items()}
    stands = all(0.3 < value < 3 for value in z.values())
    return Outcome(
        by_samples(z),
        "correlated coordinates",
        judge(stands),
        results.sources(_names(results).values()),
    )


@claim(
    "2021-34",
    "IV-A",
    "The algorithm is robust to large initial uncertainty (prior 3 mm, prior mean off by 0.1 mm).",
    "robust",
    "chains started 1 mm off converge, and their sds are below a tenth of the prior's, every T",
)
def robust(results):
    prior, found = results.settings["paper2021"]["prior_sd"], _verdicts(results)
    ratios = {t: results.table(f"posterior/T{t}").sd_m.max() / prior for t in results.samples}
    stands = all(v["converged"] for v in found.values()) and max(ratios.values()) < 0.1
    value = f"{sum(v['converged'] for v in found.values())} of {len(found)} converged"
    value += f"; chains' largest sd / prior sd {by_samples(ratios)}"
    return Outcome(value, "", judge(stands))


@claim(
    "2021-35",
    "IV-C, V",
    "The sampler efficiently samples 93 dimensions.",
    "efficiently",
    "no quantity is given to compare with",
)
def efficient(results):
    found = _verdicts(results)
    rate = {t: 1000 * v["ess_min"] / (v["steps"] * v["chains"]) for t, v in found.items()}
    return untested(
        "no effective size or length of chain in the text",
        f"smallest effective size a 1000 steps {by_samples(rate)}",
    )


def covered(draws, points, level=1 - 1 / 31):
    """How many ellipses in x and y at ``level``, of draws (n, k, 3), hold the points (k, 3)."""
    inside = 0
    for k in range(draws.shape[1]):
        off = points[k, :2] - draws[:, k, :2].mean(axis=0)
        inside += off @ np.linalg.solve(np.cov(draws[:, k, :2].T), off) < chdtri(2, 1 - level)
    return int(inside)


@claim("2021-36", "IV-C", "(1 - 1/31) 100 % is a level of 97 %.", "97 %", "rounds to it")
def level(results):
    count = len(results.table(f"posterior/T{results.samples[0]}")) // 3
    value = 100 * (1 - 1 / count)
    return Outcome(f"{value:.2f} %", "none", judge(round(value) == 97))


@claim(
    "2021-37",
    "IV-C",
    "Confidence ellipses at 97 % hold the true position in 97 % of the cases: in simulation.",
    "97 %",
    "covered out of 31 at the largest T not below the 0.1 % point of the binomial (26)",
)
def coverage(results):
    name = f"T{results.samples[-1]}"
    if not results.json(f"posterior/{name}")["converged"]:
        return untested(f"{results.unconverged(name)}: its ellipses mean nothing")
    table = results.table(f"posterior/{name}")
    inside = covered(results.draws(name), table.truth_m.to_numpy().reshape(-1, 3))
    count, share = len(table) // 3, 1 / 31
    error = np.sqrt(count * share * (1 - share))
    remark = f"median sd {show(table.sd_m.median())} m"
    return Outcome(f"{inside} of {count}", show(error, 2), judge(inside >= 26), remark)


@claim(
    "2021-38",
    "V",
    "More time samples cost more computation.",
    "grows with T",
    "seconds a transition rise with T, N as tuned",
    clock=True,
)
def costs(results):
    table = results.table("claims/timing")
    rows = table[table.what == "transition"].sort_values("samples")
    value = f"{listed(1e6 * rows.seconds)} us for T = {listed(rows.samples)}"
    remark = (
        f"{show(rows.seconds.iloc[-1] / rows.seconds.iloc[0], 2)} times from the first to the last"
    )
    return Outcome(
        value,
        f"{listed(1e6 * rows.spread_s, 2)} us",
        judge(bool(np.all(np.diff(rows.seconds) > 0))),
        remark,
    )


@claim(
    "2021-39",
    "V",
    "30 minutes, 1 hour and 8 hours for T = 5, 50 and 500 on 40 processors.",
    "20, 40, 320 core-hours",
    "needs the same processors and the same number of steps",
    clock=True,
)
def run_time(results):
    hours, steps = {}, {}
    for samples, verdict in _verdicts(results).items():
        row = results.benchmark(f"chains/T{samples}").iloc[0]
        # its processor time is sampled: half of a job of 30 s is not in it
        hours[samples], steps[samples] = row.s / 3600, verdict["steps"] * verdict["chains"]
    last, first = results.samples[-1], results.samples[0]
    each = (hours[last] / steps[last]) / (hours[first] / steps[first])
    reason = (
        f"neither number of steps nor code is published; ours for {by_samples(steps, 7)} steps,"
        " start-up"
        f" included; a step at T = {last} costs {show(each, 2)} times one at T = {first}, the"
        " paper's"
        " runs 16 times"
    )
    return untested(reason, f"{by_samples(hours, 2)} hours on one or two cores")
