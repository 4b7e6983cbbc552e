"""Paper 2021, sections IV-B and IV-C, figure 5 and table II: the experiment and its simulation."""

import numpy as np

from imuarray.geometry import UNDERSIDE_ROTATION
from imuarray.recording.units import GRAVITY
from imuarray_papers.claims.registry import by_samples, claim, falls, judged, listed, show, untested

RANGE = 157.0  # m/s^2, where the accelerometers saturate


def _medians(tables) -> dict[int, float]:
    """Median sd (m) over coordinates for each T."""
    return {t: table.sd_m.median() for t, table in tables.items()}


def _sds(results, prefix):
    return _medians(results.posteriors(prefix))


@claim("2021-40")
def half_percent(results):
    used = results.settings["experiment"]["accelerometer_sd"]
    value = 0.005 * RANGE
    return judged(f"{show(value)} m/s^2, {show(used)} used", "none", abs(value / used - 1) < 0.01)


@claim("2021-41")
def saturation(results):
    value = 16 * GRAVITY
    return judged(f"{show(value, 4)} m/s^2", "none", abs(value / RANGE - 1) < 0.01)


def _linearised(results, prefix):
    return _medians({t: results.linearised(f"{prefix}T{t}") for t in results.samples})


@claim("2021-42")
def widens(results):
    small, large = (_linearised(results, f"simulation_{n}") for n in ("small_noise_", ""))
    ratios = {t: large[t] / small[t] for t in results.samples}
    return judged(by_samples(ratios), "none: linearised", min(ratios.values()) > 1)


@claim("2021-43")
def hundred(results):
    wide, narrow = _sds(results, "simulation_"), _sds(results, "")
    ratios = {t: wide[t] / narrow[t] for t in results.samples}
    stands = all(50 <= value <= 200 for value in ratios.values())
    source = results.sources("simulation_", "")
    return judged(by_samples(ratios), "", stands, f"{source}; table II is not in the text")


@claim("2021-44")
def attributed(results):
    wide, slow, narrow = (
        _linearised(results, name) for name in ("simulation_", "simulation_small_noise_", "")
    )
    total = {t: wide[t] / narrow[t] for t in results.samples}
    share = {t: np.log(wide[t] / slow[t]) / np.log(total[t]) for t in results.samples}
    remark = (
        "the rest is slower motion: twisting as simulated turns less than section IV-A's motion"
    )
    value = f"share {by_samples(share, 2)} of {by_samples(total)}"
    return judged(value, "none: linearised", min(share.values()) > 0.5, remark)


@claim("2021-45")
def similar(results):
    names = [f"{results.measured}_", f"simulated_{results.measured}_"]
    sds = [_sds(results, name) for name in names]
    ratios = {t: sds[0][t] / sds[1][t] for t in results.samples}
    source = results.sources(*names)
    stands = all(1 / 1.5 < ratio < 1.5 for ratio in ratios.values())
    remark = f"8 IMUs, {results.measured}; the widths follow from sigma_a and the motion, whatever"
    remark += f" the residuals are; {source}"
    return judged(by_samples(ratios), "", stands, remark)


@claim("2021-46")
def experiment_shrinks(results):
    name = f"{results.measured}_"
    sds, source = _sds(results, name), results.sources(name)
    value = f"median sd {by_samples(sds)} m"
    return judged(value, "", falls(sds.values()), f"8 IMUs; {source}")


@claim("2021-47")
def simulation_shrinks(results):
    sds = _sds(results, "simulation_")
    remark = results.sources("simulation_")
    return judged(f"{by_samples(sds)} m", "", falls(sds.values()), remark)


@claim("2021-50")
def doubled(results):
    values, vectors = np.linalg.eig(UNDERSIDE_ROTATION)
    axis = np.real(vectors[:, np.argmax(np.real(values))])
    across = np.cross(axis, [0.0, 0.0, 1.0])
    top = across - across  # a topside triad and the reference are turned alike
    factors = [abs((UNDERSIDE_ROTATION @ d - d) @ d) for d in (across, np.array([0.0, 0, 1]), axis)]
    value = f"topside {show(np.abs(top).max())}; underside {listed(factors[:2])}"
    value += f", along the axis {show(factors[2], 2)}"
    remark = (
        "an offset along the axis of rotation moves all triads alike and cannot be seen; halving"
        " the shift therefore gives the in-package position only across that axis"
    )
    stands = np.allclose(factors[:2], 2) and not top.any()
    return judged(value, "none", stands, remark)


@claim("2021-51")
def spread(results):
    found = results.json("claims/marginalisation")["spread"]
    stands = 0.5 < found["ratio"] < 2
    remark = (
        f"(30b) is one gyroscope's covariance, not that of the mean of {found['gyroscopes']}: it"
        " widens on purpose or by slip"
    )
    return judged(show(found["ratio"], 4), found["se"], stands, "" if stands else remark)


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
