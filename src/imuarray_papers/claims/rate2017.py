"""Paper 2017, figure 3: the angular rate when positions are wrong."""

import numpy as np

from imuarray_papers.claims.numbers import listed, ratio, show
from imuarray_papers.claims.registry import claim, untested, verdict

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


def _at_rates(values, rates, digits: int = 3) -> str:
    return f"{listed(values, digits)} at {listed(rates)} deg/s"


@claim("2017-14")
def explains(results):
    rows = _rows(results, 1e-4, True)
    return untested(
        "the measured error is in another paper's figure, not in the text",
        f"RMSE {listed(rows.array_rmse_dps)} deg/s at {listed(rows.angular_rate_dps)} deg/s",
        f"{listed(rows.array_rmse_se_dps, 2)} deg/s",
    )


def _against_average(results, saturated, remark):
    rows = _rows(results, 1e-5, saturated)
    ratios = rows.array_rmse_dps / _average(results)
    errors = rows.array_rmse_se_dps / _average(results)
    stands = np.all(ratios + 3 * errors < COMPARABLE)
    return verdict(_at_rates(ratios, rows.angular_rate_dps), listed(errors, 2), stands, remark)


@claim("2017-15")
def ten_micrometres_below(results):
    rough = _rows(results, 1e-3, False).array_rmse_dps.max() / _average(results)
    remark = (
        f"but nothing is needed there: 1e-3 m gives at most {show(rough)}, since the ML weights"
        " let the gyroscopes decide"
    )
    return _against_average(results, False, remark)


@claim("2017-16")
def ten_micrometres_above(results):
    none = _rows(results, 0.0, True).array_rmse_dps / _average(results)
    remark = (
        f"with no position error {listed(none)}: noise alone keeps the accelerometers behind what"
        " unsaturated gyroscopes would give"
    )
    return _against_average(results, True, remark)


@claim("2017-17", saturated=False)
@claim("2017-18", saturated=True)
def one_micrometre(results, saturated):
    fine, none = (_rows(results, sd, saturated).set_index("angular_rate_dps") for sd in (1e-6, 0.0))
    values, errors = ratio(
        fine.array_rmse_dps, fine.array_rmse_se_dps, none.array_rmse_dps, none.array_rmse_se_dps
    )
    stands = np.all(np.maximum(values, 1 / values) - 3 * errors < SAME)
    return verdict(_at_rates(values, none.index), listed(errors, 2), stands)


def _alone(results, position_sd):
    """Accelerometers only: RMSE over the gyroscopes' average, its errors, the rates."""
    table = results.table("claims/accelerometers_only")
    rows = table[np.isclose(table.position_sd_m, position_sd, rtol=1e-6, atol=0)]
    parts = (rows[name] / rows.gyroscopes_average_dps for name in ("rmse_dps", "rmse_se_dps"))
    return *parts, rows.angular_rate_dps


@claim("2017-19")
def alone_worse(results):
    ratios, errors, rates = _alone(results, 1e-4)
    none, spread, _ = _alone(results, 0.0)
    remark = (
        f"without any position error {listed(none)}; the paper writes angular acceleration, which"
        " gyroscopes do not measure: rate is meant"
    )
    stands = np.all(ratios - 3 * errors > 1) and np.all(none - 3 * spread < 1)
    return verdict(_at_rates(ratios, rates), listed(errors, 2), stands, remark)


@claim("2017-20")
def alone_as_good(results):
    ratios, errors, rates = _alone(results, 1e-5)
    none = _alone(results, 0.0)[0]
    remark = (
        f"without any position error {listed(none)}: with sigma_a = 0.04 m/s^2 on this board the"
        " accelerometers alone stay behind 32 gyroscopes at these rates"
    )
    stands = np.any(ratios + 3 * errors < COMPARABLE)
    return verdict(_at_rates(ratios, rates), listed(errors, 2), stands, remark)


@claim("2017-21")
def where_it_matters(results):
    values = {sd: [x.iloc[-1] for x in _alone(results, sd)] for sd in (0.0, 1e-6, 1e-5)}
    none = values[0.0]
    fine, coarse = (ratio(*values[sd][:2], *none[:2]) for sd in (1e-6, 1e-5))
    stands = fine[0] - 3 * fine[1] < SAME < coarse[0] - 3 * coarse[1]
    text = f"{show(fine[0])} at 1e-6 m, {show(coarse[0])} at 1e-5 m ({show(none[2])} deg/s)"
    return verdict(text, f"{show(fine[1], 2)}, {show(coarse[1], 2)}", stands)


@claim("2017-22")
def improves_below(results):
    alone, errors, rates = _alone(results, 0.0)
    below = rates < results.settings["paper2017"]["gyroscope_range_dps"]
    if not below.any():
        return untested("no rate below saturation at this scale")
    # two independent estimates of one rate, weighted by their variances
    gain = 1 - (1 + alone[below] ** -2.0) ** -0.5
    spread = 2 * gain * errors[below] / alone[below]
    rows = _rows(results, 0.0, False)
    both = _at_rates(rows.array_rmse_dps / rows.gyroscopes_rmse_dps, rows.angular_rate_dps, 6)
    value = f"smaller by a share of {_at_rates(gain, rates[below], 2)}"
    remark = f"immaterial; simulated, of the same noise, {both}"
    return verdict(value, listed(spread, 2), bool(np.all(gain > 3 * spread)), remark)


@claim("2017-23")
def improves_above(results):
    rows = _rows(results, 0.0, True)
    ratios = rows.array_rmse_dps / rows.gyroscopes_rmse_dps
    errors = rows.array_rmse_se_dps / rows.gyroscopes_rmse_dps
    value = _at_rates(ratios, rows.angular_rate_dps)
    return verdict(value, listed(errors, 2), np.all(ratios + 3 * errors < 1))
