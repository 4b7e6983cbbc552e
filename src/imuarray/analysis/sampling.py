"""Chains of the positions' posterior, as one labelled tree."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.analysis import methods
from imuarray.analysis.density import density_of, tuned_target
from imuarray.analysis.model import Say, chosen_model, silent, usable
from imuarray.errors import InputError, require_integer
from imuarray.model import ArrayModel
from imuarray.model.names import parameter_names
from imuarray.posterior.chains import Chains
from imuarray.posterior.pmmh import checkpoint_beside, run_chains, spread_starts
from imuarray.posterior.target import GaussianPrior
from imuarray.provenance import code_digest, digest, stamp
from imuarray.recording import Recording
from imuarray.streams import stream

PMMH_STEPS = {True: 200_000, False: 10_000}  # compiled, any effects
NUTS_STEPS, NUTS_WARMUP = 1250, 300  # 1000 left the worst of 93 R-hats above 1.01 now and then
APART = 2.0  # posterior sds by which the starts differ where effects are free
STORED = 2000
RHAT_THRESHOLD = 1.05
FLAT = 0.03  # of the mode's distance from a line: nearer the flat prior has its hole


class Asked(NamedTuple):
    """How to sample; ``beside`` is the file beside which a checkpoint is kept, if any."""

    method: str
    steps: int | None
    seed: int
    rates: str
    progress: bool
    beside: Path | None
    say: Say


class Made(NamedTuple):
    """Chains, and what made them."""

    chains: Chains
    prior: GaussianPrior
    key: str  # digest of everything that they depend on
    settings: dict
    checkpoint: Path | None = None


def sample(
    recording: Recording, method: str = "pmmh", steps: int | None = None, seed: int = 0,
    rates: str = "declared", effects: Sequence[str] = (),
    diagnosis: str | PathLike | None = None, accelerometer_noise: float | None = None,
    progress: bool = False, say: Say = silent, beside: str | PathLike | None = None,
) -> xr.DataTree:  # fmt: skip
    """Two chains of the posterior of the accelerometers' positions (paper 2021).

    Parameters
    ----------
    recording
        Moving samples; still poses and samples with an accelerometer at its rail are left out.
    method
        ``"pmmh"``: pseudo-marginal Metropolis-Hastings (paper 2021), N and the step length tuned
        as in section III-C; ``"nuts"``: the no-U-turn sampler on the exact marginal likelihood.
    steps
        Transitions of each chain, after the warm-up in NUTS' case.
    seed
        Of the random numbers.
    rates
        p(omega | y_g) from the ``"declared"`` gyroscope noise, or from the ``"spread"`` among the
        gyroscopes of each sample (equation (30)).
    effects
        As in `imuarray.calibrate`.
    diagnosis
        As in `imuarray.calibrate`.
    accelerometer_noise
        As in `imuarray.calibrate`.
    progress
        Whether to show a bar.
    say
        Called with each remark on the work's course.
    beside
        A file beside which PmMH keeps a checkpoint, continued by the same call with the same
        data, settings and code; the attribute ``checkpoint`` names it. By default none.

    Returns
    -------
    xarray.DataTree
        ``posterior/position`` (chain, draw, accelerometer, axis) m, with effects
        ``posterior/effect_parameter``; ``sample_stats``, ``prior``. Attributes: the chains'
        verdict (``converged``, ``rhat_max``, ``ess_min``, burn-in) and the origin.

    Raises
    ------
    InputError
        The recording does not determine the positions, or the options do not go together.
    """
    for name, value, known in (
        ("method", method, methods.SAMPLING),
        ("rates", rates, methods.RATES),
    ):
        if value not in known:
            raise InputError(f"{name}: expected any of {', '.join(known)}, found {value!r}")
    if steps is not None:
        require_integer("steps", steps)
    require_integer("seed", seed, 0)
    recording, model = chosen_model(
        usable(recording, say), effects, diagnosis, accelerometer_noise, say
    )
    if rates == "spread":
        if model.effects:
            raise InputError("--rates spread: expected no --effects with it, found some")
        recording = _off_rails(recording, say)
    beside = None if beside is None else Path(beside)
    asked = Asked(method, steps, seed, rates, progress, beside, say)
    made = (_nuts if method == "nuts" else _pmmh)(recording, model, asked)
    tree = _tree(recording, model, made, seed)
    if tree.attrs["on_a_line"]:
        say("a chain went to where the triads lie on one line: the flat motion prior has no bound"
            " there, and these triads are not far enough from it (docs/findings.md)")  # fmt: skip
    return tree


def _off_rails(recording: Recording, say: Say) -> Recording:
    """Without samples whose gyroscopes' spread a rail has cut."""
    lost = recording.saturated_gyroscopes().any(axis=(1, 2))
    if lost.all():
        raise InputError(
            "--rates spread: expected samples with all gyroscopes off their rail, found none"
        )
    if lost.any():
        say(f"left out {lost.sum()} of {lost.size} samples with a gyroscope at its rail")
    return recording.select(~lost) if lost.any() else recording


