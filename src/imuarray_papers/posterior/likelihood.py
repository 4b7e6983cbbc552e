"""The Rao-Blackwellised likelihood estimator of paper 2021, and the target of chains with it."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from imuarray.errors import InputError, require_one_of, require_shape
from imuarray.geometry import positions_of
from imuarray.model import ArrayModel
from imuarray.posterior.marginal import Marginal
from imuarray.posterior.prior import GaussianPrior
from imuarray_papers.estimation.collapsed import Collapsed, motion_from
from imuarray_papers.posterior import kernels
from imuarray_papers.posterior.proposals import log_weights, proposals

# (19) and (23) imply |H' Lambda H|^(-1/2) for each sample; (25) and (26a) print the
# determinant without the root. "derived" is right; "printed" exists to show the difference.
DETERMINANTS = {"derived": 0.5, "printed": 1.0}


@dataclass(frozen=True)
class Likelihood:
    """p-hat(y_a | theta) for one recording under the papers' model.

    Build it with `Likelihood.of`. ``power`` is the power of 1 / |H' Lambda H| a sample;
    ``rate_mean`` (T, 3) rad/s and ``rate_covariance`` (T, 3, 3) are those of p(omega_t | y_g),
    ``motion_sd`` prior sds of omega (rad/s) and omega_dot (rad/s^2).
    """

    data: kernels.LikelihoodData
    power: float
    collapsed: Collapsed
    rate_mean: np.ndarray
    rate_covariance: np.ndarray
    motion_sd: tuple[float, float] = (np.inf, np.inf)

    @classmethod
    def of(
        cls, model: ArrayModel, specific_force, angular_rate, saturated=None,
        determinant: str = "derived", rate_distribution=None, motion_sd=(np.inf, np.inf),
    ) -> Self:  # fmt: skip
        """Arrange measurements (T, A, 3) m/s^2 and (T, G, 3) rad/s for the estimator.

        ``rate_distribution``: None for p(omega | y_g) from the declared noise, or a pair
        (mean (T, 3), covariance (T, 3, 3)), say from (30a)/(30b). ``motion_sd``: prior sds of
        omega (rad/s) and omega_dot (rad/s^2), infinite as in the paper. InputError where an axis
        of some sample has no unsaturated gyroscope.
        """
        require_one_of("determinant", determinant, DETERMINANTS)
        collapsed = Collapsed.of(model, specific_force, angular_rate, saturated)
        if rate_distribution is None:
            mean, covariance = collapsed.rate_density(motion_sd[0])
        else:
            mean, covariance = (np.asarray(part, float) for part in rate_distribution)
            require_shape("rate_distribution's mean", mean, (collapsed.samples, 3))
            require_shape("rate_distribution's covariance", covariance, (collapsed.samples, 3, 3))
            if np.isfinite(motion_sd[0]):
                raise InputError("motion_sd: expected none of omega beside rate_distribution")
        mean = np.ascontiguousarray(mean.T)
        data = kernels.LikelihoodData(
            collapsed, collapsed.weighted, mean, _lower(covariance), np.empty((10, 0)),
            np.full(3, float(motion_sd[1]) ** -2.0),
        )  # fmt: skip
        return cls(data, DETERMINANTS[determinant], collapsed, mean.T, covariance, motion_sd)

    def marginal(self, positions, nodes: int | None = None, spread=(0.0, 0)) -> Marginal:
        """The limit of `estimate`, without Monte Carlo noise; options as for `Marginal.of`."""
        if self.power != DETERMINANTS["derived"]:
            raise InputError("marginal: expected the derived determinant, found the printed one")
        rates, data = (self.rate_mean, self.rate_covariance), self.collapsed
        given = data.with_rates(self.rate_covariance, self.rate_mean)
        relative = self._relative(positions)
        return Marginal.of(
            data.weighted.reshape(-1, data.samples).T, data.energy, data.precision, rates,
            motion_from(given, relative).motion.angular_rate, relative, self.motion_sd, nodes,
            data.mean.T if np.isfinite(self.motion_sd[0]) else None, spread,
        )  # fmt: skip

    def centred(self, positions) -> Self:
        """The likelihood estimated with draws from where its integrand is.

        omega_t is drawn around the integrand's mode at ``positions`` (A, 3) m, weighted by
        p(omega_t | y_g) over that density: unbiased at every theta, and of far smaller
        variance than (26a) where p(omega_t | y_g) is wide or lies off, as in measured data.
        """
        rates = self.rate_mean, self.rate_covariance
        mean, covariance = proposals(self.collapsed, *rates, self._relative(positions))
        weights = log_weights(*rates, mean, covariance)
        data = self.data._replace(
            mean=np.ascontiguousarray(mean.T), factor=_lower(covariance), log_weight=weights
        )
        return replace(self, data=data)

    @property
    def samples(self) -> int:
        """Number T of samples."""
        return self.collapsed.samples

    def _relative(self, positions) -> np.ndarray:
        positions = np.asarray(positions, float)
        require_shape("positions", positions, (len(self.data.weighted), 3))
        return np.ascontiguousarray(positions - positions[0])

    def on(self, positions, rates) -> float:
        """log p-hat at ``positions`` (A, 3) m on given draws ``rates`` (T, N, 3) rad/s.

        They are taken to be from where `estimate` would draw them.
        """
        require_shape("rates", rates, (self.samples, rates.shape[1], 3))
        return kernels.fixed_draws(self._relative(positions), self.data, rates, self.power)

    def estimate(self, positions, draws: int, rng) -> float:
        """log p-hat at ``positions`` (A, 3) m with N = ``draws`` fresh draws a sample."""
        return float(self.realisations(positions, draws, 1, rng)[0])

    def realisations(self, positions, draws: int, count: int, rng) -> np.ndarray:
        """``count`` independent values of log p-hat at ``positions`` (paper 2021, figure 2)."""
        out = np.empty(count)
        kernels.repeated(self._relative(positions), self.data, rng, draws, self.power, out)
        return out


def _lower(covariance) -> np.ndarray:
    """Cholesky factors of (T, 3, 3) as the kernels want them, (6, T)."""
    factor = np.linalg.cholesky(covariance)
    return np.array([factor[:, i, j] for i in range(3) for j in range(i + 1)])


@dataclass(frozen=True)
class CompiledTarget:
    """The posterior of theta, the positions r_2 ... r_A; each estimate draws omega anew."""

    likelihood: Likelihood
    prior: GaussianPrior
    draws: int

    def log_target(self, theta, rng) -> float:
        """log prior + log p-hat with fresh draws."""
        estimate = self.likelihood.estimate(positions_of(theta), self.draws, rng)
        away = (theta - self.prior.mean) / self.prior.sd
        return estimate - 0.5 * float(np.sum(away**2))

    def transitions(self, theta, log_target, step, count, rng) -> tuple[int, float]:
        """Advance ``theta`` in place by ``count`` steps; (accepted, the last log target).

        Compiled; releases the interpreter for other chains.
        """
        prior = np.stack([self.prior.mean, self.prior.sd**-2.0])
        return kernels.transitions(
            theta, log_target, prior, step, self.draws, self.likelihood.power,
            self.likelihood.data, rng, count,
        )  # fmt: skip
