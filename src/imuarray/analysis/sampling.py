"""Chains of the positions' posterior, as one labelled tree."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.analysis import methods
from imuarray.analysis.beyond import posterior_beyond
from imuarray.analysis.calibration import fitted_beyond
from imuarray.analysis.density import (
    NOT_CONVERGED,
    Posterior,
    at_estimate,
    posterior_of,
    traced,
    tuned_target,
)
from imuarray.analysis.model import Say, assumed, require_together, silent, usable
from imuarray.engine.dataset import effects_of
from imuarray.engine.parameters import model_of
from imuarray.errors import InputError, require_integer, require_one_of
from imuarray.model import ArrayModel
from imuarray.model.array_model import parameter_names
from imuarray.posterior.chains import Chains
from imuarray.posterior.generic import SCALES
from imuarray.posterior.pmmh import checkpoint_beside, run_chains, spread_starts
from imuarray.provenance import code_digest, digest, stamp
from imuarray.recording import Recording
from imuarray.streams import stream

STEPS = 200_000  # of PmMH
# 1000 left the worst of 93 R-hats above 1.01 now and then; with effects a step costs ten times more
NUTS_STEPS, NUTS_WARMUP = (1250, 750), 300
APART = 2.0  # posterior sds by which the starts differ
STORED = 2000
FEW = 400  # effective draws; fewer tell neither quantiles nor R-hat (Vehtari and others, 2021)
FLAT = 0.03  # of the mode's distance from a line: nearer the flat prior has its hole


class Asked(NamedTuple):
    """Options of a sampler; ``beside`` is the file beside which a checkpoint is kept, if any."""

    method: str
    motion_prior: str
    steps: int | None
    seed: int
    rates: str
    progress: bool
    beside: Path | None
    say: Say


class Made(NamedTuple):
    """Chains, and what made them."""

    chains: Chains
    posterior: Posterior
    key: str  # digest of everything that they depend on
    told: dict  # attributes: the sampler, Pareto's k, what else was tried
    settings: dict = {}
    checkpoint: Path | None = None
    short: str = ""  # why they are not enough, where the sampler itself says so


def sample(
    recording: Recording, model: str | PathLike = "sensors", method: str = "auto",
    steps: int | None = None, seed: int = 0, rates: str = "declared",
    effects: Sequence[str] = (), accelerometer_noise: float | None = None,
    motion_prior: str = "proper", progress: bool = False, say: Say = silent,
    beside: str | PathLike | None = None,
) -> xr.DataTree:  # fmt: skip
    """Chains of the posterior of the accelerometers' positions.

    Parameters
    ----------
    recording
        Moving samples; still poses and samples with an accelerometer at its rail are left out.
    model, effects
        As in `imuarray.calibrate`: with ``"sensors"`` the sensor model's parts that gain on the
        recording's held-out time, with what they do not determine left out; where none gains, and
        where there are too few samples to tell, the papers' model.
    method
        ``"independent"``: Metropolis-Hastings on the exact marginal likelihood with independent
        proposals from the normal density about the mode, in four chains; ``"nuts"``: the no-U-turn
        sampler on the same; ``"auto"``: the former where Pareto's k of its weights is 0.7 at most,
        R-hat 1.01 and ESS 1000 are reached and the motion's prior is proper, else NUTS;
        ``"pmmh"``, of the papers' model: pseudo-marginal Metropolis-Hastings (paper 2021), N and
        the step length tuned as in section III-C, noise and the motion's size at their estimates.
    steps
        Transitions of each chain, after the warm-up in NUTS' case; by default as many as
        independent proposals need.
    seed
        Of the random numbers.
    rates
        p(omega | y_g) from the ``"declared"`` gyroscopes, or from the ``"spread"`` among those
        of each sample (equation (30)), with the papers' flat prior and the declared noise.
    accelerometer_noise
        Of the papers' model: sd (m/s^2) that is taken for known; by default the noise of both
        kinds is unknown, log-normal about the declared one.
    motion_prior
        ``"proper"``: angular rate and acceleration are normal of the recording's own size;
        ``"flat"``, of the papers' model: paper 2021's, which shrinks the array (docs/findings.md),
        and the noise at its estimate.
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
        ``posterior/effect_parameter``, and ``posterior/sd`` of noise and motion where unknown
        (SI); ``sample_stats``, ``prior``. Attributes: ``sampler``, ``pareto_k`` and ``instead_of``
        (why not the other sampler); the chains' verdict (``converged``, ``rhat_max``, ``ess_min``,
        burn-in), ``shrunk_by_sds`` and the origin.

    Raises
    ------
    InputError
        The recording does not determine the positions, or the options do not go together.
    """
    require_one_of("method", method, methods.SAMPLING)
    require_one_of("rates", rates, methods.RATES)
    require_one_of("motion_prior", motion_prior, methods.MOTION_PRIORS)
    if steps is not None:
        require_integer("steps", steps)
    require_integer("seed", seed, 0)
    require_together(model, [recording], effects, accelerometer_noise)
    flat = motion_prior == "flat"
    if method == "pmmh" and model != "papers":
        raise InputError(f"--method pmmh: expected --model papers with it, found {model}")
    if flat and model != "papers":
        raise InputError(f"--motion-prior flat: expected --model papers with it, found {model}")
    if rates == "spread" and not flat:
        raise InputError("--rates spread: expected --motion-prior flat with it, found proper")
    moving, posterior = usable(recording, say), None
    if model != "papers":
        posterior = _beyond(recording, str(model), effects, say)
    if posterior is None:
        if rates == "spread":
            moving = _off_rails(moving, say)
        moving, told = assumed(moving, accelerometer_noise), accelerometer_noise is not None
        posterior = posterior_of(moving, model_of(moving), flat, rates, (told, False), say)
    pull = shrinkage(posterior) if flat else 0.0
    if flat:
        say(f"the flat motion prior makes the array {pull:.1f} posterior sds smaller than it is"
            " (docs/findings.md)")  # fmt: skip
    beside = None if beside is None else Path(beside)
    asked = Asked(method, motion_prior, steps, seed, rates, progress, beside, say)
    made = (_pmmh if method == "pmmh" else _exact)(posterior, asked)
    tree = _tree(made, seed, pull)
    if tree.attrs["on_a_line"]:
        say("a chain went to where the triads lie on one line: the flat motion prior has no bound"
            " there, and these triads are not far enough from it (docs/findings.md)")  # fmt: skip
    return tree


def _beyond(recording: Recording, model: str, effects, say: Say) -> Posterior | None:
    """Under a model that has more than the papers'; None where there is no more to be had."""
    found = fitted_beyond(recording, model, effects, say)
    if found is None or not effects_of(found):
        return None
    if not found.converged:
        say(NOT_CONVERGED)
    return posterior_beyond(recording, found)


