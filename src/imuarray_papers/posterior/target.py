"""Target of a chain: prior times estimated likelihood, as a function of theta."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imuarray.geometry import positions_of
from imuarray.posterior.prior import GaussianPrior
from imuarray_papers.posterior import kernels
from imuarray_papers.posterior.likelihood import Likelihood

WALK = np.empty(0), np.empty((0, 0))  # no centre, no factor: the walk (27)


@dataclass(frozen=True)
class CompiledTarget:
    """The posterior of theta, the positions r_2 ... r_A, with draws of omega anew at each estimate.

    With a ``centre`` (size,) and a ``factor`` (lower (size, size)) proposals are preconditioned
    Crank-Nicolson: they leave the normal density of that mean and covariance factor factor' as it
    is. With a posterior close to it nearly all are accepted, however long the step. ``step`` is
    then a share of that density's own spread, 1 an independent draw. Like the random walk it is
    exact whatever the centre and shape; a ``factor`` a little wider than the posterior keeps it
    from sticking in the tails.
    """

    likelihood: Likelihood
    prior: GaussianPrior
    draws: int
    centre: np.ndarray | None = None
    factor: np.ndarray | None = None

    def log_target(self, theta, rng) -> float:
        """log prior + log p-hat with fresh draws."""
        estimate = self.likelihood.estimate(positions_of(theta), self.draws, rng)
        return self.prior.log_density(theta) + estimate

    def transitions(self, theta, log_target, step, count, rng) -> tuple[int, float]:
        """Advance ``theta`` in place by ``count`` steps; (accepted, the last log target).

        Compiled; releases the interpreter for other chains.
        """
        prior = np.stack([self.prior.mean, self.prior.sd**-2.0])
        shape = WALK if self.centre is None else (self.centre, self.factor)
        return kernels.transitions(
            theta, log_target, prior, *shape, step, self.draws, self.likelihood.power,
            self.likelihood.data, rng, count,
        )  # fmt: skip
