"""Paper 2017, sections II and III: identifiability and cost."""

from __future__ import annotations

import numpy as np

from imuarray.claims.numbers import listed, power_law, show
from imuarray.claims.registry import claim, judged

EXACT = "rounding only"
TINY = 1e-9


def _checks(results, part):
    return results.json("claims/identifiability")[part]


@claim("2017-24")
def linear_time(results):
    table = results.table("claims/timing")
    curve = table[table.what == "iteration"].sort_values("samples").tail(3)
    slope, error = power_law(curve.samples, curve.seconds, curve.spread_s)
    value = f"{show(slope)} ({listed(1e3 * curve.seconds)} ms for N = {listed(curve.samples, 5)})"
    return judged(value, error, abs(slope - 1) <= 0.4 + 3 * error)


@claim("2017-25")
def linear_operations(results):
    table = results.table("claims/inner_steps")
    each = table.inner_steps / table.samples
    value = f"{listed(each)} steps a sample for N = {listed(table.samples, 5)}"
    return judged(value, "", each.iloc[-1] <= 1.1 * each.iloc[0] + 0.1)


@claim("2017-26")
def one_inverse(results):
    found = _checks(results, "invariances")
    size, difference = found["normal_matrix_size"], found["shared_inverse_difference_m"]
    value = f"{size}; difference {show(difference, 2)} m"
    return judged(value, EXACT, size == [3, 3] and difference < 1e-12)


@claim("2017-27")
def translation_exact(results):
    change = _checks(results, "invariances")["translation_position_change_m"]
    return judged(f"{show(change, 2)} m", EXACT, change < 1e-12)


@claim("2017-28")
def origin(results):
    change = _checks(results, "invariances")["origin_relative"]
    return judged(show(change, 2), EXACT, change < TINY)


@claim("2017-29")
def lemma(results):
    found = _checks(results, "lemma")
    value = f"{found['parallel_rank_2']} of {found['draws']} draws"
    return judged(value, "", found["parallel_rank_2"] == found["draws"])


@claim("2017-30")
def eigenvalues(results):
    worst = _checks(results, "lemma")["eigenvalue_relative"]
    return judged(show(worst, 2), EXACT, worst < TINY)


@claim("2017-31")
def not_parallel(results):
    found = _checks(results, "lemma")
    value = f"rank 3 in {found['free_rank_3']} of {found['draws']} draws that are not parallel"
    remark = (
        "also sufficient: det A_n = -|omega x omega_dot|^2, here to a relative"
        f" {show(found['determinant_relative'], 2)}"
    )
    return judged(value, "", found["parallel_rank_2"] == found["draws"], remark)


@claim("2017-32")
def unique(results):
    lemma, axis = _checks(results, "lemma"), _checks(results, "common_axis")
    remark = (
        "not necessary: parallel in each sample but with axes that vary the stack has rank"
        f" {axis['axes vary, motion known']} of 3; with one common axis"
        f" {axis['one axis, motion known']}; for unknown motion see 2017-35"
    )
    value = f"rank 3 in {lemma['free_rank_3']} of {lemma['draws']} draws"
    return judged(value, "", lemma["free_rank_3"] == lemma["draws"], remark)


@claim("2017-33")
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
    return judged(value, "", broken == 0, remark)


@claim("2017-34")
def observable(results):
    found = _checks(results, "motion_needs")
    best = found["three spanning a plane, with gyroscope"]
    few = max(found["two, with gyroscope"], found["three on a line, with gyroscope"])
    value = f"rank {best} of 9 with, {few} with two or a line"
    remark = (
        f"without a gyroscope the rank is {found['three spanning a plane, without']} while"
        f" turning and {found['rank without gyroscope at rest']} at rest: only the sign of omega"
        " is lost while turning"
    )
    stands = best == 9 and few < 9 and found["sign_blind"]
    return judged(value, "", stands, remark)


@claim("2017-35")
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
    return judged(value, "", len(lacking) > 0, remark)
