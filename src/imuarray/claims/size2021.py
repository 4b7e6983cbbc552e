"""Paper 2021, section II-A: what the flat motion prior does to the array's size."""

from __future__ import annotations

import numpy as np

from imuarray.claims.numbers import by_samples
from imuarray.claims.registry import claim, judged, untested
from imuarray.geometry import array_from_config
from imuarray.posterior.diagnostics import ess


def size_offset(results, name) -> tuple[float, float, float]:
    """Relative error of the array's size in a posterior, its posterior sd and Monte Carlo error.

    The size is the scale factor, around the triads' mean, that fits the nominal geometry
    to the draws: an error common to all triads (the reference's own) leaves it alone.
    """
    nominal = array_from_config(results.settings["array"]).relative
    nominal = nominal - nominal.mean(axis=0)
    table = results.posterior(name)[0]
    truth = table.truth_m.to_numpy().reshape(-1, 3)
    # the reference triad is at zero in truth and draws, so its term vanishes
    scales = np.einsum("cnka,ka->cn", results.chains(name) - truth, nominal[1:])
    scales = scales / np.sum(nominal**2)
    size = max(float(ess(scales[..., None])[0]), 2.0)
    return scales.mean(), scales.std(ddof=1), scales.std(ddof=1) / np.sqrt(size)


@claim("2021-54")
def flat_prior(results):
    names = {t: f"standin_T{t}" for t in results.samples}
    if not all(results.json(f"posterior/{name}")["converged"] for name in names.values()):
        return untested("our test of an unstated consequence: chains too short at this scale")
    found = {t: size_offset(results, name) for t, name in names.items()}
    off = {t: mean / sd for t, (mean, sd, _) in found.items()}
    errors = {t: error / sd for t, (_, sd, error) in found.items()}
    percent = by_samples({t: 100 * mean for t, (mean, _, _) in found.items()}, 2)
    remark = (
        f"our test of an unstated consequence: size off by {percent} %: |H'QH|^(-1/2) of every"
        " sample pulls the array together, by a distance that does not fall with T"
        " (docs/findings.md)"
    )
    stands = all(abs(value) < 2 for value in off.values())
    return judged(f"{by_samples(off, 2)} sd", by_samples(errors, 1), stands, remark)
