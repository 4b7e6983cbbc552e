"""What (26a)'s flat motion prior does far from the mode and to the array's size.

`python benchmarks/flat_prior.py [--recording corrected.nc] [--out results/flat_prior.md]`: how far
the density falls on the straight way to triads on one line, and how it grows there; the run of NUTS
that goes there; and, of a measured recording, the pull on the size at the residual's own sigma_a.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np  # noqa: E402
from scipy.optimize import minimize  # noqa: E402
from written import publish  # noqa: E402

import imuarray  # noqa: E402
from imuarray.geometry import positions_of, sub_array  # noqa: E402
from imuarray.model.jax64 import jax  # noqa: E402
from imuarray_papers.config import read_config
from imuarray_papers.sampling import flat, sample  # noqa: E402
from imuarray_papers.studies.bayes import simulate_dataset  # noqa: E402

LEFT = (
    1.0,
    0.8,
    0.6,
    0.4,
    0.3,
    0.2,
    0.15,
    0.1,
    1e-2,
    1e-3,
    1e-4,
    1e-5,
)  # of the distance to the line
ASSUMED = 1.9  # m/s^2, about the residual's own size on the measured board


def density(recording):
    """(log density of theta under the flat prior and the declared noise, mode, covariance)."""
    found = flat(recording)
    return found.exact(), found.posterior.mode, found.posterior.covariance


def on_the_way(recording) -> np.ndarray:
    """Log density less that at the mode, where the distance to the nearest line is `LEFT`."""
    log_density, mode, _ = density(recording)
    positions = positions_of(mode)
    centred = positions - positions.mean(axis=0)
    along = np.linalg.svd(centred)[2][0]
    line = centred @ np.outer(along, along)
    way = [(d * positions + (1 - d) * (line - line[0]))[1:].ravel() for d in LEFT]
    return np.array([float(log_density(p)) for p in way]) - float(log_density(mode))


def fall(name: str, recording, rise: bool = False) -> str:
    """A row: the deepest point of that way and, where double precision can see it, the rise."""
    values = on_the_way(recording)
    found = f"{values.min():.3g} nats"
    if rise:
        growth = (values[LEFT.index(1e-4)] - values[LEFT.index(1e-3)]) / np.log(10)
        found += f", then {growth:.3g} nats more for each factor e"
    return f"| {name}: least on the way to a line | {found} |"


def pull(name: str, recording) -> str:
    """A row: the marginal density's maximum against the most likely positions and motion."""
    log_density, mode, covariance = density(recording)
    factor = np.linalg.cholesky(covariance)
    both = jax.jit(jax.value_and_grad(lambda z: -log_density(mode + factor @ z)))

    def cost(z):
        return [np.asarray(part, float) for part in both(z)]

    found = minimize(cost, np.zeros(mode.size), jac=True, method="L-BFGS-B")
    there, here = (positions_of(p) for p in (mode + factor @ found.x, mode))
    size = [np.linalg.norm(p - p.mean(axis=0)) for p in (there, here)]
    above = float(cost(np.zeros(mode.size))[0]) - found.fun
    return f"| {name}: maximum of the marginal density | {above:.3g} nats higher, array" \
           f" {100 * (size[0] / size[1] - 1):+.2g} % |"  # fmt: skip


def main():
    """Run all and print; write where --out says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recording", type=Path, help="corrected, of the measured board")
    parser.add_argument("--config", type=Path, default=Path("config.yaml"))
    parser.add_argument("--out", type=Path, default=Path("results/flat_prior.md"))
    given = parser.parse_args()
    config, lines = read_config(given.config), ["| what | found |", "|---|---|"]
    for samples in (5, 50):
        lines.append(fall(f"32 triads, T = {samples}", simulate_dataset(config, samples)[0]))
    array = sub_array(imuarray.mimu4444(), 4)
    few = imuarray.select(imuarray.simulate(array, 5.0, 50.0, seed=1)[0], 20)
    lines.append(fall("4 triads of a diagonal, T = 20", few, rise=True))
    chains = sample(few, "nuts", 300, 1, accelerometer_noise=few.accelerometer_noise_sd).attrs
    lines.append(
        f"| NUTS there | R-hat {chains['rhat_max']:.2f}, on a line: {chains['on_a_line']} |"
    )
    if given.recording is not None:
        whole = replace(imuarray.read_recording(given.recording), accelerometer_noise_sd=ASSUMED)
        for count in (500, None):
            part = imuarray.select(whole, count)
            name = f"{given.recording.stem}, T = {len(part.time)}, {ASSUMED} m/s²"
            lines.append(pull(name, part))
    publish("\n".join(lines) + "\n", given.out)


if __name__ == "__main__":
    main()
