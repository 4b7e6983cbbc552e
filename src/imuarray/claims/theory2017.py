"""Paper 2017, sections II and III: identifiability and cost."""

from __future__ import annotations

import numpy as np

from imuarray.claims.numbers import listed, power_law, show
from imuarray.claims.registry import Outcome, claim, judge

EXACT = "rounding only"
TINY = 1e-9


def _checks(results, part):
    return results.json("claims/identifiability")[part]


@claim(
    "2017-24",
    "III",
    "One iteration costs time linear in N.",
    "O(N)",
    "growth exponent of the processor time an iteration takes, three largest N, within 0.4 + 3"
    " errors of 1",
    clock=True,
)
def linear_time(results):
    table = results.table("claims/timing")
    curve = table[table.what == "iteration"].sort_values("samples").tail(3)
    slope, error = power_law(curve.samples, curve.seconds, curve.spread_s)
    value = f"{show(slope)} ({listed(1e3 * curve.seconds)} ms for N = {listed(curve.samples, 5)})"
    return Outcome(value, show(error, 2), judge(abs(slope - 1) <= 0.4 + 3 * error))


@claim(
    "2017-25",
    "III",
    "The operations of one iteration are linear in N.",
    "O(N)",
    "inner Gauss-Newton steps a sample do not grow with N (all other loops are N long)",
)
def linear_operations(results):
    table = results.table("claims/inner_steps")
    each = table.inner_steps / table.samples
    value = f"{listed(each)} steps a sample for N = {listed(table.samples, 5)}"
    stands = each.iloc[-1] <= 1.1 * each.iloc[0] + 0.1
    return Outcome(value, "", judge(stands))


@claim(
    "2017-26",
    "III",
    "The inverse of sum A'A has a size that does not depend on N and serves all K accelerometers.",
    "once, constant cost",
    "3 x 3, and the positions from it equal separate least squares for each triad",
)
def one_inverse(results):
    found = _checks(results, "invariances")
    size, difference = found["normal_matrix_size"], found["shared_inverse_difference_m"]
    value = f"{size}; difference {show(difference, 2)} m"
    stands = size == [3, 3] and difference < 1e-12
    return Outcome(value, EXACT, judge(stands))


@claim(
    "2017-27",
    "IV",
    "Translational acceleration enters linearly and leaves the estimate itself unchanged.",
    "no effect",
    "positions from the same data with and without 1000 m/s^2 of translation agree to 1e-12 m",
)
def translation_exact(results):
    change = _checks(results, "invariances")["translation_position_change_m"]
    return Outcome(f"{show(change, 2)} m", EXACT, judge(change < 1e-12))


@claim(
    "2017-28",
    "II",
    "The model does not depend on the origin: only relative positions can be estimated.",
    "independent",
    "shifting all triads by metres, s following, changes no measurement (relative 1e-9)",
)
def origin(results):
    change = _checks(results, "invariances")["origin_relative"]
    return Outcome(show(change, 2), EXACT, judge(change < TINY))


@claim(
    "2017-29",
    "appendix",
    "Lemma 1: A^2 + B has rank 2 for parallel skew-symmetric A, B.",
    "rank 2",
    "rank 2 in every random draw",
)
def lemma(results):
    found = _checks(results, "lemma")
    value = f"{found['parallel_rank_2']} of {found['draws']} draws"
    return Outcome(value, "", judge(found["parallel_rank_2"] == found["draws"]))


@claim(
    "2017-30",
    "appendix",
    "Its eigenvalues are -l^2 + kli, -l^2 - kli and 0.",
    "as written",
    "relative difference below 1e-9 in every draw",
)
def eigenvalues(results):
    worst = _checks(results, "lemma")["eigenvalue_relative"]
    return Outcome(show(worst, 2), EXACT, judge(worst < TINY))


