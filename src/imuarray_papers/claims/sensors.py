"""The sensors of the real board against what both papers assume of them."""

import numpy as np
import pandas as pd

from imuarray_papers.claims.experiment2021 import agreement
from imuarray_papers.claims.numbers import show
from imuarray_papers.claims.registry import Missing, claim, untested, verdict
from imuarray_papers.claims.results import SEVERAL

DEGREES = float(np.degrees(1.0))
OF_NOISE = "accelerometer_noise", "gyroscope_noise", "coloured_noise", "heavy_tails", "shock"
NO_POSES = untested("a recording with still poses needed")


def _still(results, otherwise=NO_POSES) -> pd.DataFrame:
    """Noise of the still poses, a row an axis."""
    if not results.settings["recordings"][results.measured].get("first_order", True):
        raise Missing(otherwise)
    return results.measured_table(f"first_order/{results.measured}_noise")


@claim("2021-56", sensor="specific_force", key="accelerometer_sd", unit="m/s^2", factor=1.0)
@claim("2021-58", sensor="angular_rate", key="gyroscope_sd_dps", unit="deg/s", factor=DEGREES)
def noise(results, sensor, key, unit, factor):
    table = _still(results)
    found = factor * table[table.sensor == sensor].sd.median()
    stands = 1 / 1.5 < found / results.settings["noise"][key] < 1.5
    return verdict(
        f"{show(found)} {unit}", "", bool(stands), f"{results.measured}, neighbours' differences"
    )


@claim("2021-59")
def white(results):
    spans = _still(results).groupby("sensor", sort=False).correlation.agg(["min", "max"])
    names = {"specific_force": "accelerometers", "angular_rate": "gyroscopes"}
    said = [f"{names[k]} {row['min']:.2f} to {row['max']:.2f}" for k, row in spans.iterrows()]
    stands = bool(spans.abs().to_numpy().max() < 0.05)
    return verdict("; ".join(said), "", stands, f"{results.measured}, still poses")


@claim("2021-60")
def valid(results):
    table, still = agreement(results), _still(results, SEVERAL)
    ratio = table.accelerometer_sd["residual"] / still[still.sensor == "specific_force"].sd.median()
    row = table.loc[f"{results.settings['noise']['accelerometer_sd']:g}"]
    value = f"residual {show(ratio, 2)} times the noise of still poses"
    value += f"; {100 * row.coverage_95:.0f} % of the differences covered with it"
    return verdict(value, "", bool(ratio < 1.5 and row.coverage_95 > 0.9))


@claim("2021-61")
def repeated(results):
    row = agreement(results).loc[f"{results.settings['experiment']['accelerometer_sd']:g}"]
    value = f"{row.recordings} recordings differ by {show(row.z_rms)} claimed sds, rms"
    return verdict(value, "", bool(row.z_rms < 1.5), f"T = {results.samples[-1]}")


@claim("2021-62")
def saturates(results):
    table = results.measured_table(f"subsets/{results.measured}_selection")
    counts = table.set_index("criterion").samples
    slow = counts.index.str.startswith(("still", "slower"))
    moving = counts["all"] - counts[slow].sum()
    # counted one after the other: no sample twice
    shares = {
        kind: 100 * counts[f"{kind} at a rail"] / moving for kind in ("accelerometer", "gyroscope")
    }
    value = ", more ".join(f"{kind}s {show(share, 2)} %" for kind, share in shares.items())
    remark = f"{results.measured}, of {moving} moving samples"
    return verdict(value, "", sum(shares.values()) < 1, remark)


def _steps(results) -> pd.DataFrame:
    """Gain of each cause on the board, by step (`measured.causes`)."""
    return results.of_board(f"causes_{results.board}").set_index("step")


@claim("2017-45", step="own arms", without="no arms")
@claim("2021-64", step="clocks", without="robust")
def assumed(results, step, without):
    table = _steps(results)
    row, before = table.loc[step], table.loc[without].smooth_ratio
    value = f"{show(row.nats)} nats a sample gained without the assumption"
    remark = f"the residual of smooth and fast samples falls from {show(before, 2)} to"
    remark += f" {show(row.smooth_ratio, 2)} times the noise"
    return verdict(value, row.nats_error, bool(row.nats < 2 * row.nats_error), remark)


