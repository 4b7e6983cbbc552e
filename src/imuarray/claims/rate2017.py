"""Paper 2017, figure 3: the angular rate when positions are wrong."""

from __future__ import annotations

import numpy as np

from imuarray.claims.numbers import listed, ratio, show
from imuarray.claims.registry import Outcome, claim, judge, untested

COMPARABLE = 2.0  # "comparable" in the papers: within this factor
SAME = 1.3  # "comparable to having no error at all"


def _rows(results, position_sd, saturated):
    """Rows of figure 3 for a position error, below or above the gyroscopes' range."""
    table = results.table("calibration/rate_error")
    rail = results.settings["paper2017"]["gyroscope_range_dps"]
    chosen = (table.angular_rate_dps > rail) == saturated
    return table[chosen & np.isclose(table.position_sd_m, position_sd, rtol=1e-6, atol=0)]


def _average(results) -> float:
    """sigma_g / sqrt(G), deg/s: what averaging all gyroscopes gives while none saturates."""
    return float(results.table("claims/accelerometers_only").gyroscopes_average_dps.iloc[0])


def _against_average(results, saturated):
    rows = _rows(results, 1e-5, saturated)
    ratios = rows.array_rmse_dps / _average(results)
    errors = rows.array_rmse_se_dps / _average(results)
    value = f"{listed(ratios)} at {listed(rows.angular_rate_dps)} deg/s"
    return ratios, errors, value


@claim(
    "2017-14",
    "IV, figure 3",
    "A position error of 1e-4 m explains the error measured in the experiments of [4].",
    "1e-4 m",
    "needs the measured error",
)
def explains(results):
    rows = _rows(results, 1e-4, True)
    value = f"RMSE {listed(rows.array_rmse_dps)} deg/s at {listed(rows.angular_rate_dps)} deg/s"
    error = f"{listed(rows.array_rmse_se_dps, 2)} deg/s"
    return untested(
        "the measured error is in another paper's figure, not in the text", value, error
    )


@claim(
    "2017-15",
    "IV, figure 3",
    "To come close to averaging the gyroscopes 1e-5 m is needed: below their saturation.",
    "comparable",
    "RMSE / (sigma_g / sqrt(G)) at 1e-5 m, plus 3 errors, below 2 at every rate under the range",
)
def ten_micrometres_below(results):
    ratios, errors, value = _against_average(results, False)
    rough = _rows(results, 1e-3, False).array_rmse_dps.max() / _average(results)
    remark = (
        f"but nothing is needed there: 1e-3 m gives at most {show(rough)}, since the ML weights"
        " let the gyroscopes decide"
    )
    stands = np.all(ratios + 3 * errors < COMPARABLE)
    return Outcome(value, listed(errors, 2), judge(stands), remark)


@claim(
    "2017-16",
    "IV, figure 3",
    "To come close to averaging the gyroscopes 1e-5 m is needed: above their saturation.",
    "comparable",
    "RMSE / (sigma_g / sqrt(G)) at 1e-5 m, plus 3 errors, below 2 at every rate above the range",
)
def ten_micrometres_above(results):
    ratios, errors, value = _against_average(results, True)
    none = _rows(results, 0.0, True).array_rmse_dps / _average(results)
    remark = (
        f"with no position error {listed(none)}: noise alone keeps the accelerometers behind what"
        " unsaturated gyroscopes would give"
    )
    stands = np.all(ratios + 3 * errors < COMPARABLE)
    return Outcome(value, listed(errors, 2), judge(stands), remark)


def _against_none(results, saturated):
    fine, none = (_rows(results, sd, saturated) for sd in (1e-6, 0.0))
    found = [
        ratio(a.array_rmse_dps, a.array_rmse_se_dps, b.array_rmse_dps, b.array_rmse_se_dps)
        for (_, a), (_, b) in zip(fine.iterrows(), none.iterrows(), strict=True)
    ]
    values, errors = map(np.array, zip(*found, strict=True))
    stands = np.all(np.maximum(values, 1 / values) - 3 * errors < SAME)
    text = f"{listed(values)} at {listed(none.angular_rate_dps)} deg/s"
    return Outcome(text, listed(errors, 2), judge(stands))


@claim(
    "2017-17",
    "IV, figure 3",
    "A position error of 1e-6 m is as good as none: below saturation.",
    "comparable",
    "RMSE at 1e-6 m / RMSE at none within a factor 1.3 (3 errors allowed)",
)
def one_micrometre_below(results):
    return _against_none(results, False)


@claim(
    "2017-18",
    "IV, figure 3",
    "A position error of 1e-6 m is as good as none: above saturation.",
    "comparable",
    "RMSE at 1e-6 m / RMSE at none within a factor 1.3 (3 errors allowed)",
)
def one_micrometre_above(results):
    return _against_none(results, True)


