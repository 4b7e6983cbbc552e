"""An estimate along its recording: what more gains, residuals, how likely its readings are."""

import numpy as np
from scipy.special import chdtri

from imuarray.engine.estimate import Estimate
from imuarray.engine.heldout import Scores, blocks_of, log_densities, scores_of
from imuarray.engine.linearise import linearise
from imuarray.engine.parameters import POSITION
from imuarray.engine.robust import distances
from imuarray.engine.settings import SETTINGS
from imuarray.engine.widths import growing
from imuarray.linear import scaled_inverse
from imuarray.model.effects import KINDS


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
    blocks = blocks_of(
        len(time), int(np.clip(len(time) // SETTINGS.course_samples, 1, SETTINGS.course_stretches))
    )
    squares = far * (readings.sd / readings.declared) ** 2
    rms = np.sqrt([
        squares[part].sum(axis=0) / np.maximum(seen.number[part].sum(axis=0), 1) for part in blocks
    ])  # fmt: skip
    counts = readings.array.accelerometers, readings.array.gyroscopes
    variables: dict[str, tuple] = {
        f"{kind}_residual": (("stretch", kind), rms[:, : counts[which], which], {"units": "1"})
        for which, kind in enumerate(KINDS)
    }
    ends = [time[max(part.stop, 1) - 1] for part in blocks_of(len(time), len(found.blocks))]
    shaken = (
        np.sum((far > chdtri(3, SETTINGS.course_shaken)).any(axis=2), axis=1)
        >= SETTINGS.course_several
    )
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

    An array that keeps its shape grows where the gyroscopes' common scale changes. The sd is
    infinite where nothing is known of it.
    """
    size = np.zeros((len(found.information), 1))
    placed = found.columns.mask([POSITION])
    size[found.places[0][placed[found.active]], 0] = found.positions[1:].ravel()
    moved, variance = _moved(found, size)
    return float(moved[0]), float(np.sqrt(variance[0, 0]))


def farthest_move(found: Estimate) -> tuple[int, float]:
    """(IMU, chi-square of its three axes) whose position changes most from beginning to end.

    Where all others move alike it is the reference.
    """
    pairs, count = np.argwhere(found.active), len(found.positions)
    placed = pairs[:, 1] < 3
    owners, places = pairs[placed, 0], found.places[0][placed]
    moves = []
    for k in range(count):
        mine = owners == k if k else owners > 0
        directions = np.zeros((len(found.information), 3))
        directions[places[mine], pairs[placed, 1][mine]] = 1.0
        moved, variance = _moved(found, directions)
        known = np.isfinite(variance).all()
        moves.append((k, float(moved @ np.linalg.solve(variance, moved)) if known else 0.0))
    return max(moves, key=lambda move: move[1])


def _moved(found: Estimate, directions) -> tuple[np.ndarray, np.ndarray]:
    """Change (k,) along ``directions`` (n, k) from beginning to end, and its covariance (k, k).

    By a score test, all parameters refitted.
    """
    size = directions.shape[1]
    share, along, whole = np.zeros(size), np.zeros(directions.shape), np.zeros((size, size))
    counts = [len(seen.score) for seen in found.passes]
    middle = np.concatenate([(np.arange(count) + 0.5) / count - 0.5 for count in counts])
    for when, (inner, slope) in zip(middle, found.blocks, strict=True):
        share += when * (directions.T @ slope)
        along += when * (inner @ directions)
        whole += when**2 * (directions.T @ inner @ directions)
    left = whole - along.T @ scaled_inverse(found.information + found.precision) @ along
    if np.linalg.eigvalsh(left)[0] <= 0:
        return np.zeros(size), np.full((size, size), np.inf)
    variance = np.linalg.inv(left)
    return variance @ share, variance


def block_scores(found: Estimate) -> Scores:
    """Log densities of a recording's blocks, the parameters trained on its other blocks.

    Noise, degrees of freedom and clocks' phases are those of all blocks.
    """
    (one,) = found.recorded
    seen = linearise(one.readings, found.columns, one.state, [])
    nats = log_densities(
        one.readings, one.state, seen.residual, seen.misfit, seen.log_volume, found.freedoms
    )
    return scores_of(nats, found.blocks, found.precision)
