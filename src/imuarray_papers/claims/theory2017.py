"""Paper 2017: identifiability and cost; the proof mass, ranges, and what the paper quotes."""

import numpy as np

from imuarray.recording.units import GRAVITY
from imuarray_papers.claims.numbers import listed, show, tiny
from imuarray_papers.claims.registry import claim, untested, verdict

EXACT = "rounding only"
TINY = 1e-9
LEMMA, INVARIANCES, COMMON_AXIS, ACCELERATIONS = (
    f"claims/identifiability:{part}"
    for part in ("lemma", "invariances", "common_axis", "accelerations")
)
RANKS, DEPENDENCE = "claims/ranks", "claims/dependence"


@claim("2017-25", "claims/inner_steps")
def linear_operations(table):
    each = table.inner_steps / table.samples
    value = f"{listed(each)} steps a sample for N = {listed(table.samples, 5)}"
    return verdict(value, "", each.iloc[-1] <= 1.1 * each.iloc[0] + 0.1)


@claim("2017-26", INVARIANCES)
def one_inverse(found):
    size, difference = found["normal_matrix_size"], found["shared_inverse_difference_m"]
    value = f"{size}; difference {tiny(difference, 1e-12)} m"
    return verdict(value, EXACT, size == [3, 3] and difference < 1e-12)


@claim("2017-27", INVARIANCES, name="translation_position_change_m", limit=1e-12, unit=" m")
@claim("2017-28", INVARIANCES, name="origin_relative")
@claim("2017-30", LEMMA, name="eigenvalue_relative")
@claim("2021-15", "claims/marginalisation:log_sum_exp", name="worst_relative", limit=1e-12)
def rounding_only(found, name, limit=TINY, unit=""):
    change = found[name]
    return verdict(f"{tiny(change, limit)}{unit}", EXACT, change < limit)


@claim("2017-29", LEMMA)
def lemma(found):
    value = f"{found['parallel_rank_2']} of {found['draws']} draws"
    return verdict(value, "", found["parallel_rank_2"] == found["draws"])


@claim("2017-31", LEMMA)
def not_parallel(found):
    value = f"rank 3 in {found['free_rank_3']} of {found['draws']} draws that are not parallel"
    remark = (
        "also sufficient: det A_n = -|omega x omega_dot|^2, here to a relative"
        f" difference {tiny(found['determinant_relative'], TINY)}"
    )
    return verdict(value, "", found["parallel_rank_2"] == found["draws"], remark)


@claim("2017-32", LEMMA, COMMON_AXIS)
def unique(lemma, axis):
    remark = (
        "not necessary: parallel in each sample but with axes that vary the stack has rank"
        f" {axis['axes vary, motion known']} of 3; with one common axis"
        f" {axis['one axis, motion known']}; for unknown motion see 2017-35"
    )
    value = f"rank 3 in {lemma['free_rank_3']} of {lemma['draws']} draws"
    return verdict(value, "", lemma["free_rank_3"] == lemma["draws"], remark)


@claim("2017-33", RANKS)
def counting(table):
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


@claim("2017-34", "claims/identifiability:motion_needs")
def observable(found):
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


@claim("2017-35", RANKS, COMMON_AXIS)
def not_sufficient(table, axis):
    lacking = table[table["rank"] < table.unknowns]
    which = listed(sorted(set(lacking.samples)))
    value = f"deficient for N = {which} in {len(lacking)} of {len(table)} cases"
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


@claim("2017-39", ACCELERATIONS)
def two_to_three_g(accelerations):
    cases = [
        (f"|s| = {show(found['specific_force_mps2'])} m/s^2 at the {place}",
         found[f"{name}_largest_quantiles_g"], found[f"{name}_largest_median_se_g"])
        for found in accelerations
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


@claim("2017-40", ACCELERATIONS)
def just_below(accelerations):
    share = accelerations[1]["saturated_share"]
    return verdict(f"{show(100 * share)} %", "", share < 0.01)


@claim("2017-41", RANKS)
def elements(table):
    found = 9 * (int(table.unknowns.max()) // 3 + 1)
    return verdict(str(found), "none", found == 288)


@claim("2017-42")
@claim("2017-43")
def not_here(results):
    return untested()


@claim("2017-46", DEPENDENCE)
def expected(table):
    table = table.set_index("change").factor
    table = table.drop(["one gyroscope", "angular acceleration", "specific force"])
    little = np.abs(table - 1) < 0.01
    value = "; ".join(f"{name} {show(factor)}" for name, factor in table.items())
    remark = f"no matter at these rates: {', '.join(table.index[little])}" if little.any() else ""
    return verdict(f"factor by half of: {value}", "", not little.any(), remark)


@claim("2017-47", DEPENDENCE)
def one_gyroscope(table):
    factor = table.set_index("change").factor["one gyroscope"]
    value = f"one gyroscope widens the bound by {100 * (factor - 1):.2g} %"
    return verdict(value, "", factor < 1.01)


@claim("2017-48", "claims/statements:bound_m")
def any_motion(bounds):
    value = "; ".join(f"{name} {show(size)} m" for name, size in bounds.items())
    return verdict(value, "", max(bounds.values()) < 1e-5)


@claim("2017-49", "claims/statements:motion")
def motion_bound(found):
    stands = abs(found["ratio"] - 1) < max(0.02, 3 * found["se"])
    return verdict(found["ratio"], found["se"], stands)
