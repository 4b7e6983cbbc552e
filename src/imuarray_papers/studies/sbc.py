"""Simulation-based calibration: is the truth where the posterior says, as often as it says?

Positions are drawn from their prior and motion from its own, measurements from both; a sampler
that is right puts the truth at a uniform quantile of its posterior, its PIT value. `imuarray
sample` with nothing asked of it (`pit_values_by_default`) is handed the recording alone: it knows
neither the noise nor the size of the motion.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
from scipy import stats

from imuarray.geometry import positions_of
from imuarray.motion import normal_motion
from imuarray.posterior.chains import chains_of
from imuarray.posterior.diagnostics import ess
from imuarray.recording import Recording
from imuarray.simulation.recordings import simulate_samples
from imuarray.streams import stream
from imuarray_papers.posterior import tuning
from imuarray_papers.posterior.likelihood import CompiledTarget
from imuarray_papers.studies.settings import SETTINGS
from imuarray_papers.studies.truths import Replicate, Setting, misfit, replicate, run_batches

Found = tuple[np.ndarray, np.ndarray]  # PIT values (R, P + 2), how many draws are independent (R,)
METHOD = "sample"  # the command's name in tables


def names_of(setting: Setting) -> list[str]:
    """The quantities that have PIT values: coordinates, then what hangs on all of them."""
    labels = setting.model.array.labels[1:]
    return [f"{label}_{axis}" for label in labels for axis in "xyz"] + ["size", "misfit"]


def of_draws(setting: Setting, made, draws, name: str) -> np.ndarray:
    """PIT values (R, P + 2) of the truths among draws (R, L, P), uniform between two draws."""
    out = []
    for one, thetas in zip(made, draws, strict=True):
        both = np.vstack([one.truth, thetas])
        misfits = [misfit(one.likelihood, theta) for theta in both]
        rng = stream(setting.seed, *setting.where(name), one.number)
        out.append(_pit(setting, both, rng, misfits))
    return np.array(out)


def _pit(setting: Setting, both, rng, *more) -> np.ndarray:
    """Where the first of ``both`` (L + 1, P) lies among the others, (Q,) in (0, 1).

    By coordinate and effect, along the array's nominal shape, and by ``more`` numbers (L + 1,).
    """
    nominal = setting.prior.mean
    along = both[:, : nominal.size] @ nominal / np.linalg.norm(nominal)
    values = np.column_stack([both, along, *more])
    rank = np.sum(values[1:] < values[0], axis=0)
    return (rank + rng.random(rank.size)) / len(values)


def independent(draws) -> np.ndarray:
    """Effective size of the kept draws (R, L, P), of the worst parameter: (R,)."""
    return np.array([ess(one[None]).min() for one in draws])


def ml(setting: Setting, made, threads: int = 1) -> Found:
    """Under a normal density around the ML estimate; NaN of the misfit, and where there is none."""
    size = setting.prior.mean / np.linalg.norm(setting.prior.mean)
    out = np.full((len(made), size.size + 2), np.nan)
    for row, one in zip(out, made, strict=True):
        if one.free is not None and one.free.converged:
            away, covariance = one.truth - one.free.positions[1:].ravel(), one.free.covariance
            along = size @ away / np.sqrt(size @ covariance @ size)
            found = stats.norm.cdf([*away / np.sqrt(np.diag(covariance)), along])
            # 0 and 1 themselves have no normal score
            row[:-1] = np.clip(found, SETTINGS.tiny, 1 - SETTINGS.tiny)
    return out, np.full(len(out), np.nan)


def _start(setting: Setting, one: Replicate, name: str) -> np.ndarray:
    rng = stream(setting.seed, *setting.where(name, "start"), one.number)
    return rng.multivariate_normal(one.mode, SETTINGS.apart**2 * one.covariance)


def nuts(setting: Setting, made, threads: int = 1) -> Found:
    """By NUTS on the exact marginal likelihood."""
    from imuarray.posterior.marginal import log_posterior
    from imuarray.posterior.nuts import run_nuts

    prior, name = setting.prior, "nuts"

    def chain(one):
        found = one.likelihood.marginal(positions_of(one.mode), count)
        start = _start(setting, one, name)[None]
        steps = SETTINGS.draws * SETTINGS.spacing
        return run_nuts(
            log_posterior, one.mode, one.covariance, start, SETTINGS.warmup, steps, setting.seed,
            (*setting.where(name), one.number), SETTINGS.warmup + steps, True,
            (found.data, found.nodes, found.log_weights, None, prior.mean, prior.sd), 1,
        ).draws[0]  # fmt: skip

    pilot = replicate(setting, SETTINGS.spare)
    first = pilot.likelihood.marginal(positions_of(pilot.mode))
    count = round(len(first.nodes) ** (1 / 3))
    draws = np.array(run_batches(chain, made, threads, True, name))
    kept = draws[:, SETTINGS.spacing - 1 :: SETTINGS.spacing]
    return of_draws(setting, made, kept, name), independent(kept)


def pmmh(setting: Setting, made, threads: int = 1) -> Found:
    """By PmMH; N and sigma_q as in section III-C, and thinning, from a pilot data set of its own.

    But N at the mode: here the prior's mean is as far off as the prior says, not a thirtieth of it.
    """
    name = "walk"
    rng = stream(setting.seed, *setting.where(name, "pilot"))
    pilot = replicate(setting, SETTINGS.spare)
    steps = np.sqrt(np.diag(pilot.covariance)).mean() * np.geomspace(1e-3, 3.0, 12)
    found = tuning.tune(
        pilot.likelihood, setting.prior, positions_of(pilot.mode), lambda _: pilot.mode,
        tuning.Sweeps(steps), lambda _: rng, may_centre=False,
    )  # fmt: skip

    def target(one):
        return CompiledTarget(one.likelihood, setting.prior, found.target.draws)

    theta = pilot.mode.copy()
    _burnt_in(target(pilot), theta, found.step, SETTINGS.first, rng)
    thin = _thinning(target(pilot), theta, found.step, rng)

    def chain(one):
        own = stream(setting.seed, *setting.where(name, "chain"), one.number)
        theta = _start(setting, one, name)
        value = _burnt_in(target(one), theta, found.step, max(SETTINGS.first, thin // 4), own)
        return _kept(SETTINGS.draws, target(one), theta, value, found.step, thin, own)[0]

    draws = run_batches(chain, made, threads, True, name)
    return of_draws(setting, made, draws, name), independent(draws)


def _burnt_in(target, theta, step, spacing: int, rng) -> float:
    """The log target after a burn-in that moves ``theta`` in place."""
    value = target.log_target(theta, rng)
    return _kept(SETTINGS.burn_in, target, theta, value, step, spacing, rng)[1]


def _kept(number, target, theta, value, step, count, rng):
    """``number`` draws, ``count`` transitions for each, and log target at the last.

    ``theta`` is moved in place.
    """
    kept = np.empty((number, theta.size))
    for row in kept:
        _, value = target.transitions(theta, value, step, count, rng)
        row[:] = theta
    return kept, value


def _thinning(target, start, step, rng) -> int:
    """Transitions after which a chain has nearly forgotten, for the slowest parameter."""
    theta = start.copy()
    value = target.log_target(theta, rng)
    blocks, effective = [], 0.0
    while effective < SETTINGS.pilot_effective and len(blocks) < SETTINGS.blocks[-1]:
        kept, value = _kept(SETTINGS.pilot // 20, target, theta, value, step, 20, rng)
        blocks.append(kept)
        if len(blocks) in SETTINGS.blocks:
            effective = ess(np.concatenate(blocks)[None]).min()
    return max(1, int(np.ceil(2 * SETTINGS.pilot * len(blocks) / effective)))


METHODS: dict[str, Callable] = {"ML": ml, "PmMH": pmmh, "NUTS": nuts}


def pit_values(
    setting: Setting, replicates, threads: int = 1, methods=tuple(METHODS)
) -> pd.DataFrame:
    """A row for each method, replicate and quantity; ``pit`` is uniform if all is right.

    ``replicates``: their numbers; what one gives does not depend on the others.
    """
    made = run_batches(partial(replicate, setting), replicates, threads, True, "replicates")
    names, frames = names_of(setting), []
    for method in methods:
        found = METHODS[method](setting, made, threads)
        frames.append(_table(setting, method, replicates, names, *found))
    return pd.concat(frames, ignore_index=True)


def _table(setting: Setting, method: str, replicates, names, pit, independent) -> pd.DataFrame:
    """A row for each replicate (R,) and quantity (Q,); ``pit`` (R, Q), ``independent`` (R,)."""
    rows, columns = np.indices(pit.shape)
    return pd.DataFrame({
        "setting": setting.name, "method": method, "samples": setting.samples,
        "replicate": np.array(replicates)[rows.ravel()],
        "quantity": np.array(names)[columns.ravel()], "pit": pit.ravel(),
        "independent": independent[rows.ravel()],
    })  # fmt: skip


def drawn(setting: Setting, number: int) -> tuple[np.ndarray, Recording]:
    """Truth (P,) ``number``: positions and effects from their priors; what was measured of it."""
    rng = stream(setting.seed, *setting.where(METHOD), number)
    model, prior = setting.model, setting.prior
    positions = prior.mean + prior.sd * rng.standard_normal(prior.mean.size)
    effects = model.effect_prior_sd * rng.standard_normal(model.effect_size)
    motion = normal_motion(rng, (setting.samples,), *setting.motion_sd)
    time = np.arange(setting.samples) / SETTINGS.rate
    recording, _ = simulate_samples(
        model, motion, positions_of(positions), model.array.positions, rng, time, effects,
        SETTINGS.beyond, SETTINGS.beyond, setting.prior_sd,
    )  # fmt: skip
    recording = replace(recording, gyroscope_labels=model.array.labels)
    return np.concatenate([positions, effects]), recording


def pit_values_by_default(
    setting: Setting, replicates: Sequence[int], sample: Callable, threads: int = 1
) -> pd.DataFrame:
    """`pit_values` of the command as it is; ``sample`` is `imuarray.sample`.

    Coordinates, the effects' parameters, and the array's size along its nominal shape.
    """
    coordinates = names_of(setting)[: setting.prior.mean.size]
    names = coordinates + [f"effect_{place}" for place in range(setting.model.effect_size)]

    def one(number: int) -> Found:
        truth, recording = drawn(setting, number)
        tree = sample(recording, seed=number, effects=setting.model.effects)
        draws = chains_of(tree).draws[..., : len(names)]
        both = np.vstack([truth, draws.reshape(-1, len(names))])
        rng = stream(setting.seed, *setting.where(METHOD, "rank"), number)
        return _pit(setting, both, rng), ess(draws).min()

    found = run_batches(one, list(replicates), threads, True, METHOD)
    pit, independent = map(np.array, zip(*found, strict=True))
    return _table(setting, METHOD, replicates, [*names, "size"], pit, independent)
