"""Paper 2017: the proof mass, ranges, and what the paper quotes."""

from __future__ import annotations

import numpy as np

from imuarray.claims.numbers import listed, show
from imuarray.claims.registry import claim, judged, untested

GRAVITY = 9.80665  # m/s^2


def displacement(acceleration, frequency):
    """(6): d = y / (2 pi f)^2 in metres."""
    return acceleration / (2 * np.pi * np.asarray(frequency)) ** 2


@claim("2017-36")
def tens_of_nanometres(results):
    found = 1e9 * displacement(GRAVITY, [2000.0, 3000.0, 5000.0])
    stands = np.all((found > 9.5) & (found < 100))
    remark = f"1 kHz would give {show(1e9 * displacement(GRAVITY, 1000.0))} nm"
    return judged(f"{listed(found)} nm at 2, 3, 5 kHz", "none", stands, remark)


@claim("2017-37")
def thirty_nanometres(results):
    found = 1e9 * displacement(GRAVITY * np.array([2.0, 3.0]), 5000.0)
    return judged(f"{listed(found)} nm", "none", abs(found[1] / 30 - 1) < 0.1)


@claim("2017-38")
def factor_thirty(results):
    factor = float(1e-6 / displacement(3 * GRAVITY, 5000.0))
    return judged(factor, "none", abs(factor / 30 - 1) < 0.25)


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
    return judged(f"{show(100 * share)} %", "", share < 0.01)


@claim("2017-41")
def elements(results):
    unknowns = int(results.table("claims/ranks").unknowns.max())
    found = 9 * (unknowns // 3 + 1)
    return judged(str(found), "none", found == 288)


@claim("2017-42")
def few_seconds(results):
    return untested("the paper gives no sampling rate; 1000 samples in 5 s would need 200 Hz")


@claim("2017-43")
def other_method(results):
    return untested("quoted from [14]: another array, another method, measured data not published")
