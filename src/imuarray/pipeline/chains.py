"""Shared by the sampling scripts: run two chains with a checkpoint and store them."""

from imuarray.posterior.chains import write_chains
from imuarray.posterior.pmmh import checkpoint_beside, run_chains, spread_starts
from imuarray.provenance import code_digest, digest, stamp
from imuarray.streams import stream


def sample_paired(settings, recording, target, step, transitions, names, path, attrs, threads):
    """Two chains of ``transitions`` steps; the checkpoint is keyed by config, data and code."""
    draws = settings["scale"]["draws"]
    key = digest(
        settings, recording.specific_force, recording.angular_rate, step, target.draws,
        code_digest(),
    )  # fmt: skip
    checkpoint, seed = checkpoint_beside(path, key), settings["seed"]
    starts = spread_starts(
        target.prior.mean, settings["paper2021"]["start_sd"], stream(seed, *names, "starts")
    )
    chains = run_chains(
        target, starts, step, draws, transitions // draws, seed, names,
        checkpoint=checkpoint, key=key, threads=threads,
    )  # fmt: skip
    labels = recording.accelerometer_labels[1:]
    write_chains(path, chains, labels, target.prior, {**stamp(settings, seed), **attrs})
    checkpoint.unlink(missing_ok=True)