def shrinkage(posterior: Posterior) -> float:
    """By how many posterior sds the flat motion prior shrinks the array, to first order.

    Its determinant pulls the log of the size by 3 T, against the information on it at the mode.
    """
    size = np.linalg.norm(posterior.mode)
    along = posterior.mode / size
    relative = np.sqrt(along @ posterior.covariance @ along) / size
    return float(3 * len(posterior.recording.time) * relative)


def _off_rails(recording: Recording, say: Say) -> Recording:
    """Without samples whose gyroscopes' spread a rail has cut."""
    lost = recording.at_rail("gyroscope")
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
    from imuarray.posterior.diagnostics import RHAT, summarise

    labels = [str(label) for label in posterior["posterior"]["accelerometer"].to_numpy()]
    return summarise(chains_of(posterior), labels, RHAT)[1]


def _tree(made: Made, seed: int, pull: float) -> xr.DataTree:
    from imuarray.posterior.chains import chain_tree
    from imuarray.posterior.diagnostics import RHAT, summarise

    recording, model = made.posterior.recording, made.posterior.model
    labels = recording.accelerometer_labels[1:]
    names = parameter_names(model, (recording.accelerometer_labels, recording.gyroscope_labels))
    verdict, _, _ = summarise(made.chains, labels, RHAT)
    attrs: dict[str, Any] = {**stamp({"recording": made.key, **made.settings}, seed)}
    kept = "burn_in_draws", "burn_in_steps", "steps", "rhat_max", "ess_min"
    attrs |= {name: verdict[name] for name in kept} | made.told
    fallen = made.posterior.flat and flattest(made.chains.draws, recording) < FLAT
    sound = verdict["converged"] and verdict["ess_min"] >= FEW and not made.short
    attrs["converged"] = int(sound and not fallen)
    attrs |= {"divergent": made.chains.divergent, "on_a_line": int(fallen)}
    attrs |= {"shrunk_by_sds": pull, **_noise(model)}
    if made.checkpoint is not None:
        attrs["checkpoint"] = str(made.checkpoint)
    unit = dict(zip(SCALES, [*_noise(model).values(), *model.motion_sd], strict=True))
    sds = {name: unit[name] for name in made.posterior.scales}
    return chain_tree(made.chains, labels, made.posterior.prior, attrs, names, sds)


