"""Processor time, and what a noisy estimate costs in acceptance.

Times are by the clock: not reproducible to the byte, for rough comparisons only.
"""

import time

import numpy as np
import pandas as pd

from imuarray.geometry import positions_of


def transition_costs(targets, thetas, step, rng, count=50, repeats=3) -> pd.DataFrame:
    """Seconds a transition of Algorithm 1 (2021) takes for each T: target in ``targets``.

    The shortest of ``repeats`` runs after one to warm up, and their sd. The thread's own time, so
    that a busy machine matters less.
    """
    rows = []
    for samples, target in targets.items():
        theta = np.array(thetas[samples])
        value, spans = target.log_target(theta, rng), []
        for _ in range(repeats + 1):
            start = time.thread_time()
            target.transitions(theta.copy(), value, step, count, rng)
            spans.append((time.thread_time() - start) / count)
        rows.append({
            "what": "transition", "samples": samples, "seconds": min(spans[1:]),
            "spread_s": np.std(spans[1:], ddof=1),
        })  # fmt: skip
    return pd.DataFrame(rows)


def acceptance_against_variance(targets, theta, step, count, rng) -> list[dict]:
    """Acceptance at one step length for each target, with its variance of log p-hat at ``theta``.

    ``targets`` maps a label to a `CompiledTarget`. The error allows for accepted proposals
    coming in clusters: it is taken from 20 blocks of the run.
    """
    rows, blocks = [], 20
    for label, target in targets.items():
        state = np.array(theta)
        positions = positions_of(state)
        logs = target.likelihood.realisations(positions, target.draws, 200, rng)
        value = target.log_target(state, rng)
        _, value = target.transitions(state, value, step, count // 2, rng)
        shares = np.empty(blocks)
        for block in range(blocks):
            accepted, value = target.transitions(state, value, step, count // blocks, rng)
            shares[block] = accepted / (count // blocks)
        rows.append(
            {
                "target": label,
                "draws": target.draws,
                "log_variance": logs.var(ddof=1),
                "acceptance": shares.mean(),
                "transitions": blocks * (count // blocks),
                "acceptance_se": shares.std(ddof=1) / np.sqrt(blocks),
            }  # fmt: skip
        )
    return rows
