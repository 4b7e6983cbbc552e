"""Paper 2021, sections IV-B and IV-C, figure 5 and table II: the experiment and its simulation.

First what both show, then what only measured data can show.
"""

import numpy as np
from scipy.special import bdtr

from imuarray.geometry import UNDERSIDE_ROTATION
from imuarray.recording.units import GRAVITY
from imuarray_papers.claims.numbers import by_samples, falls, listed, show
from imuarray_papers.claims.posterior2021 import covered
from imuarray_papers.claims.registry import claim, untested, verdict
from imuarray_papers.claims.results import SEVERAL

RANGE = 157.0  # m/s^2, where the accelerometers saturate


def _sds(results, prefix) -> dict[int, float]:
    """Median sd (m) over coordinates for each T."""
    return {t: table.sd_m.median() for t, table in results.posteriors(prefix).items()}


def _linearised(results, prefix):
    return {t: results.linearised(f"{prefix}T{t}").sd_m.median() for t in results.samples}


@claim("2021-40")
def half_percent(results):
    used = results.settings["experiment"]["accelerometer_sd"]
    value = 0.005 * RANGE
    return verdict(f"{show(value)} m/s^2, {show(used)} used", "none", abs(value / used - 1) < 0.01)


@claim("2021-41")
def saturation(results):
    value = 16 * GRAVITY
    return verdict(f"{show(value, 4)} m/s^2", "none", abs(value / RANGE - 1) < 0.01)


@claim("2021-42")
def widens(results):
    small, large = (_linearised(results, f"simulation_{n}") for n in ("small_noise_", ""))
    ratios = {t: large[t] / small[t] for t in results.samples}
    return verdict(by_samples(ratios), "none: linearised", min(ratios.values()) > 1)


@claim("2021-43")
def hundred(results):
    wide, narrow = _sds(results, "simulation_"), _sds(results, "")
    ratios = {t: wide[t] / narrow[t] for t in results.samples}
    stands = all(50 <= value <= 200 for value in ratios.values())
    names = "simulation_", "simulation_small_noise_"
    alike, slow = (_linearised(results, name) for name in names)
    remark = "table II is not in the text; of one motion the noise alone makes it"
    remark += f" {by_samples({t: alike[t] / slow[t] for t in ratios})}, at most 0.79 / 0.04"
    source = results.sources("simulation_", "")
    return verdict(by_samples(ratios), "", stands, f"{source}; {remark}")


@claim("2021-44")
def attributed(results):
    wide, slow, narrow = (
        _linearised(results, name) for name in ("simulation_", "simulation_small_noise_", "")
    )
    total = {t: wide[t] / narrow[t] for t in results.samples}
    share = {t: np.log(wide[t] / slow[t]) / np.log(total[t]) for t in results.samples}
    value = f"share {by_samples(share, 2)} of {by_samples(total)}"
    return verdict(value, "none: linearised", min(share.values()) > 0.5)


@claim("2021-45")
def similar(results):
    names = [f"{results.measured}_", f"simulated_{results.measured}_"]
    sds = [_sds(results, name) for name in names]
    ratios = {t: sds[0][t] / sds[1][t] for t in results.samples}
    source = results.sources(*names)
    stands = all(1 / 1.5 < ratio < 1.5 for ratio in ratios.values())
    remark = f"8 IMUs, {results.measured}; the widths follow from sigma_a and the motion, whatever"
    remark += f" the residuals are; {source}"
    return verdict(by_samples(ratios), "", stands, remark)


@claim("2021-46")
def experiment_shrinks(results):
    name = f"{results.measured}_"
    sds, source = _sds(results, name), results.sources(name)
    value = f"median sd {by_samples(sds)} m"
    return verdict(value, "", falls(sds.values()), f"8 IMUs; {source}")


@claim("2021-47")
def simulation_shrinks(results):
    sds = _sds(results, "simulation_")
    remark = results.sources("simulation_")
    return verdict(f"{by_samples(sds)} m", "", falls(sds.values()), remark)


