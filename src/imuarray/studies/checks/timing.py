"""Wall-clock costs. Not reproducible to the byte, and only for rough comparisons."""

from __future__ import annotations

import time

import numpy as np
import pandas as pd

from imuarray.estimation import calibrate_bcd
from imuarray.motion import sphere_motion
from imuarray.simulation import measure


def _fastest(function, repeats: int) -> float:
    """Shortest of ``repeats`` runs after one to warm up, in seconds."""
    function()
    spans = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        spans.append(time.perf_counter() - start)
    return min(spans)


def iteration_costs(rng, model, motion_sizes, samples, iterations=10, repeats=5) -> pd.DataFrame:
    """Seconds an iteration of Algorithm 1 (2017) takes, over N."""
    rows = []
    for number in samples:
        motion = sphere_motion(rng, (number,), *motion_sizes)
        force, rate, _ = measure(model, motion, model.array.relative, rng)

        def run(limit, force=force, rate=rate):
            calibrate_bcd(model, force, rate, tolerance=0.0, limit=limit)

        # the difference leaves out arranging the data, which is done once
        span = _fastest(lambda: run(2 * iterations), repeats)  # noqa: B023
        span -= _fastest(lambda: run(iterations), repeats)  # noqa: B023
        rows.append({"what": "iteration", "samples": number, "seconds": span / iterations})
    return pd.DataFrame(rows)


def transition_costs(targets, thetas, step, rng, count=50, repeats=3) -> pd.DataFrame:
    """Seconds a transition of Algorithm 1 (2021) takes for each T: target in ``targets``."""
    rows = []
    for samples, target in targets.items():
        theta = np.array(thetas[samples])
        value = target.log_target(theta, rng)

        def run(target=target, theta=theta, value=value):
            target.transitions(theta.copy(), value, step, count, rng)

        rows.append(
            {"what": "transition", "samples": samples, "seconds": _fastest(run, repeats) / count}
        )
    return pd.DataFrame(rows)