def summary(posterior: xr.DataTree) -> pd.DataFrame:
    """One row per coordinate of what `sample` gave: mean, sd and quantiles (m), R-hat, ESS."""
    from imuarray.posterior.chains import chains_of
    from imuarray.posterior.diagnostics import summarise

    labels = [str(label) for label in posterior["posterior"]["accelerometer"].to_numpy()]
    return summarise(chains_of(posterior), labels, RHAT_THRESHOLD)[1]


def _tree(recording: Recording, model: ArrayModel, made: Made, seed: int) -> xr.DataTree:
    from imuarray.posterior.chains import chain_tree
    from imuarray.posterior.diagnostics import summarise

    labels = recording.accelerometer_labels[1:]
    names = parameter_names(model, (recording.accelerometer_labels, recording.gyroscope_labels))
    verdict, _, _ = summarise(made.chains, labels, RHAT_THRESHOLD)
    attrs: dict[str, Any] = {**stamp({"recording": made.key, **made.settings}, seed)}
    kept = "burn_in_draws", "burn_in_steps", "steps", "rhat_max", "ess_min"
    attrs |= {name: verdict[name] for name in kept}
    fallen = not model.effects and flattest(made.chains.draws, recording) < FLAT
    attrs["converged"] = int(verdict["converged"] and not fallen)
    attrs |= {"divergent": made.chains.divergent, "on_a_line": int(fallen)}
    if made.checkpoint is not None:
        attrs["checkpoint"] = str(made.checkpoint)
    return chain_tree(made.chains, labels, made.prior, attrs, names)


def flattest(draws, recording: Recording) -> float:
    """The least distance of drawn triads from one line, over that of the nominal ones.

    ``draws`` (chains, draws, P), positions first. Towards a line the density under the flat
    motion prior grows as the distance to the power -T.
    """
    size = 3 * (len(recording.accelerometer_labels) - 1)
    places = draws[..., :size].reshape(-1, size // 3, 3)
    places = np.concatenate([np.zeros_like(places[:, :1]), places], axis=1)
    nominal = recording.relative_positions()[None]
    spread = [
        np.linalg.svd(p - p.mean(axis=1, keepdims=True), compute_uv=False)[:, 1:]
        for p in (places, nominal)
    ]
    distance = [np.sqrt(np.sum(part**2, axis=1)) for part in spread]
    return float(distance[0].min() / distance[1][0])


def _key(recording, model, prior, asked: Asked, *rest) -> str:
    return digest(
        recording.time, recording.specific_force, recording.angular_rate,
        recording.saturated_gyroscopes(), recording.accelerometer_position, model.effect_start,
        model.effect_prior_mean, model.effect_prior_sd, list(model.clock or ()),
        model.noise.accelerometer, model.noise.gyroscope, prior.mean, prior.sd,
        *rest, asked.seed, list(model.effects), asked.rates, code_digest(),
    )  # fmt: skip


def _pmmh(recording, model, asked: Asked) -> Made:
    """PmMH tuned as in section III-C of paper 2021; continues a checkpoint."""
    asked.say("tuning N and the step length ...")
    rng = _stream(asked, "tuning")
    target, mode, step, draws = tuned_target(recording, model, asked.rates, rng, asked.say)
    steps = asked.steps or PMMH_STEPS[not model.effects]
    thin = max(1, steps // STORED)
    key = _key(recording, model, target.prior, asked, draws, step, steps)
    checkpoint = _checkpoint(asked, key)
    rng = _stream(asked, "starts")
    chains = run_chains(
        target, spread_starts(mode, target.prior.sd / 3, rng), step, max(4, steps // thin), thin,
        asked.seed, checkpoint=checkpoint, key=key, quiet=not asked.progress,
    )  # fmt: skip
    return Made(chains, target.prior, key, {"draws_per_sample": draws}, checkpoint)


def _checkpoint(asked: Asked, key: str) -> Path | None:
    """Where this run's state is kept; says what other runs have left there."""
    out = asked.beside
    if out is None:
        return None
    checkpoint = checkpoint_beside(out, key)
    for other in out.parent.glob(f".{out.name}.*.npz"):
        if other != checkpoint:
            asked.say(f"{other}: a checkpoint of other data, settings or code, not continued")
    return checkpoint


def _nuts(recording, model, asked: Asked) -> Made:
    """NUTS on the marginal likelihood, whitened at the mode."""
    from imuarray.posterior.nuts import run_nuts

    asked.say("finding the mode ...")
    log_density, prior, mode, covariance = density_of(recording, model, asked.rates, asked.say)
    rng = _stream(asked, "starts")
    if model.effects:  # clocks and shifts have modes of their own far away
        starts = rng.multivariate_normal(mode, APART**2 * covariance, size=2)
    else:
        starts = spread_starts(prior.mean, prior.sd, rng)
    steps = asked.steps or NUTS_STEPS
    found = run_nuts(
        log_density, mode, covariance, starts, NUTS_WARMUP, steps, asked.seed,
        quiet=not asked.progress,
    )  # fmt: skip
    key = _key(recording, model, prior, asked, steps, "nuts")
    return Made(found, prior, key, {"divergent": found.divergent})


def _stream(asked: Asked, name: str):
    return stream(asked.seed, "sample", name)
