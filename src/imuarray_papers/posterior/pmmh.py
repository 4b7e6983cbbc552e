"""Pseudo-marginal Metropolis-Hastings (2021, Algorithm 1): chains side by side, and resumed."""

import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from imuarray.errors import InputError
from imuarray.posterior.chains import Chains
from imuarray.provenance import atomic_write
from imuarray.streams import stream
from imuarray_papers.posterior.target import CompiledTarget


def run_chains(
    target: CompiledTarget,
    starts,
    step: float,
    draws: int,
    thin: int,
    seed: int,
    names=("pmmh",),
    checkpoint: str | Path | None = None,
    key: str = "",
    block: int = 500,
    quiet: bool = False,
    threads: int = 2,
) -> Chains:
    """Run one chain from each of ``starts`` (chains, size) for draws * thin transitions.

    For draw i chain c draws from the stream (seed, names, c, i) alone: chains are independent,
    whatever the number of threads, and a chain resumed at i continues bit for bit.

    Parameters
    ----------
    checkpoint : path or None
        Where the state is kept after every ``block`` draws; an existing one with the same
        ``key`` (a hash of config, data and code) is continued exactly.

    Raises
    ------
    InputError
        A start with no finite log target, or a checkpoint that belongs to another key.
    """
    starts = np.atleast_2d(np.asarray(starts, float))
    kept, values = np.empty((len(starts), draws, starts.shape[1])), np.empty((len(starts), draws))
    accepted = np.zeros(len(starts), np.int64)
    first = _resumed(checkpoint, key, thin, kept, values, accepted) if checkpoint else 0
    if first:
        thetas, value = kept[:, first - 1].copy(), values[:, first - 1].copy()
    else:
        thetas, value = starts.copy(), _values_at(target, starts, seed, names)

    def advance(chain: int, number: int) -> None:
        rng = stream(seed, *names, "chain", chain, number)
        # moves thetas[chain] in place
        more, value[chain] = target.transitions(thetas[chain], float(value[chain]), step, thin, rng)
        accepted[chain] += more

    seldom = 0.2 if sys.stderr.isatty() else 15.0  # seconds; a log file needs few lines
    with (
        ThreadPoolExecutor(max_workers=threads) as pool,
        tqdm(total=draws, initial=first, disable=quiet, unit="draw", mininterval=seldom) as bar,
    ):
        for number in range(first, draws):
            list(pool.map(partial(advance, number=number), range(len(starts))))
            kept[:, number], values[:, number] = thetas, value
            bar.update()
            made = number + 1
            if checkpoint and ((made - first) % block == 0 or made == draws):
                _save(checkpoint, key, thin, kept[:, :made], values[:, :made], accepted)
    return Chains(kept, values, accepted / (thin * draws), thin, step)


def spread_starts(centre, sd, rng, chains: int = 2) -> np.ndarray:
    """Different starts (chains, P), normal around ``centre`` (P,) with ``sd``, (P,) or one."""
    centre = np.asarray(centre)
    return centre + sd * rng.standard_normal((chains, centre.size))


def checkpoint_beside(path: str | Path, key: str) -> Path:
    """Where the state of the run ``key`` that is to write ``path`` is kept; hidden, beside it."""
    path = Path(path)
    return path.with_name(f".{path.name}.{key[:16]}.npz")


def _values_at(target, starts, seed, names) -> np.ndarray:
    """Log target at each of the starts, (chains,)."""
    values = [
        target.log_target(start, stream(seed, *names, "start", chain))
        for chain, start in enumerate(starts)
    ]
    if not np.all(np.isfinite(values)):
        raise InputError(f"pmmh: expected a finite log target at every start, found {values}")
    return np.array(values)


def _save(path, key, thin, draws, log_target, accepted) -> None:
    with atomic_write(Path(path)) as temporary, open(temporary, "wb") as handle:
        np.savez(handle, key=key, thin=thin, draws=draws, log_target=log_target, accepted=accepted)


def _resumed(path, key, thin, draws, log_target, accepted) -> int:
    """How many draws a checkpoint holds, which are filled in; 0 where there is none."""
    if not Path(path).exists():
        return 0
    try:
        with np.load(path, allow_pickle=False) as stored:
            found = {name: stored[name] for name in stored.files}
        matches = str(found["key"]) == key and int(found["thin"]) == thin
        matches &= found["draws"].shape[::2] == draws.shape[::2]
        matches &= found["accepted"].shape == accepted.shape
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        raise InputError(f"{path}: expected a checkpoint, found a broken file; delete it") from None
    if not matches:
        raise InputError(f"{path}: expected a checkpoint of this very run, found another's")
    number = found["draws"].shape[1]
    if number > draws.shape[1]:
        raise InputError(
            f"{path}: expected at most {draws.shape[1]} draws, found {number}: the run"
            " already went further"
        )
    draws[:, :number], log_target[:, :number] = found["draws"], found["log_target"]
    accepted[:] = found["accepted"]
    return number
