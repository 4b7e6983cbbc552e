"""Running chains: independence, resuming, counting, refusals."""

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from imuarray.errors import InputError
from imuarray.model import ArrayModel
from imuarray.posterior.prior import GaussianPrior
from imuarray.streams import stream
from imuarray_papers.posterior import pmmh
from imuarray_papers.posterior.likelihood import CompiledTarget, Likelihood
from imuarray_papers.posterior.pmmh import run_chains
from tests.cases import simulate, small_array
from tests.generic import GenericTarget

STEP = 1e-4


def compiled(prior_sd=1e-3, draws=3) -> CompiledTarget:
    rng = np.random.default_rng(1)
    model = ArrayModel.isotropic(small_array(4, 2), 0.1, 0.05)
    _, force, rate = simulate(rng, model, 4)
    prior = GaussianPrior.of(model.array.parameters, prior_sd)
    return CompiledTarget(Likelihood.of(model, force, rate), prior, draws)


def generic(estimate, size=2, sd=1e6) -> GenericTarget:
    return GenericTarget(estimate, GaussianPrior.of(np.zeros(size), sd), np.ones(size))


def same(one, two):
    np.testing.assert_array_equal(one.draws, two.draws)
    np.testing.assert_array_equal(one.log_target, two.log_target)
    np.testing.assert_array_equal(one.acceptance, two.acceptance)


@pytest.fixture(scope="module")
def target():
    return compiled()


@pytest.fixture(scope="module")
def starts(target):
    return np.tile(target.prior.mean, (2, 1))


def test_shapes_and_steps(target, starts):
    run = run_chains(target, starts, STEP, 7, 3, seed=1, quiet=True)
    assert run.draws.shape == (2, 7, 9)
    assert run.log_target.shape == (2, 7)
    assert (run.thin, run.steps, run.step) == (3, 21, STEP)


@pytest.mark.parametrize("size", [2, 3])
def test_paired_chains_are_independent(target, size):
    """Seed 2; increments of chains that start together: correlations of 5000 pairs below
    five standard errors (false alarm below 2e-5 for all)."""
    starts = np.tile(target.prior.mean, (size, 1))
    run = run_chains(target, starts, STEP, 5000, 1, seed=2, quiet=True)
    assert np.all(run.acceptance > 0.1)
    increments = np.diff(run.draws, axis=1)
    for a, b in itertools.combinations(increments, 2):
        for j in range(9):
            assert abs(np.corrcoef(a[:, j], b[:, j])[0, 1]) < 5 / np.sqrt(len(a))
        moved = [np.any(x != 0, axis=1) for x in (a, b)]
        assert abs(np.corrcoef(*moved)[0, 1]) < 5 / np.sqrt(len(a))


def test_successive_draws_use_fresh_randomness():
    """Seed 3; on a flat target increments are white: no correlation between one draw and
    the next, and the sd of step x sqrt(thin), within five standard errors of 4000."""
    run = run_chains(
        generic(lambda theta, rng: 0.0), np.zeros((2, 2)), 0.5, 2000, 4, seed=3, quiet=True
    )
    increments = np.diff(run.draws, axis=1, prepend=0.0)
    following = np.sum(increments[:, 1:] * increments[:, :-1]) / np.sum(increments**2)
    assert abs(following) < 5 / np.sqrt(increments.size)
    assert increments.std() == pytest.approx(1.0, abs=5 / np.sqrt(2 * increments.size))


def test_seed_and_names_make_the_run(target, starts):
    one = run_chains(target, starts, STEP, 20, 5, seed=4, quiet=True)
    same(one, run_chains(target, starts, STEP, 20, 5, seed=4, quiet=True))
    for other in ({"seed": 5}, {"seed": 4, "names": ("else",)}):
        two = run_chains(target, starts, STEP, 20, 5, quiet=True, **other)
        assert np.any(two.draws != one.draws)


@pytest.mark.parametrize("workers", [1, 2])
def test_threads_do_not_change_the_run(target, workers, monkeypatch):
    starts = np.tile(target.prior.mean, (4, 1))
    expected = run_chains(target, starts, STEP, 30, 5, seed=5, quiet=True)
    monkeypatch.setattr(pmmh, "ThreadPoolExecutor", lambda max_workers: ThreadPoolExecutor(workers))
    same(run_chains(target, starts, STEP, 30, 5, seed=5, quiet=True), expected)


@pytest.mark.parametrize("block", [7, 500])
def test_resumed_run_is_bit_identical(target, starts, tmp_path, block):
    whole = run_chains(target, starts, STEP, 40, 5, seed=6, quiet=True)
    path = tmp_path / "state.npz"
    for draws in (13, 40):
        parts = run_chains(
            target, starts, STEP, draws, 5, seed=6, checkpoint=path, key="k", block=block,
            quiet=True,
        )  # fmt: skip
    same(parts, whole)


def test_interrupted_run_continues_from_its_last_block(target, starts, tmp_path):
    """Killed in the middle of a block: what the checkpoint holds is used, the rest redone."""
    path = tmp_path / "state.npz"

    class Dying:
        calls = itertools.count()
        log_target = staticmethod(target.log_target)

        def transitions(self, *args):
            if next(self.calls) >= 2 * 25:
                raise KeyboardInterrupt
            return target.transitions(*args)

    options = dict(seed=7, checkpoint=path, key="k", block=10, quiet=True)
    with pytest.raises(KeyboardInterrupt):
        run_chains(Dying(), starts, STEP, 40, 5, **options)
    with np.load(path) as kept:
        assert kept["draws"].shape[1] == 20
    whole = run_chains(target, starts, STEP, 40, 5, seed=7, quiet=True)
    same(run_chains(target, starts, STEP, 40, 5, **options), whole)


