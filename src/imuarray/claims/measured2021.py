"""Paper 2021, sections IV-B and IV-C: what only measured data can show."""

import numpy as np
from scipy.special import bdtr

from imuarray.claims.posterior2021 import covered
from imuarray.claims.registry import by_samples, claim, judged, listed, show, untested
from imuarray.errors import InputError


def _offsets(results):
    """Distance from the package centres (A - 1, 3) m, whether on top, draws; at the largest T.

    Labels and nominal positions are those of the measured recording.
    """
    name = f"{results.measured}_T{results.samples[-1]}"
    places = results.measured_table(f"positions/{results.measured}")
    places = places.drop_duplicates(["accelerometer", "axis"])
    nominal = places.nominal_m.to_numpy().reshape(-1, 3)
    # the reference is on the top side, and the underside is 2 mm beneath
    top = nominal[:, 2] > -1e-4
    draws = results.draws(name)
    return draws.mean(axis=0) - nominal, top, draws, nominal, name


@claim("2021-48")
def ellipses(results):
    _, top, draws, nominal, name = _offsets(results)
    if not results.json(f"posterior/{name}")["converged"]:
        return untested(results.unconverged(name))
    inside = covered(draws[:, top], nominal[top])
    under = covered(draws[:, ~top], nominal[~top])
    chance = float(bdtr(inside, top.sum(), 1 - 1 / 31))
    remark = f"{under} of {(~top).sum()} on the underside; the board has {top.sum()} such IMUs here"
    if chance >= 0.05:
        return untested(f"too few to tell; {remark}", f"{inside} of {top.sum()}")
    return judged(f"{inside} of {top.sum()}", f"chance {show(chance, 2)}", chance < 0.05, remark)


@claim("2021-49")
def quadrant(results):
    off, top, _, _, _ = _offsets(results)
    under, above = off[~top][:, :2], off[top][:, :2]
    one = np.all(np.sign(under) == np.sign(under[0]))
    small = np.linalg.norm(above.mean(axis=0)) < np.linalg.norm(under.mean(axis=0)) / 3
    value = f"underside mean ({listed(1e3 * under.mean(axis=0))}) mm, topside"
    value += f" ({listed(1e3 * above.mean(axis=0))}) mm"
    remark = (
        "with the y axis drawn downwards (-, -) is the upper left quadrant seen from above,"
        " the upper right one seen from below"
    )
    return judged(value, "", bool(one and small), remark)


def _agreement(results):
    """Coverage between recordings by assumed sigma_a, at the largest T; None of a single one."""
    group = results.settings["recordings"][results.measured].get("group", results.measured)
    try:
        table = results.measured_table(f"agreement/{group}")
    except InputError:
        return None
    table = table[table.samples == results.samples[-1]]
    return table.set_index(table.assumed.astype(str))


@claim("2021-52")
def underestimated(results):
    table = _agreement(results)
    if table is None:
        chance = float(bdtr(10, 15, 1 - 1 / 31))
        return untested(
            "several measured recordings needed",
            f"10 or fewer of 15 has probability {show(chance, 2)} at 97 %",
        )
    row = table.loc[f"{results.settings['experiment']['accelerometer_sd']:g}"]
    value = f"{100 * row.coverage_95:.0f} % covered, rms z {show(row.z_rms)}"
    remark = f"{row.recordings} recordings, T = {results.samples[-1]}; claimed sd"
    remark += f" {show(row.claimed_m)} m, between recordings {show(row.spread_m)} m"
    return judged(value, "pairs and coordinates not independent", row.coverage_95 < 0.9, remark)


@claim("2021-55")
def conservative(results):
    table = _agreement(results)
    if table is None:
        return untested("several measured recordings needed")
    found, used = table.loc["residual"], results.settings["experiment"]["accelerometer_sd"]
    value = f"{show(found.accelerometer_sd)} m/s^2 in the residual"
    remark = f"with it {100 * found.coverage_95:.0f} % of the 95 % intervals cover, rms z"
    remark += f" {show(found.z_rms)}; what the residual consists of is not asked here"
    return judged(value, "", found.accelerometer_sd <= used, remark)


@claim("2021-56")
def noise(results):
    if not results.settings["recordings"][results.measured].get("first_order", True):
        return untested("a recording with still poses needed")
    table = results.measured_table(f"first_order/{results.measured}_noise")
    sds = table.groupby("sensor").sd.median()
    given = results.settings["noise"]
    found = sds["specific_force"], np.degrees(sds["angular_rate"])
    assumed = given["accelerometer_sd"], given["gyroscope_sd_dps"]
    stands = all(1 / 1.5 < a / b < 1.5 for a, b in zip(found, assumed, strict=True))
    value = f"{show(found[0])} m/s^2, {show(found[1])} deg/s"
    return judged(value, "", stands, f"{results.measured}, differences of neighbours")


@claim("2021-57")
def localised(results):
    limit = 2 * results.settings["paper2021"]["variance_target"]
    verdicts = results.each_json(f"posterior/{results.measured}_T{{}}")
    found = {t: v["variance_at_most_draws"] for t, v in verdicts.items()}
    most = max(v["most_draws"] for v in verdicts.values())
    remark = f"N = {most}; the chains here draw omega around the integrand's mode where it fails"
    return judged(by_samples(found), "", all(v <= limit for v in found.values()), remark)
