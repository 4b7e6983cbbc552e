"""Paper 2021, section IV-A, figures 3 and 4: the chains and the simulated posteriors."""

import numpy as np
from scipy.special import chdtri

from imuarray.geometry import array_from_config
from imuarray.posterior.diagnostics import ess
from imuarray_papers.claims.numbers import by_samples, falls, listed, near, show
from imuarray_papers.claims.registry import CLOCK, claim, untested, verdict

ESS, Z, STEPS, CHAINS = (
    f"posterior/T{{}}:{entry}" for entry in ("ess_min", "split_z_max", "steps", "chains")
)


@claim("2021-27", "posterior/T{}:rhat_max", ESS, Z, STEPS)
def chains_agree(rhat, ess, z, steps):
    remark = (
        f"smallest effective sizes {by_samples(ess)}; largest |z| of the chains' means"
        f" {by_samples(z)}; steps {by_samples(steps, 7)}"
    )
    return verdict(by_samples(rhat, 4), "", max(rhat.values()) < 1.05, remark)


@claim("2021-28", Z, ESS)
def means_agree(z, ess):
    stands = max(z.values()) < 4.5 and min(ess.values()) > 100
    return verdict(by_samples(z), "1 by construction", stands)


@claim("2021-29")
def burn_in(results):
    tables = results.source("posterior/burn_in_T{}")
    # the first candidate is none, the second the entry
    best = {t: table.rhat_max[table.burn_in > 0].min() for t, table in tables.items()}
    stands = max(best.values()) < results.settings["paper2021"]["rhat_threshold"]
    steps = by_samples(results.source("posterior/T{}:burn_in_steps"), 7)
    remark = f"burn-in chosen: {steps} steps"
    return verdict(by_samples(best, 4), "", stands, remark)


@claim("2021-30")
def narrower(results):
    prior = results.settings["paper2021"]["prior_sd"]
    ratios = {t: table.sd_m.max() / prior for t, table in results.posteriors().items()}
    value = f"largest sd / prior sd {by_samples(ratios)}"
    return verdict(value, "", max(ratios.values()) < 1, results.sources())


@claim("2021-31")
def shrinks(results):
    sds = {t: table.sd_m.to_numpy() for t, table in results.posteriors().items()}
    second = results.posteriors()[results.samples[0]].accelerometer.astype(str) == "2"
    median = by_samples({t: np.median(sd) for t, sd in sds.items()})
    own = by_samples({t: np.median(sd[second]) for t, sd in sds.items()})
    value = f"median sd {median} m; IMU 2 {own} m"
    return verdict(value, "", falls(sds.values()), results.sources())


@claim("2021-32")
def closer(results):
    distance = {
        t: np.sqrt(np.mean(np.square(table.mean_m - table.truth_m)))
        for t, table in results.posteriors().items()
    }
    value, stands = f"{by_samples(distance)} m", falls(distance.values())
    return verdict(value, "one data set a T", stands, results.sources())


@claim("2021-33")
def honest(results):
    found, errors = {}, {}
    for t, table in results.posteriors().items():
        found[t] = np.mean(((table.mean_m - table.truth_m) / table.sd_m) ** 2)
        draws = results.draws(f"T{t}")
        alike = np.corrcoef(draws.reshape(len(draws), -1).T)  # that coordinates go together
        errors[t] = np.sqrt(2 * np.sum(alike**2)) / len(alike)
    stands = all(near(found[t], 1.0, errors[t], 0.0) for t in found)
    return verdict(by_samples(found), by_samples(errors, 2), stands, results.sources())


@claim("2021-34")
def robust(results):
    good, tables = (results.source(f"posterior/T{{}}{end}") for end in (":converged", ""))
    prior = results.settings["paper2021"]["prior_sd"]
    ratios = {t: table.sd_m.max() / prior for t, table in tables.items()}
    stands = all(good.values()) and max(ratios.values()) < 0.1
    value = f"{sum(good.values())} of {len(good)} converged"
    value += f"; chains' largest sd / prior sd {by_samples(ratios)}"
    return verdict(value, "", stands)


