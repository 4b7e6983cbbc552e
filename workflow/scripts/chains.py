"""Shared by the sampling scripts: run two chains with a checkpoint and store them."""

from pathlib import Path

from imuarray.posterior.pmmh import run_chains
from imuarray.posterior.store import write_chains
from imuarray.provenance import code_digest, digest, stamp
from imuarray.studies.bayes import starts_for


def sample_paired(settings, recording, target, step, transitions, names, path, attrs, threads):
    """Two chains of ``transitions`` steps; the checkpoint is keyed by config, data and code."""
    draws = settings["scale"]["draws"]
    key = digest(
        settings, recording.specific_force, recording.angular_rate, step, target.draws,
        code_digest(),
    )  # fmt: skip
    checkpoint = Path(path).parent / f".checkpoint_{Path(path).stem}_{key[:16]}.npz"
    starts = starts_for(settings, recording, names)
    chains = run_chains(
        target, starts, step, draws, transitions // draws, settings["seed"], names,
        checkpoint=checkpoint, key=key, threads=threads,
    )  # fmt: skip
    labels = recording.accelerometer_labels[1:]
    write_chains(path, chains, labels, target.prior, {**stamp(settings, settings["seed"]), **attrs})
    checkpoint.unlink(missing_ok=True)
