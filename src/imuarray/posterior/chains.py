"""What a sampler hands back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Chains:
    """Paired chains: ``draws`` (chains, draws, size), ``log_target`` (chains, draws).

    ``thin`` transitions lie between stored draws; ``acceptance`` (chains,) is the share
    of accepted proposals over the whole run. ``divergent`` counts transitions whose integration
    broke down (NUTS): where there are any the draws may miss a part of the posterior.
    """

    draws: np.ndarray
    log_target: np.ndarray
    acceptance: np.ndarray
    thin: int
    step: float
    divergent: int = 0

    @property
    def steps(self) -> int:
        """Transitions made by each chain."""
        return self.draws.shape[1] * self.thin
