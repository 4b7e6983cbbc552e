"""Normal priors of a posterior's parameters."""

from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(frozen=True)
class GaussianPrior:
    """Normal prior of theta: ``mean`` and ``sd`` (size,), metres for positions.

    Independent, but where there is a ``root`` (size, size): the precision is then root' root.
    """

    mean: np.ndarray
    sd: np.ndarray
    root: np.ndarray | None = None

    @classmethod
    def of(cls, mean, sd) -> Self:
        """Spread a scalar sd over all parameters."""
        mean = np.asarray(mean, float)
        return cls(mean, np.broadcast_to(np.asarray(sd, float), mean.shape).copy())

    @classmethod
    def tied(cls, mean, root) -> Self:
        """With the sds that follow."""
        return cls(mean, np.sqrt(np.sum(np.linalg.inv(root) ** 2, axis=1)), root)