def _noise(model: ArrayModel) -> dict[str, float]:
    """Rms noise over the triads of each kind (m/s^2, rad/s)."""
    kinds = "accelerometer", "gyroscope"
    variances = [np.diag(getattr(model.noise, kind)).mean() for kind in kinds]
    return {f"{kind}_noise_sd": float(v**0.5) for kind, v in zip(kinds, variances, strict=True)}


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


def _key(posterior: Posterior, asked: Asked, *rest) -> str:
    recording, model, prior = posterior.recording, posterior.model, posterior.prior
    used, root = posterior.readings, getattr(prior, "root", None)
    return digest(
        recording.time, recording.specific_force, recording.angular_rate,
        recording.saturated_gyroscopes(), recording.accelerometer_position,
        *(() if used is None else (used.time, used.values, used.weights, root)),
        list(model.clock or ()), model.noise.accelerometer, model.noise.gyroscope,
        list(model.motion_sd), list(model.derivative_sd), prior.mean, prior.sd, *rest, asked.seed,
        list(model.effects), asked.rates, asked.motion_prior, asked.method, code_digest(),
    )  # fmt: skip


def _pmmh(posterior: Posterior, asked: Asked) -> Made:
    """PmMH, tuned; continues a checkpoint."""
    asked.say("tuning N and the step length ...")
    posterior = at_estimate(posterior)
    mode, prior = posterior.mode, posterior.prior
    target, step, draws = tuned_target(posterior, asked.rates, _stream(asked, "tuning"), asked.say)
    steps = asked.steps or STEPS
    thin = max(1, steps // STORED)
    key = _key(posterior, asked, draws, step, steps)
    checkpoint = _checkpoint(asked, key)
    starts = spread_starts(mode, prior.sd / 3, _stream(asked, "starts"))
    chains = run_chains(
        target, starts, step, max(4, steps // thin), thin, asked.seed, checkpoint=checkpoint,
        key=key, quiet=not asked.progress,
    )  # fmt: skip
    told, settings = {"sampler": asked.method}, {"draws_per_sample": draws}
    return Made(chains, posterior, key, told, settings, checkpoint)


def _apart(posterior: Posterior, rng) -> np.ndarray:
    """Two starts some posterior sds from the mode: far away there are modes of others' own."""
    return rng.multivariate_normal(posterior.mode, APART**2 * posterior.covariance, size=2)


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


def _exact(posterior: Posterior, asked: Asked) -> Made:
    """On the marginal likelihood: independent proposals, or NUTS where these are not enough."""
    density, told = traced(posterior, asked.rates, asked.say), {}
    # towards a line the flat prior's density has no bound, which proposals at the mode do not see
    if asked.method == "independent" or (asked.method == "auto" and not posterior.flat):
        made = _independent(posterior, asked, *density)
        if asked.method == "independent" or not made.short:
            return made
        told = {"pareto_k": made.told["pareto_k"], "instead_of": made.short}
        asked.say(f"{made.short}: NUTS instead")
    steps = asked.steps or NUTS_STEPS[bool(posterior.model.effects)]
    chains = _nuts(posterior, asked, steps, *density)
    return Made(chains, posterior, _key(posterior, asked, steps), {"sampler": "nuts"} | told)


def _independent(posterior: Posterior, asked: Asked, log_density, data) -> Made:
    from imuarray.posterior.diagnostics import ENOUGH, RHAT, ess, rhat
    from imuarray.posterior.independent import UNRELIABLE, run_independent

    chains, k = run_independent(
        log_density, posterior.mode, posterior.covariance, asked.steps, asked.seed,
        ("sample", "independent"), not asked.progress, data,
    )  # fmt: skip
    told = {"sampler": "independent", "pareto_k": k}
    worst, least, short = rhat(chains.draws).max(), ess(chains.draws).min(), ""
    if not k <= UNRELIABLE or (asked.steps is None and (worst > RHAT or least < ENOUGH)):
        short = f"independent proposals: Pareto's k {k:.2f}, R-hat {worst:.3f}, ESS {least:.0f}"
    return Made(chains, posterior, _key(posterior, asked, asked.steps), told, short=short)


def _nuts(posterior: Posterior, asked: Asked, steps: int, log_density, data) -> Chains:
    """NUTS, whitened at the mode."""
    from imuarray.posterior.nuts import run_nuts

    rng, prior = _stream(asked, "starts"), posterior.prior
    wide = posterior.flat and not posterior.model.effects
    starts = spread_starts(prior.mean, prior.sd, rng) if wide else _apart(posterior, rng)
    return run_nuts(
        log_density, posterior.mode, posterior.covariance, starts, NUTS_WARMUP, steps, asked.seed,
        quiet=not asked.progress, data=data,
    )  # fmt: skip


def _stream(asked: Asked, name: str):
    return stream(asked.seed, "sample", name)