@claim("2021-35", ESS, STEPS, CHAINS)
def efficient(ess, steps, chains):
    rate = {t: 1000 * ess[t] / (steps[t] * chains[t]) for t in ess}
    return untested(value=f"smallest effective size a 1000 steps {by_samples(rate)}")


def covered(draws, points, level=1 - 1 / 31):
    """Number of ellipses in x, y at ``level``, of draws (n, k, 3), that hold points (k, 3)."""
    inside = 0
    for k in range(draws.shape[1]):
        off = points[k, :2] - draws[:, k, :2].mean(axis=0)
        inside += off @ np.linalg.solve(np.cov(draws[:, k, :2].T), off) < chdtri(2, 1 - level)
    return int(inside)


@claim("2021-36")
def level(results):
    count = len(results.table(f"posterior/T{results.samples[0]}")) // 3
    value = 100 * (1 - 1 / count)
    return verdict(f"{value:.2f} %", "none", round(value) == 97)


@claim("2021-37")
def coverage(results):
    name = f"T{results.samples[-1]}"
    if not results.json(f"posterior/{name}")["converged"]:
        return untested(f"{results.unconverged(name)}: its ellipses mean nothing")
    table = results.table(f"posterior/{name}")
    inside = covered(results.draws(name), table.truth_m.to_numpy().reshape(-1, 3))
    count, share = len(table) // 3, 1 / 31
    error = np.sqrt(count * share * (1 - share))
    remark = f"median sd {show(table.sd_m.median())} m"
    return verdict(f"{inside} of {count}", error, inside >= 26, remark)


@claim("2021-38", "claims/timing")
def costs(table):
    rows = table[table.what == "transition"].sort_values("samples")
    dearer = rows.seconds.iloc[-1] > 3 * rows.seconds.iloc[0]
    value = f"{'more' if dearer else 'not more'} than 3 times from the first of T = "
    return verdict(f"{value}{listed(rows.samples)} to the last", "", dearer, CLOCK)


@claim("2021-39", STEPS, CHAINS)
def run_time(taken, chains):
    steps = {t: taken[t] * chains[t] for t in taken}
    return untested(value=f"{by_samples(steps, 7)} steps")


def size_offset(results, name) -> tuple[float, float, float]:
    """Relative error of the array's size in a posterior, its posterior sd and Monte Carlo error.

    The size is the scale factor, around the triads' mean, that fits the nominal geometry
    to the draws: an error common to all triads (the reference's own) leaves it alone.
    """
    nominal = array_from_config(results.settings["array"]).relative
    nominal = nominal - nominal.mean(axis=0)
    table = results.posterior(name)
    truth = table.truth_m.to_numpy().reshape(-1, 3)
    # the reference triad is at zero in truth and draws, so its term vanishes
    scales = np.einsum("cnka,ka->cn", results.chains(name) - truth, nominal[1:])
    scales = scales / np.sum(nominal**2)
    size = max(float(ess(scales[..., None])[0]), 2.0)
    return scales.mean(), scales.std(ddof=1), scales.std(ddof=1) / np.sqrt(size)


@claim("2021-54")
def flat_prior(results):
    names = {t: f"quiet_T{t}" for t in results.samples}
    if not all(results.json(f"posterior/{name}")["converged"] for name in names.values()):
        return untested("our test of an unstated consequence: chains too short at this scale")
    found = {t: size_offset(results, name) for t, name in names.items()}
    off = {t: mean / sd for t, (mean, sd, _) in found.items()}
    errors = {t: error / sd for t, (_, sd, error) in found.items()}
    percent = by_samples({t: 100 * mean for t, (mean, _, _) in found.items()}, 2)
    remark = (
        f"our test of an unstated consequence: size off by {percent} %: |H'ΛH|^(-1/2) of every"
        " sample pulls the array together, by a distance that does not fall with T"
        " (docs/findings.md)"
    )
    stands = all(abs(value) < 2 for value in off.values())
    return verdict(f"{by_samples(off, 2)} sd", by_samples(errors, 1), stands, remark)
