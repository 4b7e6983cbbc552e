"""The positions' posterior: likelihood estimate, chains, tuning, diagnostics."""

from imuarray.posterior.likelihood import Likelihood
from imuarray.posterior.pmmh import Chains, run_chains
from imuarray.posterior.target import CompiledTarget, GaussianPrior, GenericTarget

__all__ = [
    "Chains",
    "CompiledTarget",
    "GaussianPrior",
    "GenericTarget",
    "Likelihood",
    "run_chains",
]
