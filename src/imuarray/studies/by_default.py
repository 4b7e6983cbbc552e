"""Simulation-based calibration of what `imuarray sample` does when nothing is asked of it.

Truths, motion and measurements are drawn as for `studies.sbc`. But the analysis is the command's
own: it is handed a recording, and knows neither the noise nor the size of the motion.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from imuarray.geometry import positions_of
from imuarray.motion import normal_motion
from imuarray.posterior.chains import chains_of
from imuarray.posterior.diagnostics import ess
from imuarray.recording import Recording
from imuarray.simulation.recordings import simulate_samples
from imuarray.streams import stream
from imuarray.studies.batches import run_batches
from imuarray.studies.truths import Setting

METHOD = "sample"  # name in tables
RATE = 1e9  # samples a second: instants tell the model nothing
BEYOND = 1e6  # m/s^2, rad/s: a rail that nothing reaches


def drawn(setting: Setting, number: int) -> tuple[np.ndarray, Recording]:
    """Truth (P,) ``number``: positions and effects from their priors; what was measured of it."""
    rng = stream(setting.seed, "calibrated", METHOD, setting.name, setting.samples, number)
    model, prior = setting.model, setting.prior
    positions = prior.mean + prior.sd * rng.standard_normal(prior.mean.size)
    effects = model.effect_prior_sd * rng.standard_normal(model.effect_size)
    motion = normal_motion(rng, (setting.samples,), *setting.motion_sd)
    time = np.arange(setting.samples) / RATE
    recording, _ = simulate_samples(
        model, motion, positions_of(positions), model.array.positions, rng, time, effects,
        BEYOND, BEYOND, setting.prior_sd,
    )  # fmt: skip
    recording = replace(recording, gyroscope_labels=model.array.labels)
    return np.concatenate([positions, effects]), recording


def pit_values(
    setting: Setting, replicates: Sequence[int], sample: Callable, threads: int = 1
) -> pd.DataFrame:
    """As `studies.sbc.pit_values` has it; ``sample`` is `imuarray.sample`.

    Coordinates, the effects' parameters, and the array's size along its nominal shape.
    """
    size = setting.prior.mean / np.linalg.norm(setting.prior.mean)
    names = [f"{label}_{axis}" for label in setting.model.array.labels[1:] for axis in "xyz"]
    names += [f"effect_{place}" for place in range(setting.model.effect_size)]

    def one(number: int) -> pd.DataFrame:
        truth, recording = drawn(setting, number)
        tree = sample(recording, seed=number, effects=setting.model.effects)
        draws = chains_of(tree).draws[..., : len(names)]
        both = np.vstack([truth, draws.reshape(-1, len(names))])
        both = np.column_stack([both, both[:, : size.size] @ size])
        rank = np.sum(both[1:] < both[0], axis=0)
        where = setting.name, setting.samples, number
        rng = stream(setting.seed, "calibrated", METHOD, "rank", *where)
        pit = (rank + rng.random(rank.size)) / len(both)
        return pd.DataFrame(
            {"setting": setting.name, "method": METHOD, "samples": setting.samples,
             "replicate": number, "quantity": [*names, "size"], "pit": pit,
             "independent": ess(draws).min()}
        )  # fmt: skip

    frames = run_batches(one, list(replicates), threads, True, METHOD)
    return pd.concat(frames, ignore_index=True)