def _alone(results, position_sd):
    """Accelerometers only: RMSE over the gyroscopes' average, its errors, the rates."""
    table = results.table("claims/accelerometers_only")
    rows = table[np.isclose(table.position_sd_m, position_sd, rtol=1e-6, atol=0)]
    return (rows.rmse_dps / rows.gyroscopes_average_dps, rows.rmse_se_dps
            / rows.gyroscopes_average_dps, rows.angular_rate_dps)  # fmt: skip


@claim(
    "2017-19",
    "V",
    "Positions worse than 10 um make the rate from the accelerometers alone worse than the"
    " gyroscopes' average.",
    "worse beyond 1e-5 m",
    "at 1e-4 m RMSE / average, less 3 errors, above 1 at every rate simulated",
)
def alone_worse(results):
    ratios, errors, rates = _alone(results, 1e-4)
    value = f"{listed(ratios)} at {listed(rates)} deg/s"
    remark = "the paper writes angular acceleration, which gyroscopes do not measure: rate is meant"
    return Outcome(value, listed(errors, 2), judge(np.all(ratios - 3 * errors > 1)), remark)


@claim(
    "2017-20",
    "V",
    "... so that up to 10 um the accelerometers alone are as good as the gyroscopes' average.",
    "10 um is the limit",
    "at 1e-5 m RMSE / average, plus 3 errors, below 2 at some rate simulated",
)
def alone_as_good(results):
    ratios, errors, rates = _alone(results, 1e-5)
    none = _alone(results, 0.0)[0]
    remark = (
        f"without any position error {listed(none)}: with sigma_a = 0.04 m/s^2 on this board the"
        " accelerometers alone stay behind 32 gyroscopes at these rates"
    )
    stands = np.any(ratios + 3 * errors < COMPARABLE)
    return Outcome(
        f"{listed(ratios)} at {listed(rates)} deg/s", listed(errors, 2), judge(stands), remark
    )


@claim(
    "2017-21",
    "IV, V",
    "10 um is where position errors begin to matter for the accelerometers alone.",
    "1e-5 m",
    "highest rate: RMSE at 1e-6 m within 1.3, at 1e-5 m above 1.3 times that at none",
)
def where_it_matters(results):
    values = {sd: [x.iloc[-1] for x in _alone(results, sd)] for sd in (0.0, 1e-6, 1e-5)}
    none = values[0.0]
    fine, coarse = (ratio(*values[sd][:2], *none[:2]) for sd in (1e-6, 1e-5))
    stands = fine[0] - 3 * fine[1] < SAME < coarse[0] - 3 * coarse[1]
    text = f"{show(fine[0])} at 1e-6 m, {show(coarse[0])} at 1e-5 m ({show(none[2])} deg/s)"
    return Outcome(text, f"{show(fine[1], 2)}, {show(coarse[1], 2)}", judge(stands))


@claim(
    "2017-22",
    "II, from [4]",
    "Fusing the accelerometers improves on averaging the gyroscopes: below saturation.",
    "improves",
    "exact positions: RMSE / the gyroscopes' average's, plus 3 errors, below 0.99 at some rate",
)
def improves_below(results):
    rows = _rows(results, 0.0, False)
    ratios, errors = ratio(
        rows.array_rmse_dps, rows.array_rmse_se_dps,
        rows.gyroscopes_rmse_dps, rows.gyroscopes_rmse_se_dps,
    )  # fmt: skip
    value = f"{listed(ratios, 6)} at {listed(rows.angular_rate_dps)} deg/s"
    remark = (
        "errors as if both were independent, an upper limit: they see the same noise, so the ratio"
        " is known far better; the accelerometers add next to nothing here"
    )
    stands = np.any(ratios + 3 * errors < 0.99)
    return Outcome(value, listed(errors, 2), judge(stands), remark)


@claim(
    "2017-23",
    "II, from [4]",
    "Fusing the accelerometers improves on averaging the gyroscopes: above saturation.",
    "improves",
    "exact positions: RMSE / the gyroscopes' actual average below 1 by 3 errors everywhere",
)
def improves_above(results):
    rows = _rows(results, 0.0, True)
    ratios = rows.array_rmse_dps / rows.gyroscopes_rmse_dps
    errors = rows.array_rmse_se_dps / rows.gyroscopes_rmse_dps
    value = f"{listed(ratios)} at {listed(rows.angular_rate_dps)} deg/s"
    return Outcome(value, listed(errors, 2), judge(np.all(ratios + 3 * errors < 1)))
