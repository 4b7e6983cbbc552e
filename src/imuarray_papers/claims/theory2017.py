"""Paper 2017: identifiability and cost; the proof mass, ranges, and what the paper quotes."""

import numpy as np

from imuarray.recording.units import GRAVITY
from imuarray_papers.claims.numbers import listed, show, tiny
from imuarray_papers.claims.registry import claim, untested, verdict

EXACT = "rounding only"
TINY = 1e-9


def _checks(results, part):
    return results.json("claims/identifiability")[part]


@claim("2017-25")
def linear_operations(results):
    table = results.table("claims/inner_steps")
    each = table.inner_steps / table.samples
    value = f"{listed(each)} steps a sample for N = {listed(table.samples, 5)}"
    return verdict(value, "", each.iloc[-1] <= 1.1 * each.iloc[0] + 0.1)


@claim("2017-26")
def one_inverse(results):
    found = _checks(results, "invariances")
    size, difference = found["normal_matrix_size"], found["shared_inverse_difference_m"]
    value = f"{size}; difference {tiny(difference, 1e-12)} m"
    return verdict(value, EXACT, size == [3, 3] and difference < 1e-12)


@claim("2017-27", part="invariances", name="translation_position_change_m", limit=1e-12, unit=" m")
@claim("2017-28", part="invariances", name="origin_relative", limit=TINY)
@claim("2017-30", part="lemma", name="eigenvalue_relative", limit=TINY)
def rounding_only(results, part, name, limit, unit=""):
    change = _checks(results, part)[name]
    return verdict(f"{tiny(change, limit)}{unit}", EXACT, change < limit)


@claim("2017-29")
def lemma(results):
    found = _checks(results, "lemma")
    value = f"{found['parallel_rank_2']} of {found['draws']} draws"
    return verdict(value, "", found["parallel_rank_2"] == found["draws"])


@claim("2017-31")
def not_parallel(results):
    found = _checks(results, "lemma")
    value = f"rank 3 in {found['free_rank_3']} of {found['draws']} draws that are not parallel"
    remark = (
        "also sufficient: det A_n = -|omega x omega_dot|^2, here to a relative"
        f" difference {tiny(found['determinant_relative'], TINY)}"
    )
    return verdict(value, "", found["parallel_rank_2"] == found["draws"], remark)


@claim("2017-32")
def unique(results):
    lemma, axis = _checks(results, "lemma"), _checks(results, "common_axis")
    remark = (
        "not necessary: parallel in each sample but with axes that vary the stack has rank"
        f" {axis['axes vary, motion known']} of 3; with one common axis"
        f" {axis['one axis, motion known']}; for unknown motion see 2017-35"
    )
    value = f"rank 3 in {lemma['free_rank_3']} of {lemma['draws']} draws"
    return verdict(value, "", lemma["free_rank_3"] == lemma["draws"], remark)


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
    return verdict(value, "", broken == 0, remark)


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
    return verdict(value, "", stands, remark)


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
    return verdict(value, "", len(lacking) > 0, remark)


def displacement(acceleration, frequency):
    """(6): d = y / (2 pi f)^2 in metres."""
    return acceleration / (2 * np.pi * np.asarray(frequency)) ** 2


@claim("2017-36")
def tens_of_nanometres(results):
    found = 1e9 * displacement(GRAVITY, [2000.0, 3000.0, 5000.0])
    stands = np.all((found >= 9.5) & (found < 95))  # one digit
    remark = f"1 kHz would give {show(1e9 * displacement(GRAVITY, 1000.0))} nm"
    return verdict(f"{listed(found)} nm at 2, 3, 5 kHz", "none", stands, remark)


@claim("2017-37")
def thirty_nanometres(results):
    found = 1e9 * displacement(GRAVITY * np.array([2.0, 3.0]), 5000.0)
    return verdict(f"{listed(found)} nm", "none", abs(found[1] / 30 - 1) < 0.1)


@claim("2017-38")
def factor_thirty(results):
    factor = float(1e-6 / displacement(3 * GRAVITY, 5000.0))
    return verdict(factor, "none", abs(factor / 30 - 1) < 0.25)


@claim("2017-39")
def two_to_three_g(results):
    cases = [
        (f"|s| = {show(found['specific_force_mps2'])} m/s^2 at the {place}",
         found[f"{name}_largest_quantiles_g"], found[f"{name}_largest_median_se_g"])
        for found in results.json("claims/identifiability")["accelerations"]
        for name, place in (("middle", "array's middle"), ("reference", "reference triad"))
    ]  # fmt: skip
    medians = [quantiles[1] for _, quantiles, _ in cases]
    each = "; ".join(f"{show(q[1])} ({show(q[0])} to {show(q[2])}) g for {c}" for c, q, _ in cases)
    return untested(
        "|s| and where it acts are not given; largest triad's specific force, median over samples"
        f" (5 to 95 %): {each}",
        f"medians from {show(min(medians))} to {show(max(medians))} g",
        f"at most {show(max(error for *_, error in cases), 2)} g",
    )


@claim("2017-40")
def just_below(results):
    share = results.json("claims/identifiability")["accelerations"][1]["saturated_share"]
    return verdict(f"{show(100 * share)} %", "", share < 0.01)


@claim("2017-41")
def elements(results):
    unknowns = int(results.table("claims/ranks").unknowns.max())
    found = 9 * (unknowns // 3 + 1)
    return verdict(str(found), "none", found == 288)


NO_RATE = "the paper gives no sampling rate; 1000 samples in 5 s would need 200 Hz"
QUOTED = "quoted from [14]: another array, another method, measured data not published"


@claim("2017-42", reason=NO_RATE)
@claim("2017-43", reason=QUOTED)
def not_here(results, reason):
    return untested(reason)


def _statements(results, part):
    return results.json("claims/statements")[part]


@claim("2017-46")
def expected(results):
    table = results.table("claims/dependence").set_index("change").factor
    table = table.drop(["one gyroscope", "angular acceleration", "specific force"])
    little = np.abs(table - 1) < 0.01
    value = "; ".join(f"{name} {show(factor)}" for name, factor in table.items())
    remark = f"no matter at these rates: {', '.join(table.index[little])}" if little.any() else ""
    return verdict(f"factor by half of: {value}", "", not little.any(), remark)


@claim("2017-47")
def one_gyroscope(results):
    row = results.table("claims/dependence").set_index("change").loc["one gyroscope"]
    value = f"one gyroscope widens the bound by {100 * (row.factor - 1):.2g} %"
    return verdict(value, "", row.factor < 1.01)


@claim("2017-48")
def any_motion(results):
    bounds = _statements(results, "bound_m")
    value = "; ".join(f"{name} {show(size)} m" for name, size in bounds.items())
    return verdict(value, "", max(bounds.values()) < 1e-5)


@claim("2017-49")
def motion_bound(results):
    found = _statements(results, "motion")
    stands = abs(found["ratio"] - 1) < max(0.02, 3 * found["se"])
    remark = "motion and positions from the same samples, against the bound of known positions"
    return verdict(found["ratio"], found["se"], stands, remark)
