"""Truths drawn from their prior, what is measured of them, their posteriors; work in batches."""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from imuarray.errors import IdentifiabilityError
from imuarray.geometry import positions_of, sub_array
from imuarray.model import ArrayModel
from imuarray.motion import normal_motion, sphere_motion
from imuarray.posterior.prior import GaussianPrior
from imuarray.simulation.recordings import measure
from imuarray.streams import stream
from imuarray_papers.config import model_from, motion_sds
from imuarray_papers.estimation.identifiability import Calibration
from imuarray_papers.estimation.newton import fisher_scoring
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray_papers.studies.settings import SETTINGS


def realisations(model: ArrayModel, rng, count, samples, motion, position_sd, rail) -> tuple:
    """Random `Motion` of ``count`` arrays, fields (R, N, 3), and what `measure` gives of it.

    Between them the truth: positions (R, A, 3) m relative to the reference, each triad off its
    nominal position by ``position_sd`` (m). ``motion``: magnitudes of `sphere_motion`; ``rail``
    (rad/s) of the gyroscopes.
    """
    errors = position_sd * rng.standard_normal((count, model.array.accelerometers, 3))
    truth = model.array.relative + errors - errors[:, :1]
    moves = sphere_motion(rng, (count, samples), *motion)
    return moves, truth, *measure(model, moves, truth, rng, gyroscope_range=rail)


class Setting(NamedTuple):
    """A simulation: model, prior sd (m), motion sds (rad/s, rad/s^2, m/s^2), T, seed."""

    name: str
    model: ArrayModel
    prior_sd: float
    motion_sd: tuple[float, float, float]
    samples: int
    seed: int

    @property
    def prior(self) -> GaussianPrior:
        """Prior of r_2 ... r_A, around the nominal ones."""
        return GaussianPrior.of(self.model.array.parameters, self.prior_sd)

    def where(self, *names) -> tuple:
        """The names of a random stream of this simulation."""
        return "calibrated", *names, self.name, self.samples


def setting_from(settings: dict, name: str, samples: int) -> Setting:
    """Setting from ``validation.settings`` of a configuration; motion and prior: ``paper2021``.

    Noise is the configuration's where the setting has none of its own.
    """
    chosen = settings["validation"]["settings"][name]
    noise = {**settings["noise"], **chosen}
    array = sub_array(model_from(settings).array, chosen["triads"])
    model = ArrayModel.isotropic(
        array, noise["accelerometer_sd"], np.radians(noise["gyroscope_sd_dps"]),
        chosen.get("effects", ()),
    )  # fmt: skip
    prior_sd, seed = settings["paper2021"]["prior_sd"], settings["seed"]
    return Setting(name, model, prior_sd, motion_sds(settings), samples, seed)


class Replicate(NamedTuple):
    """A truth from the prior, what was measured of it, and where its posterior is.

    Samplers only start and shape their proposals by ``mode`` and ``covariance``.
    """

    number: int
    truth: np.ndarray  # (P,) m
    likelihood: Likelihood  # with the motion's own prior
    mode: np.ndarray  # (P,)
    covariance: np.ndarray  # (P, P)
    free: Calibration | None  # the most likely without a prior; None where they are not determined


def misfit(likelihood: Likelihood, theta) -> float:
    """Misfit of theta (P,) to the measurements: -log p-hat at the gyroscopes' own omega.

    A function of both: a sampler that does not look at the data, or not at all of them, is wrong
    in it, though right in theta.
    """
    rates = np.ascontiguousarray(likelihood.rate_mean[:, None])
    return -likelihood.on(positions_of(theta), rates)


def replicate(setting: Setting, number: int) -> Replicate:
    """Number ``number``: the same for all samplers."""
    rng = stream(setting.seed, *setting.where(), number)
    model, prior = setting.model, setting.prior
    truth = prior.mean + prior.sd * rng.standard_normal(prior.mean.size)
    motion = normal_motion(rng, (setting.samples,), *setting.motion_sd)
    force, rate, _ = measure(model, motion, positions_of(truth), rng)
    likelihood = Likelihood.of(model, force, rate, motion_sd=setting.motion_sd[:2])
    best = _most_likely(setting, likelihood, rng)
    try:
        free = fisher_scoring(likelihood.collapsed, best.positions)
    except IdentifiabilityError:
        free = None
    return Replicate(number, truth, likelihood, best.positions[1:].ravel(), best.covariance, free)


def _most_likely(setting: Setting, likelihood: Likelihood, rng):
    """The mode, searched from the nominal positions and, where that ends badly, from others.

    Few triads, few samples and a wide prior have local optima: from the nominal positions alone
    the search ends in one in 4 of the first 200 data sets of 4 triads and 5 samples with positions
    off by 3 mm (`tests/papers/test_validation.py`). Their residuals, far beyond the noise, show it.
    """
    prior, data = setting.prior, likelihood.collapsed
    enough = SETTINGS.good * 3 * setting.model.array.accelerometers * setting.samples
    best, start = None, prior.mean
    for _ in range(SETTINGS.starts):
        try:
            found = fisher_scoring(data, positions_of(start), (prior.mean, np.diag(prior.sd**-2.0)))
            best = found if best is None or found.cost[-1] < best.cost[-1] else best
        except IdentifiabilityError:
            pass  # the search ran to positions all in line
        if best is not None and best.cost[-1] < enough:
            break
        start = prior.mean + prior.sd * rng.standard_normal(prior.mean.size)
    return best


def run_batches(function, jobs, threads: int, quiet: bool, label: str) -> list:
    """``function(job)`` for each job on ``threads`` threads, results in the jobs' order."""
    with ThreadPoolExecutor(threads) as pool:
        results = pool.map(function, jobs)
        return list(tqdm(results, total=len(jobs), disable=quiet, desc=label, mininterval=15.0))


def share(jobs, part: int, parts: int) -> list:
    """The jobs of one of ``parts`` neighbouring shares, as even as may be."""
    jobs = list(jobs)
    ends = [len(jobs) * number // parts for number in (part, part + 1)]
    return jobs[slice(*ends)]


def in_batches(
    function, seed, names, count: int, threads: int = 1, quiet: bool = True, part=0, parts=1
) -> list[np.ndarray]:
    """Arrays that ``function`` (rng, size) gives of batches of ``count`` realisations, joined.

    Each batch has the random stream (seed, names, its number): none depends on the others, and one
    of ``parts`` shares of them may be made alone.
    """
    sizes = [SETTINGS.batch] * (count // SETTINGS.batch)
    sizes += [rest] if (rest := count % SETTINGS.batch) else []

    def job(batch):
        number, size = batch
        return function(stream(seed, *names, number), size)

    jobs = share(enumerate(sizes), part, parts)
    # of an empty share one realisation, for what its arrays look like
    made = run_batches(job, jobs or [(0, 1)], threads, quiet, "/".join(map(str, names)))
    count = sum(size for _, size in jobs)
    return [np.concatenate(one)[:count] for one in zip(*made, strict=True)]


def root_mean_square(squares) -> tuple[float, float]:
    """RMSE and its Monte Carlo standard error from mean squared errors (realisations,)."""
    squares = np.asarray(squares, float)
    mean = squares.mean()
    error = squares.std(ddof=1) / np.sqrt(squares.size) if squares.size > 1 else np.nan
    return float(np.sqrt(mean)), float(error / (2 * np.sqrt(mean))) if mean > 0 else 0.0