@claim("2021-50")
def doubled(results):
    values, vectors = np.linalg.eig(UNDERSIDE_ROTATION)
    axis = np.real(vectors[:, np.argmax(np.real(values))])
    across = np.cross(axis, [0.0, 0.0, 1.0])
    top = across - across  # a topside triad and the reference are turned alike
    factors = [abs((UNDERSIDE_ROTATION @ d - d) @ d) for d in (across, np.array([0.0, 0, 1]), axis)]
    value = f"topside {show(np.abs(top).max())}; underside {listed(factors[:2])}"
    value += f", along the axis {show(factors[2], 2)}"
    stands = np.allclose(factors[:2], 2) and not top.any()
    return verdict(value, "none", stands)


@claim("2021-53")
def consistent(results):
    reason = "results of another paper on measured data"
    t = results.samples[-1]
    table = results.measured_table(f"positions/{results.measured}")
    ml = table[(table.method == "bcd") & (table.samples == t)].mean_m.to_numpy()
    posterior = results.table(f"posterior/{results.measured}_T{t}")
    off = np.abs(ml - posterior.mean_m.to_numpy()) / posterior.sd_m.to_numpy()
    value = f"ML-BCD of 2017 on the same {t} samples: within {show(off.max(), 2)} posterior sds"
    return untested(f"{reason}; the value is ours", value)


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
    return verdict(f"{inside} of {top.sum()}", f"chance {show(chance, 2)}", chance < 0.05, remark)


def _sides(results):
    """(m) offsets x, y of the triads on the underside (n, 2) and on top (m, 2)."""
    off, top, _, _, _ = _offsets(results)
    return off[~top][:, :2], off[top][:, :2]


@claim("2021-49")
def quadrant(results):
    under, _ = _sides(results)
    value = f"mean ({listed(1e3 * under.mean(axis=0))}) mm"
    return verdict(value, "", bool(np.all(np.sign(under) == np.sign(under[0]))))


@claim("2021-63")
def centred(results):
    under, above = (side.mean(axis=0) for side in _sides(results))
    stands = np.linalg.norm(above) < np.linalg.norm(under) / 3
    return verdict(f"mean ({listed(1e3 * above)}) mm", "", bool(stands))


def agreement(results, otherwise=SEVERAL):
    """Coverage between recordings by assumed sigma_a, at the largest T."""
    table = results.of_board(f"agreement/{results.board}", otherwise)
    table = table[table.samples == results.samples[-1]]
    return table.set_index(table.assumed.astype(str))


@claim("2021-52")
def underestimated(results):
    chance = float(bdtr(10, 15, 1 - 1 / 31))
    words = f"10 or fewer of 15 has probability {show(chance, 2)} at 97 %"
    table = agreement(results, untested("several measured recordings needed", words))
    row = table.loc[f"{results.settings['experiment']['accelerometer_sd']:g}"]
    value = f"{100 * row.coverage_95:.0f} % covered, rms z {show(row.z_rms)}"
    remark = f"{row.recordings} recordings, T = {results.samples[-1]}; claimed sd"
    remark += f" {show(row.claimed_m)} m, between recordings {show(row.spread_m)} m"
    return verdict(value, "pairs and coordinates not independent", row.coverage_95 < 0.9, remark)


@claim("2021-55")
def conservative(results):
    table = agreement(results, untested("several measured recordings needed"))
    found, used = table.loc["residual"], results.settings["experiment"]["accelerometer_sd"]
    value = f"{show(found.accelerometer_sd)} m/s^2 in the residual"
    remark = f"with it {100 * found.coverage_95:.0f} % of the 95 % intervals cover, rms z"
    remark += f" {show(found.z_rms)}; what the residual consists of is not asked here"
    return verdict(value, "", found.accelerometer_sd <= used, remark)


@claim("2021-57")
def localised(results):
    limit = 2 * results.settings["paper2021"]["variance_target"]
    entries = ("variance_at_most_draws", "most_draws")
    found, most = (results.source(f"posterior/{results.measured}_T{{}}:{x}") for x in entries)
    remark = f"N = {max(most.values())}; the chains here draw omega around the integrand's mode"
    remark += " where it fails"
    return verdict(by_samples(found), "", all(v <= limit for v in found.values()), remark)
