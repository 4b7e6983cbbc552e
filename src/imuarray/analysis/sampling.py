"""Chains of the positions' posterior, as one labelled tree."""

from collections.abc import Sequence
from os import PathLike
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
    posterior_of,
    traced,
)
from imuarray.analysis.model import Say, assumed, require_together, silent, usable
from imuarray.engine.dataset import effects_of
from imuarray.engine.parameters import model_of
from imuarray.errors import require_integer, require_one_of
from imuarray.model import ArrayModel
from imuarray.model.array_model import parameter_names
from imuarray.posterior.chains import Chains
from imuarray.posterior.generic import SCALES
from imuarray.provenance import code_digest, digest, stamp
from imuarray.recording import Recording
from imuarray.streams import stream

# 1000 left the worst of 93 R-hats above 1.01 now and then; with effects a step costs ten times more
NUTS_STEPS, NUTS_WARMUP = (1250, 750), 300
APART = 2.0  # posterior sds by which the starts differ
FEW = 400  # effective draws; fewer tell neither quantiles nor R-hat (Vehtari and others, 2021)


class Asked(NamedTuple):
    """Options of a sampler."""

    method: str
    steps: int | None
    seed: int
    progress: bool
    say: Say


class SamplerRun(NamedTuple):
    """Chains, and what made them."""

    chains: Chains
    posterior: Posterior
    key: str  # digest of everything that they depend on
    attrs: dict  # attributes: the sampler, Pareto's k, what else was tried
    short: str = ""  # why they are not enough, where the sampler itself says so


def sample(
    recording: Recording, model: str | PathLike = "sensors", method: str = "auto",
    steps: int | None = None, seed: int = 0, effects: Sequence[str] = (),
    accelerometer_noise: float | None = None, progress: bool = False, say: Say = silent,
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
        sampler on the same; ``"auto"``: the former where Pareto's k of its weights is 0.7 at most
        and R-hat 1.01 and ESS 1000 are reached, else NUTS.
    steps
        Transitions of each chain, after the warm-up in NUTS' case; by default as many as
        independent proposals need.
    seed
        Of the random numbers.
    accelerometer_noise
        Of the papers' model: sd (m/s^2) that is taken for known; by default the noise of both
        kinds is unknown, log-normal about the declared one.
    progress
        Whether to show a bar.
    say
        Called with each remark on the work's course.

    Returns
    -------
    xarray.DataTree
        ``posterior/position`` (chain, draw, accelerometer, axis) m, with effects
        ``posterior/effect_parameter``, and ``posterior/sd`` of noise and motion where unknown
        (SI); ``sample_stats``, ``prior``. Attributes: ``sampler``, ``pareto_k`` and ``instead_of``
        (why not the other sampler); the chains' verdict (``converged``, ``rhat_max``, ``ess_min``,
        burn-in) and the origin.

    Raises
    ------
    InputError
        The recording does not determine the positions, or the options do not go together.
    """
    require_one_of("method", method, methods.SAMPLING)
    if steps is not None:
        require_integer("steps", steps)
    require_integer("seed", seed, 0)
    require_together(model, [recording], effects, accelerometer_noise)
    moving, posterior = usable(recording, say), None
    if model != "papers":
        posterior = _beyond(recording, str(model), effects, say)
    if posterior is None:
        moving, known = assumed(moving, accelerometer_noise), accelerometer_noise is not None
        posterior = posterior_of(moving, model_of(moving), (known, False), say)
    return tree_of(_exact(posterior, Asked(method, steps, seed, progress, say)), seed)


def _beyond(recording: Recording, model: str, effects, say: Say) -> Posterior | None:
    """Under a model that has more than the papers'; None where there is no more to be had."""
    found = fitted_beyond(recording, model, effects, say)
    if found is None or not effects_of(found):
        return None
    if not found.converged:
        say(NOT_CONVERGED)
    return posterior_beyond(recording, found)


def summary(posterior: xr.DataTree) -> pd.DataFrame:
    """One row per coordinate of what `sample` gave: mean, sd and quantiles (m), R-hat, ESS."""
    from imuarray.posterior.chains import chains_of
    from imuarray.posterior.diagnostics import RHAT, summarise

    labels = [str(label) for label in posterior["posterior"]["accelerometer"].to_numpy()]
    return summarise(chains_of(posterior), labels, RHAT)[1]


