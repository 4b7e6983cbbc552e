"""Chains of a sampler, and their file: an `xarray.DataTree` in NetCDF-4."""

from dataclasses import dataclass

import numpy as np
import xarray as xr


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


def chain_tree(chains: Chains, labels, prior, attrs: dict, effects=(), sds=None) -> xr.DataTree:
    """Groups posterior, sample_stats and prior; dims chain, draw, accelerometer, axis.

    ``labels`` of the A - 1 estimated triads; ``prior`` a `GaussianPrior`; ``attrs`` the
    stamp (config, seed, versions) and whatever else; ``effects`` names of the parameters
    after the positions; ``sds`` names of those after them, logs of factors on these sds.
    """
    count = len(labels)
    coords = {"accelerometer": list(labels), "axis": list("xyz")}
    dims = ("chain", "draw", "accelerometer", "axis")
    shape = (*chains.draws.shape[:2], count, 3)
    position = chains.draws[..., : 3 * count].reshape(shape)
    posterior = xr.Dataset({"position": (dims, position, {"units": "m"})}, coords)
    last = 3 * count + len(effects)
    if effects:
        values = chains.draws[..., 3 * count : last]
        posterior["effect_parameter"] = ("chain", "draw", "parameter"), values
        posterior = posterior.assign_coords(parameter=list(effects))
    if sds:
        values = np.array(list(sds.values())) * np.exp(chains.draws[..., last:])
        posterior["sd"] = ("chain", "draw", "quantity"), values, {"units": "SI"}
        posterior = posterior.assign_coords(quantity=list(sds))
    stats = xr.Dataset({"log_target": (dims[:2], chains.log_target)})
    stats["acceptance"] = (("chain",), chains.acceptance)
    fields = {
        f"position_{name}": (dims[2:], part[: 3 * count].reshape(count, 3), {"units": "m"})
        for name, part in (("mean", prior.mean), ("sd", prior.sd))
    }
    groups = {
        "/": xr.Dataset(attrs={**attrs, "thin": chains.thin, "step_length_m": chains.step}),
        "/posterior": posterior,
        "/sample_stats": stats,
        "/prior": xr.Dataset(fields, coords),
    }
    return xr.DataTree.from_dict(groups)


def read_chains(path) -> tuple[Chains, xr.DataTree]:
    """The chains and the whole tree in a file of what `chain_tree` made."""
    with xr.open_datatree(path, engine="h5netcdf") as opened:
        tree = opened.load()
    return chains_of(tree), tree


def chains_of(tree: xr.DataTree) -> Chains:
    """The chains in a tree that `chain_tree` made."""
    position = tree["posterior"]["position"].to_numpy()
    draws = position.reshape(*position.shape[:2], -1)
    for name in ("effect_parameter", "sd"):
        if name in tree["posterior"]:
            draws = np.concatenate([draws, tree["posterior"][name].to_numpy()], axis=2)
    stats = tree["sample_stats"]
    return Chains(
        draws, stats["log_target"].to_numpy(), stats["acceptance"].to_numpy(),
        int(tree.attrs["thin"]), float(tree.attrs["step_length_m"]),
        int(tree.attrs.get("divergent", 0)),
    )  # fmt: skip
