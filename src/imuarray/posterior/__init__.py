"""The positions' posterior: likelihood estimate, chains, tuning, diagnostics.

Names load when first used: a job that only reads tables needs no sampler.
"""

from importlib import import_module

_HOME = {
    "AutoregressiveTarget": "target",
    "Chains": "chains",
    "CompiledTarget": "target",
    "GaussianPrior": "target",
    "GenericTarget": "target",
    "Likelihood": "likelihood",
    "run_chains": "pmmh",
}

__all__ = list(_HOME)


def __getattr__(name):
    if name in _HOME:
        return getattr(import_module(f"imuarray.posterior.{_HOME[name]}"), name)
    raise AttributeError(f"module 'imuarray.posterior' has no attribute {name!r}")