@claim("2021-65")
def one_rate(results):
    table, still = results.of_board(f"residuals/{results.measured}"), _still(results, SEVERAL)
    noise = still[still.sensor == "angular_rate"].ratio.pow(2).mean() ** 0.5
    mine = table[(table.quantity == "angular_rate") & (table.source == "measured")]
    sizes = mine.groupby("bin_low").rms.agg(lambda rms: rms.pow(2).mean() ** 0.5) / noise
    value = f"residual {show(sizes.min(), 2)} to {show(sizes.max(), 2)} times the noise"
    remark = f"{results.measured}: axes and scales differ, and accelerometers lag behind"
    return verdict(value, "", bool(sizes.max() < 1.5), remark)


@claim("2021-66")
def mismatch(results):
    last = _steps(results).iloc[-1]
    wide = agreement(results).loc[f"{results.settings['experiment']['accelerometer_sd']:g}"]
    value = f"{100 * wide.coverage_95:.0f} % covered, with what the model lacked"
    value += f" {100 * last.covered:.0f} %, of differences of {show(1e6 * last.rms_m, 2)} µm"
    stands = last.covered > max(0.9, wide.coverage_95) and last.rms_m < wide.spread_m
    return verdict(value, "pairs and coordinates not independent", bool(stands))


def _gains(results) -> dict[str, float]:
    """Nats of each cause of the diagnosis, by its name; where the board has several recordings."""
    _steps(results)
    causes = results.json(f"../measured/diagnosis/{results.measured}/diagnosis")["causes"]
    return {cause["effect"]: cause["heldout_gain_nats"] for cause in causes}


@claim("2021-67")
def nonlinear(results):
    nats = {effect: gain for effect, gain in _gains(results).items() if effect not in OF_NOISE}
    most = max(nats, key=nats.__getitem__)
    own = sum(gain for effect, gain in nats.items() if "nonlinearity" in effect)
    value = f"{show(own, 2)} nats of {show(nats[most], 2)} ({most})"
    remark = f"{results.measured}, gains on held-out time, each beside all others"
    return verdict(value, "", "nonlinearity" in most, remark)


@claim("2021-68")
def by_hand(results):
    found, paper = results.json("claims/statements")["sds"], results.settings["paper2021"]
    sds = DEGREES * found[0], DEGREES * found[1], found[2]
    keys = "angular_rate_sd_dps", "angular_acceleration_sd_dps2", "specific_force_sd"
    off = [sd / paper[key] for sd, key in zip(sds, keys, strict=True)]
    value = f"{show(sds[0])} deg/s, {show(sds[1])} deg/s^2, {show(sds[2])} m/s^2"
    remark = f"{results.measured}, samples beyond 100 deg/s, one by one"
    return verdict(value, "", min(off) > 1 / 1.5 and max(off) < 1.5, remark)


@claim("2021-69")
def averaging(results):
    found = results.json("claims/statements")["averaging"]
    if found is None:
        return NO_POSES
    ratios = list(found.values())
    value = f"accelerometers {show(ratios[0])}, gyroscopes {show(ratios[1])} times sd / root K"
    return verdict(value, "", max(ratios) < 1.25, f"{results.measured}, neighbours' differences")


@claim("2021-70")
def single_sample(results):
    found = results.json("claims/statements")["differentiation"]
    one, other = found["one sample"], found["difference"]
    value = f"error {show(one)} rad/s^2 of one sample, {show(other)} of the central difference"
    rate = results.settings["experiment"]["sampling_rate"]
    remark = f"its noise is {show(found['noise'], 2)}; at {show(rate)} Hz it misses fast motion"
    return verdict(value, "", one < other, remark)


@claim("2021-71")
def error_grows(results):
    named = "gyroscope_scale" in _gains(results)
    found = results.json("claims/statements")["spread"]
    value = f"{show(DEGREES * found['fast'])} deg/s, slow samples {show(DEGREES * found['slow'])}"
    remark = (
        f"{results.measured}; the diagnosis {'names' if named else 'does not name'} their scale"
    )
    return verdict(value, "", named and found["fast"] > 1.5 * found["slow"], remark)
