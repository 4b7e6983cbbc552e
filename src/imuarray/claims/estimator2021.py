"""Paper 2021, sections II and III-A, III-B and the appendix: model, algebra, estimator."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.claims.numbers import listed, power_law, show
from imuarray.claims.registry import Outcome, claim, judge

EXACT = "rounding only"
UNBIASED = "four triads, T = 2; p from plain normal densities, none of the estimator's code"


def _found(results, part):
    return results.json("claims/marginalisation")[part]


@claim(
    "2021-01",
    "IV-A",
    "With 32 IMUs the posterior has 3 x 31 = 93 dimensions.",
    "93",
    "number of coordinates sampled",
)
def dimensions(results):
    size = len(results.table(f"posterior/T{results.samples[0]}"))
    return Outcome(str(size), "none", judge(size == 93))


@claim(
    "2021-02",
    "III-B",
    "Gyroscope measurements do not depend on the positions.",
    "independent",
    "predicted rates unchanged when the positions change by metres",
)
def gyroscopes(results):
    change = results.json("claims/identifiability")["invariances"]["gyroscope_change"]
    return Outcome(f"{show(change, 2)} rad/s", EXACT, judge(change == 0.0))


@claim(
    "2021-03",
    "III-A",
    "The naive estimator (10), all motion drawn from its prior, is practically infeasible.",
    "infeasible",
    "effective number of draws below 10 out of thousands, at one sample",
)
def naive(results):
    found = _found(results, "effective_draws")
    value = f"{show(found['naive'])} of {found['draws']} draws count"
    return Outcome(value, "", judge(found["naive"] < 10), "prior sds as simulated, not even flat")


@claim(
    "2021-04",
    "III-B",
    "Integrating the linear motion analytically lowers the estimator's variance.",
    "lower",
    "effective draws above ten times those with phi drawn from its prior",
)
def rao_blackwell(results):
    found = _found(results, "effective_draws")
    pair = show(found["rao_blackwellised"], 4), show(found["conditioned"])
    value = f"{pair[0]} against {pair[1]} of {found['draws']}"
    return Outcome(value, "", judge(found["rao_blackwellised"] > 10 * found["conditioned"]))


@claim(
    "2021-05",
    "III-A, III-B",
    "The likelihood estimator is unbiased for any N.",
    "unbiased",
    "mean of p-hat / p within 4 errors of 1 for every N; p by Gauss-Hermite quadrature",
)
def unbiased(results):
    rows = _found(results, "unbiased")
    off = [(row["mean_ratio"] - 1) / row["mean_se"] for row in rows]
    value = ", ".join(f"{row['mean_ratio']:.5f}" for row in rows)
    value += f" for N = {listed([row['draws'] for row in rows])}"
    errors = listed([row["mean_se"] for row in rows], 2)
    return Outcome(value, errors, judge(np.max(np.abs(off)) < 4), UNBIASED)


@claim(
    "2021-06",
    "III-A",
    "The estimator's variance is inversely proportional to N.",
    "exponent -1",
    "fitted exponent of Var(p-hat) within max(0.05, 3 errors) of -1",
)
def variance_of_estimate(results):
    rows = pd.DataFrame(_found(results, "unbiased"))
    errors = rows.relative_variance * np.sqrt(2 / (rows.realisations - 1))
    slope, error = power_law(rows.draws, rows.relative_variance, errors)
    return Outcome(show(slope), show(error, 2), judge(abs(slope + 1) <= max(0.05, 3 * error)))


@claim(
    "2021-07",
    "III-B",
    "S H = 0: the range of H is the null space of S.",
    "0",
    "relative size below 1e-9, and rank S = 3A - 6",
)
def null_space(results):
    found = _found(results, "limits")
    value = f"{show(found['SH_relative'], 2)}; rank {found['rank_S']} of {found['size']}"
    stands = found["SH_relative"] < 1e-9 and found["rank_S"] == found["size"] - 6
    return Outcome(value, EXACT, judge(stands))


@claim(
    "2021-08",
    "III-B",
    "(20) and (21) are the inverse and the determinant of M_t.",
    "identities",
    "both hold to 1e-9",
)
def identities(results):
    found = _found(results, "limits")
    pair = found["inverse_identity"], abs(found["determinant_identity"])
    return Outcome(f"{show(pair[0], 2)}, {show(pair[1], 2)}", EXACT, judge(max(pair) < 1e-9))


def _limit(results, column):
    """Exponent in beta of the distance from the limit, and the last distance."""
    table = np.array(_found(results, "limits")["beta_quadratic_determinant"])
    used = table[3:9]
    slope = np.polyfit(np.log(used[:, 0]), np.log(used[:, column]), 1)[0]
    return slope, table[-1, column], table[-1, 0]


@claim(
    "2021-09",
    "III-B",
    "(22), (24): the quadratic form tends to that with S, free of the prior, as beta grows.",
    "limit",
    "distance falls as 1/beta (exponent within 0.05 of -1)",
)
def quadratic_limit(results):
    slope, last, beta = _limit(results, 1)
    value = f"exponent {show(slope, 4)}; relative distance {show(last, 2)} at beta = {show(beta)}"
    return Outcome(value, EXACT, judge(abs(slope + 1) < 0.05 and last < 1e-4))


@claim(
    "2021-10",
    "III-B",
    "(23): |M_t| / (|beta F_t| |Q|) tends to |H' Lambda H|.",
    "limit",
    "distance falls as 1/beta (exponent within 0.05 of -1)",
)
def determinant_limit(results):
    slope, last, beta = _limit(results, 2)
    value = f"exponent {show(slope, 4)}; relative distance {show(last, 2)} at beta = {show(beta)}"
    return Outcome(value, EXACT, judge(abs(slope + 1) < 0.05 and last < 1e-4))


@claim(
    "2021-11",
    "III-B",
    "(25) and (26a): the density carries |H' Lambda H|^-1.",
    "power -1",
    "power found in the normalised density (19) at large beta within 0.01 of -1",
)
def printed_power(results):
    found = _found(results, "determinant")
    remark = "(19) has the root of |M_t|, so (23) enters with power -1/2: print lost the root"
    stands = abs(found["power"] - 1) < 0.01
    return Outcome(show(-found["power"], 4), show(found["misfit"], 2), judge(stands), remark)


def _effect(results, prefix):
    table = results.table("claims/determinant")
    names = [f"{prefix}T{samples}" for samples in results.samples]
    return table[table.name.isin(names) & (table.method == "linearised")]


def _effect_outcome(results, prefix, remark):
    rows = _effect(results, prefix)
    value = (
        f"mean moves by up to {listed(rows.shift_max_sd, 2)} sd; sds by a factor"
        f" {listed(rows.width_ratio_min, 5)} for T = {listed(rows.samples)}"
    )
    stands = rows.shift_max_sd.max() < 0.1 and np.all(np.abs(rows.width_ratio_min - 1) < 0.1)
    return Outcome(value, "none: linearised", judge(stands), remark)


@claim(
    "2021-12",
    "III-B, IV-A",
    "(26a) as printed samples the posterior: sigma_a = 0.04 m/s^2.",
    "targets p(theta | y)",
    "no coordinate's mean moves by 0.1 sd, no sd by 10 %",
)
def printed_small_noise(results):
    tiny = results.table("claims/determinant")
    pair = tiny[tiny.name.str.startswith("tiny") & (tiny.samples == tiny.samples.min())]
    checked = "; ".join(
        f"{row['name']} {row.method} {show(row.shift_max_sd, 2)}" for _, row in pair.iterrows()
    )
    return _effect_outcome(
        results, "", f"four triads, T = {results.samples[0]}, largest shift: {checked}"
    )


@claim(
    "2021-13",
    "III-B, IV-C",
    "(26a) as printed samples the posterior: sigma_a = 0.79 m/s^2.",
    "targets p(theta | y)",
    "no coordinate's mean moves by 0.1 sd, no sd by 10 %",
)
def printed_large_noise(results):
    along = _effect(results, "simulation_").shift_along_sd
    remark = f"along the worst direction, the array's size, {listed(along, 2)} sd; it grows with T"
    return _effect_outcome(results, "simulation_", remark)


@claim(
    "2021-14",
    "III-B",
    "Only omega is integrated numerically, in a subspace orthogonal to H.",
    "3 of 9 dimensions",
    "the six products of omega carry (26a) whole: equal to the 3A-dimensional form to 1e-6",
)
def six(results):
    found = _found(results, "six_dimensions")
    value = f"{found['dimensions']} of {found['full']} dimensions"
    value += f"; difference {show(found['difference'], 2)}"
    stands = found["dimensions"] == 6 and found["difference"] < 1e-6 * max(1, abs(found["value"]))
    return Outcome(value, EXACT, judge(stands))


@claim(
    "2021-15",
    "appendix A",
    "(31), (32) give log-sum-exp accurately by recursion.",
    "accurate",
    "relative error below 1e-12, exponents down to -1e5",
)
def log_sum_exp(results):
    found = _found(results, "log_sum_exp")
    return Outcome(show(found["worst_relative"], 2), EXACT, judge(found["worst_relative"] < 1e-12))


@claim(
    "2021-16",
    "III-C",
    "Without it the sum of exponentials under- or overflows.",
    "may fail",
    "smallest recording: the plain sum over draws of omega in (26) is 0 for some sample at a start"
    " of the chains, the prior mean or the truth",
)
def underflow(results):
    found = _found(results, "underflow")
    value = "; ".join(
        f"{row['place']}: {row['fails']} of {row['sums']} sums (median exponent"
        f" {show(row['median_exponent'])})"
        for row in found
    )
    return Outcome(value, "", judge(any(row["fails"] > 0 for row in found)))


@claim(
    "2021-17",
    "IV-C",
    "A motion without rotation gives no information on the positions.",
    "none",
    "joint rank of 20 samples without rotation, motion unknown, is 0",
)
def no_rotation(results):
    found = results.json("claims/identifiability")["common_axis"]
    value = f"rank {found['no rotation']} of {found['unknowns']}"
    return Outcome(value, EXACT, judge(found["no rotation"] == 0))