def tree_of(run: SamplerRun, seed: int) -> xr.DataTree:
    """A sampler's chains with their verdict and origin, as `sample` returns them."""
    from imuarray.posterior.chains import chain_tree
    from imuarray.posterior.diagnostics import RHAT, summarise

    recording, model = run.posterior.recording, run.posterior.model
    labels = recording.accelerometer_labels[1:]
    names = parameter_names(model, (recording.accelerometer_labels, recording.gyroscope_labels))
    verdict, _, _ = summarise(run.chains, labels, RHAT)
    attrs: dict[str, Any] = {**stamp({"recording": run.key}, seed)}
    kept = "burn_in_draws", "burn_in_steps", "steps", "rhat_max", "ess_min"
    attrs |= {name: verdict[name] for name in kept} | run.attrs
    sound = verdict["converged"] and verdict["ess_min"] >= FEW and not run.short
    attrs |= {"converged": int(sound), "divergent": run.chains.divergent, **_noise(model)}
    unit = dict(zip(SCALES, [*_noise(model).values(), *model.motion_sd], strict=True))
    sds = {name: unit[name] for name in run.posterior.scales}
    return chain_tree(run.chains, labels, run.posterior.prior, attrs, names, sds)


def _noise(model: ArrayModel) -> dict[str, float]:
    """Rms noise over the triads of each kind (m/s^2, rad/s)."""
    kinds = "accelerometer", "gyroscope"
    variances = [np.diag(getattr(model.noise, kind)).mean() for kind in kinds]
    return {f"{kind}_noise_sd": float(v**0.5) for kind, v in zip(kinds, variances, strict=True)}


def _key(posterior: Posterior, asked: Asked, *rest) -> str:
    recording, model, prior = posterior.recording, posterior.model, posterior.prior
    used, root = posterior.readings, getattr(prior, "root", None)
    return digest(
        recording.time, recording.specific_force, recording.angular_rate,
        recording.saturated_gyroscopes(), recording.accelerometer_position,
        *(() if used is None else (used.time, used.values, used.weights, root)),
        list(model.clock or ()), model.noise.accelerometer, model.noise.gyroscope,
        list(model.motion_sd), list(model.derivative_sd), prior.mean, prior.sd, *rest, asked.seed,
        list(model.effects), asked.method, code_digest(),
    )  # fmt: skip


def _apart(posterior: Posterior, rng) -> np.ndarray:
    """Two starts some posterior sds from the mode: far away there are modes of others' own."""
    return rng.multivariate_normal(posterior.mode, APART**2 * posterior.covariance, size=2)


def _exact(posterior: Posterior, asked: Asked) -> SamplerRun:
    """On the marginal likelihood: independent proposals, or NUTS where these are not enough."""
    density, told = traced(posterior, asked.say), {}
    if asked.method != "nuts":
        made = _independent(posterior, asked, *density)
        if asked.method == "independent" or not made.short:
            return made
        told = {"pareto_k": made.attrs["pareto_k"], "instead_of": made.short}
        asked.say(f"{made.short}: NUTS instead")
    steps = asked.steps or NUTS_STEPS[bool(posterior.model.effects)]
    chains = _nuts(posterior, asked, steps, *density)
    return SamplerRun(chains, posterior, _key(posterior, asked, steps), {"sampler": "nuts"} | told)


def _independent(posterior: Posterior, asked: Asked, log_density, data) -> SamplerRun:
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
    return SamplerRun(chains, posterior, _key(posterior, asked, asked.steps), told, short=short)


def _nuts(posterior: Posterior, asked: Asked, steps: int, log_density, data) -> Chains:
    """NUTS, whitened at the mode."""
    from imuarray.posterior.nuts import run_nuts

    starts = _apart(posterior, stream(asked.seed, "sample", "starts"))
    return run_nuts(
        log_density, posterior.mode, posterior.covariance, starts, NUTS_WARMUP, steps, asked.seed,
        quiet=not asked.progress, data=data,
    )  # fmt: skip