@claim(
    "2017-31",
    "III",
    "For A_n to have full rank omega and omega_dot must not be parallel.",
    "necessary",
    "rank 2 in every parallel draw (and, not claimed, 3 in every other)",
)
def not_parallel(results):
    found = _checks(results, "lemma")
    value = f"rank 3 in {found['free_rank_3']} of {found['draws']} draws that are not parallel"
    remark = (
        "also sufficient: det A_n = -|omega x omega_dot|^2, here to a relative"
        f" {show(found['determinant_relative'], 2)}"
    )
    return Outcome(value, "", judge(found["parallel_rank_2"] == found["draws"]), remark)


@claim(
    "2017-32",
    "III",
    "With the motion known, the positions in (9) are unique if omega and omega_dot are not"
    " parallel in all samples.",
    "sufficient",
    "A_n of rank 3 in every draw that is not parallel: then the stack of (9) has rank 3 too",
)
def unique(results):
    lemma, axis = _checks(results, "lemma"), _checks(results, "common_axis")
    remark = (
        "not necessary: parallel in each sample but with axes that vary the stack has rank"
        f" {axis['axes vary, motion known']} of 3; with one common axis"
        f" {axis['one axis, motion known']}; for unknown motion see 2017-35"
    )
    value = f"rank 3 in {lemma['free_rank_3']} of {lemma['draws']} draws"
    return Outcome(value, "", judge(lemma["free_rank_3"] == lemma["draws"]), remark)


@claim(
    "2017-33",
    "II",
    "Counting measurements, N >= (K - 1)/(K - 2) is necessary, so N >= 2.",
    "N >= (K - 1)/(K - 2)",
    "no full joint rank, motion unknown, where the count forbids it, for K = 3 ... 32",
)
def counting(results):
    table = results.table("claims/ranks")
    full = table["rank"] == table.unknowns
    counted = table.measurements >= table.all_unknowns
    broken = int(np.sum(full & ~table.count_allows)) + int(np.sum(counted != table.count_allows))
    least = table[full].groupby("triads").samples.min()
    value = f"{broken} contradictions"
    value += f"; least N with full rank {listed(least)} for K = {listed(least.index)}"
    remark = "for random motion the count is also sufficient: one gyroscope, K >= 3, N >= 2"
    if np.any(~full & table.count_allows):
        remark = "not sufficient: some ranks are deficient though the count allows them"
    return Outcome(value, "", judge(broken == 0), remark)


@claim(
    "2017-34",
    "II, from [4]",
    "The motion is observable if and only if there are three accelerometers spanning a plane and"
    " one gyroscope.",
    "3 + 1",
    "rank 9 with them; without the third or the plane rank below 9; without the gyroscope not"
    " unique",
)
def observable(results):
    found = _checks(results, "motion_needs")
    best = found["three spanning a plane, with gyroscope"]
    few = max(found["two, with gyroscope"], found["three on a line, with gyroscope"])
    value = f"rank {best} of 9 with, {few} with two or a line"
    remark = (
        f"without a gyroscope the rank is {found['three spanning a plane, without']} while"
        " turning and"
        f" {found['rank without gyroscope at rest']} at rest: only the sign of omega is lost"
        " while turning"
    )
    stands = best == 9 and few < 9 and found["sign_blind"]
    return Outcome(value, "", judge(stands), remark)


@claim(
    "2017-35",
    "II",
    "These conditions are necessary but not sufficient for the calibration.",
    "not sufficient",
    "rank deficient for some N with three or more triads and a gyroscope",
)
def not_sufficient(results):
    table = results.table("claims/ranks")
    lacking = table[table["rank"] < table.unknowns]
    which = listed(sorted(set(lacking.samples)))
    value = f"deficient for N = {which} in {len(lacking)} of {len(table)} cases"
    axis = _checks(results, "common_axis")
    remark = (
        "joint rank, motion unknown; omega and omega_dot along one axis in all samples give"
        f" {axis['one axis']} of {axis['unknowns']}, along axes that vary {axis['axes vary']}"
    )
    return Outcome(value, "", judge(len(lacking) > 0), remark)
