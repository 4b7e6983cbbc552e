"""Paper 2021, sections IV-B and IV-C: what only measured data can show."""

import numpy as np
import pandas as pd
from scipy.special import bdtr

from imuarray.errors import InputError
from imuarray_papers.claims.posterior2021 import covered
from imuarray_papers.claims.registry import by_samples, claim, judged, listed, show, untested

DEGREES = float(np.degrees(1.0))


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


def _still(results) -> pd.DataFrame | None:
    """Noise of the still poses, a row an axis; None of a recording without."""
    if not results.settings["recordings"][results.measured].get("first_order", True):
        return None
    return results.measured_table(f"first_order/{results.measured}_noise")


@claim("2021-56", sensor="specific_force", key="accelerometer_sd", unit="m/s^2", factor=1.0)
@claim("2021-58", sensor="angular_rate", key="gyroscope_sd_dps", unit="deg/s", factor=DEGREES)
def noise(results, sensor, key, unit, factor):
    table = _still(results)
    if table is None:
        return untested("a recording with still poses needed")
    found = factor * table[table.sensor == sensor].sd.median()
    stands = 1 / 1.5 < found / results.settings["noise"][key] < 1.5
    return judged(
        f"{show(found)} {unit}", "", bool(stands), f"{results.measured}, neighbours' differences"
    )


@claim("2021-59")
def white(results):
    table = _still(results)
    if table is None:
        return untested("a recording with still poses needed")
    spans = table.groupby("sensor", sort=False).correlation.agg(["min", "max"])
    names = {"specific_force": "accelerometers", "angular_rate": "gyroscopes"}
    said = [f"{names[k]} {row['min']:.2f} to {row['max']:.2f}" for k, row in spans.iterrows()]
    stands = bool(spans.abs().to_numpy().max() < 0.05)
    return judged("; ".join(said), "", stands, f"{results.measured}, still poses")


@claim("2021-60")
def valid(results):
    table, still = _agreement(results), _still(results)
    if table is None or still is None:
        return untested("several measured recordings with still poses needed")
    ratio = table.accelerometer_sd["residual"] / still[still.sensor == "specific_force"].sd.median()
    row = table.loc[f"{results.settings['noise']['accelerometer_sd']:g}"]
    value = f"residual {show(ratio, 2)} times the noise of still poses"
    value += f"; {100 * row.coverage_95:.0f} % of the differences covered with it"
    remark = "what the model lacks: docs/measured.md"
    return judged(value, "", bool(ratio < 1.5 and row.coverage_95 > 0.9), remark)


@claim("2021-61")
def repeated(results):
    table = _agreement(results)
    if table is None:
        return untested("several measured recordings needed")
    row = table.loc[f"{results.settings['experiment']['accelerometer_sd']:g}"]
    value = f"{row.recordings} recordings differ by {show(row.z_rms)} claimed sds, rms"
    return judged(value, "", bool(row.z_rms < 1.5), f"T = {results.samples[-1]}")


@claim("2021-57")
def localised(results):
    limit = 2 * results.settings["paper2021"]["variance_target"]
    verdicts = results.each_json(f"posterior/{results.measured}_T{{}}")
    found = {t: v["variance_at_most_draws"] for t, v in verdicts.items()}
    most = max(v["most_draws"] for v in verdicts.values())
    remark = f"N = {most}; the chains here draw omega around the integrand's mode where it fails"
    return judged(by_samples(found), "", all(v <= limit for v in found.values()), remark)
