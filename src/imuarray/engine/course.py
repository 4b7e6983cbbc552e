"""An estimate along its recording: what more gains, residuals, how likely its readings are."""

import numpy as np
from scipy.special import chdtri

from imuarray.engine.estimate import Estimate
from imuarray.engine.heldout import Scores, blocks_of, log_densities, scores_of
from imuarray.engine.linearise import linearise
from imuarray.engine.parameters import POSITION
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
    readings, seen = found.recorded[0].readings, found.residuals[0]
    time = readings.time + readings.origin
    blocks = blocks_of(
        len(time), int(np.clip(len(time) // SETTINGS.course_samples, 1, SETTINGS.course_stretches))
    )
    squares = seen.distance * (readings.sd / readings.declared) ** 2
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
        np.sum((seen.distance > chdtri(3, SETTINGS.course_shaken)).any(axis=2), axis=1)
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


def changes(found: Estimate) -> tuple[tuple[float, float], tuple[int, float]]:
    """((relative growth, its sd) of the array, (IMU, chi-square) of whom moves most), of a motion.

    From its beginning to its end, by score tests, all parameters refitted. An array that keeps its
    shape grows where the gyroscopes' common scale changes; an sd is infinite where nothing is known
    of it. Of an IMU by its three axes; where all others move alike it is the reference.
    """
    pairs = np.argwhere(found.active)
    placed = pairs[:, 1] < 3
    places, owners = found.places[0][placed], pairs[placed, 0]
    share, left = _changing(found, places)
    size = found.positions[owners, pairs[placed, 1]]
    known, moves = size @ left @ size, []
    growth = (float(size @ share / known), float(known**-0.5)) if known > 0 else (0.0, np.inf)
    for k in range(len(found.positions)):
        each = (owners == k if k else owners > 0)[:, None] * (pairs[placed, 1:2] == np.arange(3))
        inner, slope = each.T @ left @ each, each.T @ share
        sound = np.linalg.eigvalsh(inner)[0] > 0
        moves.append((k, float(slope @ np.linalg.solve(inner, slope)) if sound else 0.0))
    return growth, max(moves, key=lambda move: move[1])


def _changing(found: Estimate, places) -> tuple[np.ndarray, np.ndarray]:
    """(score (k,), information (k, k)) of a change of the parameters at ``places``."""
    share, along, whole = np.zeros(len(places)), 0.0, 0.0
    each = (np.arange(SETTINGS.blocks) + 0.5) / SETTINGS.blocks - 0.5
    middle = np.tile(each, len(found.recorded))
    for when, (inner, slope) in zip(middle, found.blocks, strict=True):
        share += when * slope[places]
        along = along + when * inner[:, places]
        whole = whole + when**2 * inner[np.ix_(places, places)]
    return share, whole - along.T @ scaled_inverse(found.information + found.precision) @ along


def block_scores(found: Estimate) -> Scores:
    """Log densities of a recording's blocks, the parameters trained on its other blocks.

    Noise, degrees of freedom and clocks' phases are those of all blocks.
    """
    (one,) = found.recorded
    made = linearise(one.readings, found.columns, one.state, [])
    nats = log_densities(
        one.readings, one.state, made.residual, made.misfit, made.log_volume, found.freedoms
    )
    return scores_of(nats, found.blocks, found.precision)
