"""Chains of a recording's positions as paper 2021 has them: PmMH under the flat motion prior."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from imuarray.analysis.density import NOT_CONVERGED, Posterior, prior_of
from imuarray.analysis.model import Notify, assumed, silent, usable
from imuarray.analysis.noise import as_declared, mode_of
from imuarray.analysis.sampling import NUTS_STEPS, NUTS_WARMUP, tree_of
from imuarray.engine.parameters import model_of
from imuarray.errors import InputError, require_one_of
from imuarray.geometry import positions_of
from imuarray.posterior.chains import Chains
from imuarray.posterior.nuts import run_nuts
from imuarray.provenance import code_digest, digest
from imuarray.recording import Recording
from imuarray.streams import stream
from imuarray_papers.measured.positions import locate
from imuarray_papers.posterior import tuning
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray_papers.posterior.pmmh import run_chains, spread_starts
from imuarray_papers.posterior.proposals import sample_covariance

RATES = ("declared", "spread")  # what p(omega | y_g) is made from
STEPS, STORED = 200_000, 2000  # of PmMH, and how many are kept
FLAT = 0.03  # of the mode's distance from a line: nearer the flat prior has its hole
SHRUNK = 1.0  # sds from which an answer is not to be trusted: 95 % intervals cover 83 %


class Flat(NamedTuple):
    """The posterior under the flat motion prior, noise known, and its likelihood (26a)."""

    posterior: Posterior
    likelihood: Likelihood

    @property
    def shrinkage(self) -> float:
        """By how many posterior sds the flat prior shrinks the array, to first order.

        Its determinant pulls the log of the size by 3 T, against the information at the mode.
        """
        mode, covariance = self.posterior.mode, self.posterior.covariance
        along = mode / np.linalg.norm(mode)
        relative = np.sqrt(along @ covariance @ along) / np.linalg.norm(mode)
        return float(3 * self.likelihood.samples * relative)

    def exact(self):
        """Log density of theta (P,) without Monte Carlo noise, to be traced by JAX."""
        marginal = self.likelihood.marginal(positions_of(self.posterior.mode))
        prior = self.posterior.prior

        def log_density(theta):
            away = (theta - prior.mean) / prior.sd
            return marginal.log_density(theta) - 0.5 * (away @ away)

        return log_density


def flat(recording: Recording, rates: str = "declared", notify: Notify = silent) -> Flat:
    """The posterior of a recording under the flat motion prior and the declared noise.

    Around its mode; with ``rates="spread"`` p(omega | y_g) is that of equation (30).
    """
    model, density = model_of(recording), None
    if rates == "spread":
        found = locate(recording, recording.accelerometer_noise_sd)
        mode, density = found.mean, sample_covariance(recording.angular_rate)
    else:
        found = mode_of(*as_declared(recording))
        mode = found.positions
    if not found.converged:
        notify(NOT_CONVERGED)
    likelihood = Likelihood.of(
        model, recording.specific_force, recording.angular_rate, recording.saturated_gyroscopes(),
        rate_distribution=density,
    )  # fmt: skip
    prior, theta = prior_of(recording, model), mode[1:].ravel()
    return Flat(Posterior(recording, model, prior, theta, found.covariance, ()), likelihood)


def sample(
    recording: Recording, method: str = "pmmh", steps: int | None = None, seed: int = 0,
    rates: str = "declared", accelerometer_noise: float | None = None, progress: bool = False,
    notify: Notify = silent,
) -> xr.DataTree:  # fmt: skip
    """Chains of the positions' posterior; the options are those of `python -m imuarray_papers`.

    Returns what `imuarray.sample` does, and the attributes ``shrunk_by_sds`` (`Flat.shrinkage`) and
    ``on_a_line`` (whether a chain came near triads on one line, where the density has no bound).
    InputError where the recording does not determine the positions.
    """
    require_one_of("rates", rates, RATES)
    recording = usable(recording, notify)
    if rates == "spread":
        recording = _off_rails(recording, notify)
    recording = assumed(recording, accelerometer_noise)
    target = flat(recording, rates, notify)
    notify(f"the flat motion prior makes the array {target.shrinkage:.1f} posterior sds smaller"
        " than it is (docs/findings.md)")  # fmt: skip
    if method == "nuts":
        chains, attrs = _nuts(target, steps or NUTS_STEPS[0], seed, not progress), {}
    else:
        chains, attrs = _pmmh(target, steps or STEPS, seed, not progress, notify)
    key = digest(
        recording.time, recording.specific_force, recording.angular_rate, rates, method, steps,
        recording.accelerometer_noise_sd, code_digest(),
    )  # fmt: skip
    tree = tree_of(target.posterior, chains, {"sampler": method} | attrs, key, seed)
    fallen = flattest(chains.draws, recording) < FLAT
    tree.attrs |= {"shrunk_by_sds": target.shrinkage, "on_a_line": int(fallen)}
    if fallen:
        tree.attrs["converged"] = 0
        notify("a chain went to where the triads lie on one line: the flat motion prior has no"
            " bound there, and these are not far enough from it (docs/findings.md)")  # fmt: skip
    return tree


def _off_rails(recording: Recording, notify: Notify) -> Recording:
    """Without samples whose gyroscopes' spread a rail has cut."""
    lost = recording.at_rail("gyroscope")
    if lost.all():
        raise InputError(
            "--rates spread: expected samples with all gyroscopes off their rail, found none"
        )
    if lost.any():
        notify(f"left out {lost.sum()} of {lost.size} samples with a gyroscope at its rail")
    return recording.select(~lost) if lost.any() else recording


