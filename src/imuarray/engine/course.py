"""An estimate along its recording: what more gains, residuals, how likely its readings are."""

import numpy as np
from scipy.special import chdtri, gammaln

from imuarray.engine.estimate import Estimate, Recorded
from imuarray.engine.heldout import Scores, blocks_of, trained_elsewhere
from imuarray.engine.linearise import linearise
from imuarray.engine.parameters import POSITION, Columns
from imuarray.engine.robust import by_triad, distances
from imuarray.engine.widths import growing
from imuarray.linear import scaled_inverse
from imuarray.model.effects import KINDS

STRETCHES = 60  # of time, at most, in which residuals are averaged
FEWEST = 20  # samples of one
SHAKEN = 1e-7  # chance of a triad's residual in plain noise, from which it is far off
SEVERAL = 2  # IMUs off at once: motion faster than the samples, no single bad reading


def course(found: Estimate, moving) -> tuple[dict, dict]:
    """(variables, coordinates) of a dataset, of one recording; ``moving`` (M,) s, all its motion.

    ``position_sd_by_length`` (length, accelerometer, axis) m, the sds had the motion ended after
    ``length`` s of it; ``accelerometer_residual`` and ``gyroscope_residual`` (stretch, triad), rms
    over the declared noise around the instants ``stretch`` s; ``shaken`` (time), 1 where several
    IMUs are far off at once.
    """
    readings, seen = found.recorded[0].readings, found.passes[0]
    time = readings.time + readings.origin
    far = distances(readings, seen)
    number = by_triad(readings.keep)
    blocks = blocks_of(len(time), int(np.clip(len(time) // FEWEST, 1, STRETCHES)))
    squares = far * (readings.sd / readings.declared) ** 2
    rms = np.sqrt([
        squares[part].sum(axis=0) / np.maximum(number[part].sum(axis=0), 1) for part in blocks
    ])  # fmt: skip
    counts = readings.array.accelerometers, readings.array.gyroscopes
    variables: dict[str, tuple] = {
        f"{kind}_residual": (("stretch", kind), rms[:, : counts[which], which], {"units": "1"})
        for which, kind in enumerate(KINDS)
    }
    ends = [time[max(part.stop, 1) - 1] for part in blocks_of(len(time), len(found.blocks))]
    shaken = np.sum((far > chdtri(3, SHAKEN)).any(axis=2), axis=1) >= SEVERAL
    variables |= {
        "position_sd_by_length": (
            ("length", "accelerometer", "axis"), position_sds(found), {"units": "m"},
        ),
        "shaken": (("time",), shaken.astype(np.int8)),
    }  # fmt: skip
    seconds = np.median(np.diff(moving)) * np.searchsorted(moving, ends, side="right")
    coordinates = {
        "stretch": ("stretch", [time[part].mean() for part in blocks], {"units": "s"}),
        "length": ("length", seconds, {"units": "s"}),
    }
    return variables, coordinates


def position_sds(found: Estimate) -> np.ndarray:
    """`growing`'s of the positions, (B, A, 3) m."""
    sds, count = growing(found), found.recorded[0].readings.array.accelerometers
    whole = np.zeros((len(sds), *found.active.shape))
    whole[:, found.active] = sds[:, found.places[0]]
    return whole[:, :count, found.columns.of(POSITION)]


def size_growth(found: Estimate) -> tuple[float, float]:
    """(relative growth of the array from the beginning of the motion to its end, its sd).

    By a score test, all parameters refitted: an array that keeps its shape grows where the
    gyroscopes' common scale changes.
    """
    size = np.zeros(len(found.information))
    placed = np.zeros_like(found.active)
    placed[:, found.columns.of(POSITION)] = True
    size[found.places[0][placed[found.active]]] = found.positions[1:].ravel()
    share, along, all_of_it = 0.0, np.zeros(len(size)), 0.0
    counts = [len(seen.score) for seen in found.passes]
    middle = np.concatenate([(np.arange(count) + 0.5) / count - 0.5 for count in counts])
    for when, (inner, slope) in zip(middle, found.blocks, strict=True):
        share += when * (size @ slope)
        along += when * (inner @ size)
        all_of_it += when**2 * (size @ inner @ size)
    left = all_of_it - along @ scaled_inverse(found.information + found.precision) @ along
    return float(share / left), float(left**-0.5)


def block_scores(found: Estimate) -> Scores:
    """Log densities of a recording's blocks, the parameters trained on its other blocks.

    Noise, degrees of freedom and clocks' phases are those of all blocks.
    """
    (one,) = found.recorded
    nats = log_densities(one, found.columns, found.freedoms)
    blocks = blocks_of(len(nats))
    better = trained_elsewhere(found.blocks, found.precision)
    each = np.array([nats[block].sum() for block in blocks])
    return Scores(each + better, np.array([block.stop - block.start for block in blocks]))


def log_densities(one: Recorded, columns: Columns, freedoms) -> np.ndarray:
    """(T,) nats of each sample's readings, its motion integrated out (Laplace's approximation).

    ``freedoms`` (2,) of Student's t, of accelerometers and gyroscopes. Omega, omega_dot and s have
    a flat prior, so differences between models of the same readings alone mean anything. The
    curvature is that of the weights in use, more than t's own: a sample's density is stated too
    small rather than too large.
    """
    readings, state = one.readings, one.state
    seen = linearise(readings, columns, state, [])
    number, squares = by_triad(readings.keep), by_triad(seen.residual**2)
    weighted = squares.sum(axis=(1, 2))
    if readings.trust is not None:
        squares = squares / readings.trust**2
    nats = np.zeros(len(weighted))
    for kind, nu in enumerate(freedoms):
        n, d = number[..., kind], squares[..., kind]
        if np.isfinite(nu):
            scale = gammaln((nu + n) / 2) - gammaln(nu / 2) - n / 2 * np.log(nu * np.pi)
            density = scale - (nu + n) / 2 * np.log1p(d / nu)
        else:
            density = -n / 2 * np.log(2 * np.pi) - d / 2
        nats += np.sum(density - n * np.log(readings.sd[:, kind]), axis=1)
    nats += seen.inverse.shape[1] / 2 * np.log(2 * np.pi) - seen.log_volume / 2
    if state.rough_prior is not None:
        sd = state.rough_prior.sd
        nats -= np.sum(np.log(sd), axis=1) + sd.shape[1] / 2 * np.log(2 * np.pi)
    if state.turning is not None:
        nats -= state.turning.log_norm
    return nats - (seen.misfit - weighted) / 2