def test_finished_run_is_read_back(target, starts, tmp_path):
    options = dict(seed=8, checkpoint=tmp_path / "state.npz", key="k", quiet=True)
    whole = run_chains(target, starts, STEP, 10, 5, **options)

    def never(*_):
        raise AssertionError("nothing is left to sample")

    class Done:
        log_target = transitions = never

    same(run_chains(Done(), starts, STEP, 10, 5, **options), whole)


def test_checkpoint_longer_than_the_run(target, starts, tmp_path):
    """Asked for fewer draws than are kept: the shares of accepted proposals stay shares."""
    options = dict(seed=8, checkpoint=tmp_path / "state.npz", key="k", quiet=True)
    run_chains(target, starts, STEP, 40, 5, **options)
    try:
        short = run_chains(target, starts, STEP, 10, 5, **options)
    except InputError:
        return
    moved = np.mean(np.any(np.diff(short.draws, axis=1) != 0, axis=2), axis=1)
    assert np.all(short.acceptance <= moved + 0.2)
    assert np.all(short.acceptance <= 1.0)


@pytest.mark.parametrize("change", ["key", "thin", "chains", "size"])
def test_checkpoint_of_another_run_is_refused(target, starts, tmp_path, change):
    path = tmp_path / "state.npz"
    run_chains(target, starts, STEP, 4, 5, seed=9, checkpoint=path, key="k", quiet=True)
    before = path.read_bytes()
    key = "other" if change == "key" else "k"
    thin = 6 if change == "thin" else 5
    if change == "chains":
        starts = np.tile(starts[0], (3, 1))
    if change == "size":
        target, starts = generic(lambda theta, rng: 0.0), np.zeros((2, 2))
    with pytest.raises(InputError, match="checkpoint"):
        run_chains(target, starts, STEP, 8, thin, seed=9, checkpoint=path, key=key, quiet=True)
    assert path.read_bytes() == before


def test_checkpoint_that_is_no_checkpoint_is_refused(target, starts, tmp_path):
    path = tmp_path / "state.npz"
    path.write_bytes(b"not a zip file")
    with pytest.raises(InputError):
        run_chains(target, starts, STEP, 4, 5, seed=9, checkpoint=path, key="k", quiet=True)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_start_without_a_finite_target_is_refused(bad):
    target = generic(lambda theta, rng: bad if theta[0] > 1 else 0.0)
    with pytest.raises(InputError, match="finite"):
        run_chains(target, [[0.0, 0.0], [2.0, 0.0]], 0.1, 5, 1, seed=1, quiet=True)


@pytest.mark.parametrize("bad", [np.nan, -np.inf])
def test_proposals_without_a_finite_target_are_rejected(bad):
    target = generic(lambda theta, rng: bad if theta[0] > 0.5 else 0.0)
    run = run_chains(target, np.zeros((2, 2)), 0.3, 300, 1, seed=1, quiet=True)
    assert run.draws[..., 0].max() <= 0.5
    assert np.all(np.isfinite(run.log_target))
    assert np.all((run.acceptance > 0.2) & (run.acceptance < 1.0))


def test_acceptance_is_counted_right(target, starts):
    """With thin = 1 a chain moves exactly when a proposal is accepted; the first from the start."""
    run = run_chains(target, starts, 2 * STEP, 400, 1, seed=10, quiet=True)
    path = np.concatenate([starts[:, None], run.draws], axis=1)
    moved = np.any(np.diff(path, axis=1) != 0, axis=2).mean(axis=1)
    assert np.all((moved > 0.02) & (moved < 0.98))
    np.testing.assert_allclose(run.acceptance, moved, rtol=1e-12)


@pytest.mark.parametrize(("drift", "expected"), [(1.0, 1.0), (-1e6, 0.0)])
def test_acceptance_of_all_or_none(drift, expected):
    """Each estimate better, or far worse, than any before; through thinning and blocks."""
    count = itertools.count()
    run = run_chains(
        generic(lambda theta, rng: drift * next(count)), np.zeros((1, 2)), 0.1, 20, 5, seed=1,
        block=6, quiet=True,
    )  # fmt: skip
    np.testing.assert_array_equal(run.acceptance, expected)


def test_kept_estimate_is_not_redrawn(target, starts):
    """Proposals the prior rejects: the start's noisy estimate stays through blocks and draws."""
    run = run_chains(target, starts, 1e3, 30, 4, seed=11, block=7, quiet=True)
    for chain in range(2):
        first = target.log_target(starts[chain], stream(11, "pmmh", "start", chain))
        np.testing.assert_array_equal(run.log_target[chain], first)
        np.testing.assert_array_equal(run.draws[chain], np.tile(starts[chain], (30, 1)))
    assert run.log_target[0, 0] != run.log_target[1, 0]
    np.testing.assert_array_equal(run.acceptance, 0.0)


def test_estimate_changes_only_when_the_chain_moves(target, starts):
    run = run_chains(target, starts, 2 * STEP, 300, 1, seed=12, quiet=True)
    still = np.all(np.diff(run.draws, axis=1) == 0, axis=2)
    assert still.any() and not still.all()
    np.testing.assert_array_equal(np.diff(run.log_target, axis=1) == 0, still)