def _pmmh(target: Flat, steps: int, seed: int, quiet: bool, notify: Notify) -> tuple[Chains, dict]:
    """Two chains of PmMH, and N.

    N and the walk's length as in section III-C; where not even the largest N brings the variance
    of log p-hat near what is aimed at, omega is drawn around the integrand's mode.
    """
    notify("tuning N and the step length ...")
    (recording, model, prior, mode, *_), rng = target.posterior, stream(seed, "sample", "tuning")
    sweeps = tuning.Sweeps(recording.position_prior_sd * np.geomspace(1e-6, 0.3, 16))
    found = tuning.tune(
        target.likelihood, prior, model.array.relative, lambda _: mode, sweeps, lambda _: rng
    )
    if found.centred:
        notify(f"variance of log p-hat {found.variances[-1]:.3g} at N = {sweeps.draws[-1]}: omega"
            " is drawn around the integrand's mode instead")  # fmt: skip
    starts = spread_starts(mode, prior.sd / 3, stream(seed, "sample", "starts"))
    thin = max(1, steps // STORED)
    chains = run_chains(
        found.target, starts, found.step, max(4, steps // thin), thin, seed, quiet=quiet
    )
    return chains, {"draws_per_sample": found.target.draws}


def _nuts(target: Flat, steps: int, seed: int, quiet: bool) -> Chains:
    """Two chains of NUTS from where the prior is."""
    posterior, prior = target.posterior, target.posterior.prior
    starts = spread_starts(prior.mean, prior.sd, stream(seed, "sample", "starts"))
    return run_nuts(
        target.exact(), posterior.mode, posterior.covariance, starts, NUTS_WARMUP, steps, seed,
        quiet=quiet,
    )  # fmt: skip


def flattest(draws, recording: Recording) -> float:
    """The least distance of drawn triads from one line, over that of the nominal ones.

    ``draws`` (chains, draws, P). Towards a line the density under the flat motion prior grows as
    the distance to the power -T.
    """
    places = draws.reshape(*draws.shape[:-1], -1, 3)
    places = np.concatenate([np.zeros_like(places[..., :1, :]), places], axis=-2)
    distance = [
        np.linalg.svd(p - p.mean(axis=-2, keepdims=True), compute_uv=False)[..., 1:]
        for p in (places, recording.relative_positions())
    ]
    drawn, nominal = (np.sqrt(np.sum(part**2, axis=-1)) for part in distance)
    return float(drawn.min() / nominal)
