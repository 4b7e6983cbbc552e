"""Chains of the positions' posterior, as one labelled tree."""

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.analysis import methods
from imuarray.analysis.density import Posterior, posterior_beyond, posterior_of, traced
from imuarray.analysis.model import Notify, assumed, require_together, silent, usable
from imuarray.analysis.sensors import fitted
from imuarray.analysis.settings import SETTINGS
from imuarray.engine.dataset import effects_of
from imuarray.errors import require_integer, require_one_of
from imuarray.model.array_model import parameter_names
from imuarray.model.effects import EFFECTS, KINDS
from imuarray.posterior.chains import Chains, chain_tree, chains_of
from imuarray.posterior.diagnostics import ess, rhat, summarise
from imuarray.posterior.generic import SCALES
from imuarray.posterior.independent import run_independent
from imuarray.posterior.nuts import run_nuts
from imuarray.posterior.settings import SETTINGS as POSTERIOR
from imuarray.provenance import code_digest, digest, stamp
from imuarray.recording import Recording
from imuarray.streams import stream

# 1000 left the worst of 93 R-hats above 1.01 now and then; with effects a step costs ten times more
NUTS_STEPS, NUTS_WARMUP = (1250, 750), 300


def sample(
    recording: Recording, model: str | PathLike = "sensors", method: str = "auto",
    steps: int | None = None, seed: int = 0, effects: Sequence[str] = (),
    accelerometer_noise: float | None = None, progress: bool = False, notify: Notify = silent,
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
        and R-hat 1.01 and ESS 1000 are reached, or the mode was not found, else NUTS.
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
    notify
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
    moving, posterior = usable(recording, notify), None
    if model != "papers":
        found, _ = fitted([recording], str(model), effects, notify, plain=False)
        if found is not None and effects_of(found):
            posterior = posterior_beyond(recording, found, notify)
    if posterior is None:
        moving, known = assumed(moving, accelerometer_noise), accelerometer_noise is not None
        posterior = posterior_of(moving, known, notify)
    if model != "papers":
        # a scale common to all rates and to time, where the model has no parameter for it
        scaled = [EFFECTS[name] for name in posterior.model.effects if EFFECTS[name].resizes]
        own = any(effect.kinds == [1] for effect in scaled)
        sds = [0.0 if own else moving.gyroscope_common_scale_sd, moving.clock_sd]
        posterior = posterior._replace(size_sd=2.0 * float(np.hypot(*np.nan_to_num(sds))))
    return _exact(posterior, method, steps, seed, not progress, notify)


def _exact(
    posterior: Posterior, method: str, steps: int | None, seed: int, quiet: bool, notify: Notify
) -> xr.DataTree:
    """On the marginal likelihood: independent proposals, or NUTS where these are not enough."""
    (log_density, data), mode = traced(posterior, notify), posterior.mode
    attrs: dict[str, Any] = {"sampler": "nuts"}
    if method != "nuts":
        names = "sample", "independent"
        chains, k = run_independent(
            log_density, mode, posterior.covariance, steps, seed, names, quiet, data
        )
        worst, least = rhat(chains.draws).max(), ess(chains.draws).min()
        few = steps is None and (worst > POSTERIOR.rhat or least < POSTERIOR.effective)
        short = f"independent proposals: Pareto's k {k:.2f}, R-hat {worst:.3f}, ESS {least:.0f}"
        short = short if few or not k <= POSTERIOR.unreliable else ""  # NaN is not enough, too
        if method == "independent" or not short or not posterior.converged:  # NUTS would take hours
            attrs, key = {"sampler": "independent"}, _key(posterior, steps, seed, method)
            return tree_of(posterior, chains, attrs | {"pareto_k": k}, key, seed, bool(short))
        attrs |= {"pareto_k": k, "instead_of": short}
        notify(f"{short}: NUTS instead")
    steps = steps or NUTS_STEPS[bool(posterior.model.effects)]
    # two starts some posterior sds from the mode: far away there are modes of others' own
    rng = stream(seed, "sample", "starts")
    starts = rng.multivariate_normal(mode, SETTINGS.starts_apart**2 * posterior.covariance, size=2)
    chains = run_nuts(
        log_density, mode, posterior.covariance, starts, NUTS_WARMUP, steps, seed, quiet=quiet,
        data=data,
    )  # fmt: skip
    return tree_of(posterior, chains, attrs, _key(posterior, steps, seed, method), seed)


def _key(posterior: Posterior, steps: int | None, seed: int, method: str) -> str:
    """Digest of everything that chains depend on."""
    recording, model, prior = posterior.recording, posterior.model, posterior.prior
    used = posterior.readings
    return digest(
        recording.time, recording.specific_force, recording.angular_rate,
        recording.saturated_gyroscopes(), recording.accelerometer_position,
        *(() if used is None else (used.time, used.values, used.weights, prior.root)),
        list(model.clock or ()), model.noise.accelerometer, model.noise.gyroscope,
        list(model.motion_sd), list(model.derivative_sd), prior.mean, prior.sd, steps, seed,
        list(model.effects), method, code_digest(),
    )  # fmt: skip


def tree_of(
    posterior: Posterior, chains: Chains, more: dict, key: str, seed: int, short: bool = False
) -> xr.DataTree:
    """Chains with their verdict and origin, as `sample` returns them.

    ``more``: attributes on the sampler; ``key``: digest of what the chains depend on; ``short``:
    whether the sampler itself says that they are not enough.
    """
    recording, model = posterior.recording, posterior.model
    labels = recording.accelerometer_labels[1:]
    chains = resized(chains, 3 * len(labels), posterior.size_sd, seed)
    names = parameter_names(model, (recording.accelerometer_labels, recording.gyroscope_labels))
    verdict, _, _ = summarise(chains, labels, POSTERIOR.rhat)
    attrs: dict[str, Any] = {**stamp({"recording": key}, seed)}
    kept = "burn_in_draws", "burn_in_steps", "steps", "rhat_max", "ess_min"
    attrs |= {name: verdict[name] for name in kept} | more
    sound = verdict["converged"] and verdict["ess_min"] >= SETTINGS.few_effective and not short
    rms = {kind: float(np.diag(getattr(model.noise, kind)).mean() ** 0.5) for kind in KINDS}
    attrs |= {"converged": int(sound), "divergent": chains.divergent}
    attrs |= {f"{kind}_noise_sd": sd for kind, sd in rms.items()}
    unit = dict(zip(SCALES, [*rms.values(), *model.motion_sd], strict=True))
    sds = {name: unit[name] for name in posterior.scales}
    return chain_tree(chains, labels, posterior.prior, attrs, names, sds)


def resized(chains: Chains, size: int, sd: float, seed: int) -> Chains:
    """With the positions' ``size`` coordinates all larger by one factor a draw, of ``sd`` about 1.

    The readings' likelihood says nothing of a scale common to gyroscopes and clock: it is the
    array's size. Maps that first order corrected are taken for exact: what is left of them widens
    the sds of 500 samples by 1 %.
    """
    if not sd:
        return chains
    factor = np.exp(sd * stream(seed, "sample", "size").standard_normal(chains.draws.shape[:2]))
    draws = chains.draws.copy()
    draws[..., :size] *= factor[..., None]
    return replace(chains, draws=draws)


def summary(posterior: xr.DataTree) -> pd.DataFrame:
    """One row per coordinate of what `sample` gave: mean, sd and quantiles (m), R-hat, ESS."""
    labels = [str(label) for label in posterior["posterior"]["accelerometer"].to_numpy()]
    return summarise(chains_of(posterior), labels, POSTERIOR.rhat)[1]
