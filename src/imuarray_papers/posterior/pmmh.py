"""Pseudo-marginal Metropolis-Hastings (2021, Algorithm 1), run by emcee."""

import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import emcee
import numpy as np
from tqdm import tqdm

from imuarray.errors import InputError
from imuarray.posterior.chains import Chains
from imuarray.provenance import atomic_write
from imuarray.streams import stream
from imuarray_papers.posterior.likelihood import CompiledTarget


class PseudoMarginalMove(emcee.moves.Move):
    """An emcee move: each walker is a Metropolis-Hastings chain of its own.

    One proposal runs ``thin`` transitions with the walk (27) in every chain and hands
    back the last state with its noisy log target. Chain c at iteration i draws from the
    stream (seed, names, c, i) alone: chains are independent, whatever the number of
    threads, and a chain resumed at i continues bit for bit.
    """

    def __init__(
        self, target: CompiledTarget, step: float, thin: int, seed: int, names, iteration: int,
        accepted: np.ndarray, threads: int,
    ):  # fmt: skip
        self.target, self.step, self.thin = target, step, thin
        self.seed, self.names, self.iteration = seed, tuple(names), iteration
        self.accepted = accepted  # of each chain, so far
        self.pool = ThreadPoolExecutor(max_workers=threads)

    def propose(self, model, state):
        """Advance every chain; returns the new state and which chains moved at all."""

        def advance(chain):
            rng = stream(self.seed, *self.names, "chain", chain, self.iteration)
            theta = np.array(state.coords[chain])
            accepted, value = self.target.transitions(
                theta, float(state.log_prob[chain]), self.step, self.thin, rng
            )
            return theta, accepted, value

        results = self.pool.map(advance, range(len(state.coords)))
        coords, counts, log_prob = map(np.array, zip(*results, strict=True))
        self.iteration += 1
        self.accepted = self.accepted + counts
        return emcee.State(coords, log_prob=log_prob), counts > 0


def run_chains(
    target: CompiledTarget, starts, step: float, draws: int, thin: int, seed: int, names=("pmmh",),
    checkpoint: str | Path | None = None, key: str = "", block: int = 500, quiet: bool = False,
    threads: int = 2,
) -> Chains:  # fmt: skip
    """Run one chain from each of ``starts`` (chains, size) for draws * thin transitions.

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
    done = _load(checkpoint, key, starts.shape, thin, draws) if checkpoint else None
    past, state, accepted = _begin(target, starts, seed, names) if done is None else done
    first = past[0].shape[1]
    move = PseudoMarginalMove(target, step, thin, seed, names, first, accepted, threads)
    sampler = emcee.EnsembleSampler(*starts.shape, _never, moves=move, vectorize=True)
    seldom = 0.2 if sys.stderr.isatty() else 15.0  # seconds; a log file needs few lines
    with tqdm(total=draws, initial=first, disable=quiet, unit="draw", mininterval=seldom) as bar:
        while past[0].shape[1] < draws:
            count = min(block, draws - past[0].shape[1])
            sampler.reset()
            for new in sampler.sample(state, iterations=count, skip_initial_state_check=True):
                state = new
                bar.update()
            past[0] = np.concatenate([past[0], sampler.get_chain().swapaxes(0, 1)], axis=1)
            past[1] = np.concatenate([past[1], sampler.get_log_prob().T], axis=1)
            if checkpoint:
                _save(checkpoint, key, thin, past, move.accepted)
    move.pool.shutdown()
    return Chains(past[0], past[1], move.accepted / (thin * draws), thin, step)


def spread_starts(centre, sd, rng, chains: int = 2) -> np.ndarray:
    """Different starts (chains, P), normal around ``centre`` (P,) with ``sd``, (P,) or one."""
    centre = np.asarray(centre)
    return centre + sd * rng.standard_normal((chains, centre.size))


def _begin(target, starts, seed, names):
    """Nothing drawn yet: ([draws, log target], emcee's state at the starts, accepted)."""
    values = [
        target.log_target(start, stream(seed, *names, "start", chain))
        for chain, start in enumerate(starts)
    ]
    if not np.all(np.isfinite(values)):
        raise InputError(f"pmmh: expected a finite log target at every start, found {values}")
    past = [np.empty((len(starts), 0, starts.shape[1])), np.empty((len(starts), 0))]
    state = emcee.State(starts.copy(), log_prob=np.array(values))
    return past, state, np.zeros(len(starts), np.int64)


def _never(theta):
    """emcee must not evaluate the target by itself: that would redraw the estimate."""
    raise AssertionError("the log target is handed over with the state")


def _save(path, key, thin, past, accepted) -> None:
    with atomic_write(Path(path)) as temporary, open(temporary, "wb") as handle:
        np.savez(handle, key=key, thin=thin, draws=past[0], log_target=past[1], accepted=accepted)


def _load(path, key, shape, thin, draws):
    """Result of `_begin`, from a checkpoint; None where there is none."""
    if not Path(path).exists():
        return None
    try:
        with np.load(path, allow_pickle=False) as stored:
            found = {name: stored[name] for name in stored.files}
        matches = str(found["key"]) == key and int(found["thin"]) == thin
        matches &= found["draws"].shape[::2] == shape and len(found["accepted"]) == shape[0]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        raise InputError(f"{path}: expected a checkpoint, found a broken file; delete it") from None
    if not matches:
        raise InputError(f"{path}: expected a checkpoint of this very run, found another's")
    if found["draws"].shape[1] > draws:
        raise InputError(
            f"{path}: expected at most {draws} draws, found {found['draws'].shape[1]}: the run"
            " already went further"
        )
    past = [found["draws"], found["log_target"]]
    state = emcee.State(past[0][:, -1].copy(), log_prob=past[1][:, -1].copy())
    return past, state, found["accepted"]
